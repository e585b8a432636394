"""``brightgrey inspect``: what is in a file, and the command that would identify it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from brightgrey.cli.options.common import Json

__all__ = ["inspect"]


def inspect(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE", help="Recordings in any format, one or more.", show_default=False)
    ],
    json: Json = False,
) -> None:
    """Show what is in a file: channels, units, rates, holes, and what each channel might be.

    The end is the complete command that would identify the drive, and what the file does not say.
    """
    from brightgrey.api.inspection import inspect as inspect_file
    from brightgrey.cli.terminal.inspection import show_inspections

    show_inspections([inspect_file(file) for file in files], json=json)
