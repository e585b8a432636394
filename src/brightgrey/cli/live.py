"""Where a genetic search stands, live on a terminal's stderr."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from brightgrey.search.genetic import Progress as Step

__all__ = ["generations"]


@contextmanager
def generations(what: str, *, silent: bool) -> Iterator[Callable[[Step, str], None]]:
    """Show generation, best structure, its fit and the time left; Ctrl-C ends the search with the best so far.

    Yields a function of a step and a word on what is being searched.
    """
    console = Console(stderr=True, markup=False, emoji=False, highlight=False)
    if silent or not console.is_terminal:
        yield lambda step, about: None
        return
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TextColumn("{task.fields[left]}", markup=False),
        TextColumn("{task.fields[best]}", markup=False),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        start = f"{what} (the first run after installation compiles for some seconds; Ctrl-C keeps the best so far)"
        task = progress.add_task(start, total=None, left="", best="")

        def show(step: Step, about: str) -> None:
            best = f"{step.best.job.structure}  fit {step.fit_percent:.2f} %"
            progress.update(
                task,
                description=f"{about}: generation",
                total=step.generations,
                completed=step.generation,
                left=f"{step.seconds_left:.0f} s left",
                best=best,
            )

        yield show
