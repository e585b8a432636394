"""``python -m brightgrey`` is the command ``brightgrey``."""

import sys

from brightgrey.cli import main

sys.exit(main())
