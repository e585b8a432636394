"""The command ``brightgrey``, also as ``python -m brightgrey``."""

import atexit
import gc
import os
import sys
from typing import NoReturn

__all__ = ["run"]


def run() -> NoReturn:
    """Run the program and end the process."""
    code = _program()
    try:
        for stream in filter(None, (sys.stdout, sys.stderr)):  # None if it was closed
            stream.flush()
    except (OSError, ValueError):
        sys.exit(code)  # Python says what could not be written
    # Python would take everything apart, which needs half a second. The system takes all of it back at once.
    atexit._run_exitfuncs()
    os._exit(code)


def _program() -> int:
    """Import the program and run it; an interruption in the meantime ends with one line and exit code 130.

    What is imported stays. Looking through it for garbage at every 700 new objects takes a tenth of the start. At half
    a million, no command that takes seconds looks at all; the demo's search then holds 2 % more memory.
    """
    try:
        gc.set_threshold(500_000)
        from brightgrey.cli import main

        return main()
    except KeyboardInterrupt:
        pass
    except RuntimeError as error:  # Python 3.11 wraps what interrupts the definition of a class
        if not isinstance(error.__cause__, KeyboardInterrupt):
            raise
    sys.stderr.write("brightgrey: interrupted, nothing written\n")
    return 130


if __name__ == "__main__":
    run()
