"""Names that a user of control imports from ``brightgrey.control``."""

import subprocess
import sys

import brightgrey.control


def test_public_names__are_all_importable():
    for name in brightgrey.control.__all__:
        found = getattr(brightgrey.control, name)
        assert found.__name__ == name
        assert found.__module__.startswith("brightgrey.control.")


def test_import__of_the_package__loads_no_numerics():
    code = "import sys, brightgrey.control; print('numpy' in sys.modules, 'scipy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]
