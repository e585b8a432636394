"""Progress of the compilation that the first run after an installation begins with."""

from __future__ import annotations

import sys

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

__all__ = ["compile_kernel"]


def compile_kernel(*, silent: bool) -> None:
    """Compile the simulator if that has not been done since the installation, with a bar on a terminal's stderr."""
    from brightgrey.simulation import is_kernel_ready, prepare_kernel

    if is_kernel_ready():
        return
    if silent or not sys.stderr.isatty():
        prepare_kernel()
        return
    console = Console(stderr=True, markup=False, emoji=False, highlight=False)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(bar_width=20), MofNCompleteColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("compiling the simulator, once after an installation", total=None)
        prepare_kernel(lambda done, total, entry: progress.update(task, completed=done, total=total))
