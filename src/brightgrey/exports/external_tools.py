"""Other programs and libraries: find them, run them, and name the one that is missing."""

from __future__ import annotations

import importlib
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from brightgrey.errors import BrightgreyError

__all__ = ["ExportError", "MissingToolError", "import_library", "program", "run_program"]

TIME_LIMIT = 600.0  # s that a tool chain may take


class MissingToolError(Exception):
    """The tool that verifies an export is not installed; the message names it."""


class ExportError(BrightgreyError):
    """The tool chain of an export refused it or failed on it."""


def program(name: str) -> str:
    """Path of a program.

    Raises
    ------
    MissingToolError
    """
    found = shutil.which(name)
    if found is None:
        raise MissingToolError(f"{name} is not installed")
    return found


def import_library(name: str, extra: str) -> Any:
    """Python package that comes with an extra of brightgrey.

    Raises
    ------
    MissingToolError
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise MissingToolError(f"{name} is not installed (pip install 'brightgrey[{extra}]')") from None


def run_program(arguments: Sequence[str | Path], folder: Path, text: str = "") -> str:
    """Run a program in `folder` and return its standard output.

    Raises
    ------
    ExportError
        If it fails or takes too long; the message has the first line of its complaint.
    """
    try:
        done = subprocess.run(
            [str(a) for a in arguments], cwd=folder, input=text, capture_output=True, text=True, timeout=TIME_LIMIT
        )
    except subprocess.TimeoutExpired:
        raise ExportError(f"{Path(arguments[0]).name} did not end within {TIME_LIMIT:.0f} s") from None
    if done.returncode:
        lines = [line for line in (done.stderr + done.stdout).splitlines() if line.strip()]
        first = next((line for line in lines if "error" in line.lower() or line.startswith("!")), (lines or ["?"])[0])
        raise ExportError(f"{Path(arguments[0]).name} failed: {first}")
    return done.stdout
