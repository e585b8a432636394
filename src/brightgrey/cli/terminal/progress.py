"""Where a search stands, live on a terminal's stderr."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn

from brightgrey.cli.terminal.compilation import compile_kernel
from brightgrey.kit.in_words import structure_in_words
from brightgrey.search.genetic import Progress as Step
from brightgrey.search.progress import SearchProgress

__all__ = ["counted", "steps"]

NARROW, WIDE = 80, 120  # characters: below there is no bar, and from there on the best structure is shown


@contextmanager
def counted(what: str, *, silent: bool) -> Iterator[Callable[[int, int], None]]:
    """Show how many of a known number of calls are done, and the time left; yields a function of both numbers."""
    compile_kernel(silent=silent)
    if silent or not sys.stderr.isatty():
        yield lambda done, total: None
        return
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(what, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


@contextmanager
def steps(what: str, *, silent: bool) -> Iterator[Callable[[SearchProgress | Step, str], None]]:
    """Show how far a search has come, the best structure and the time left; Ctrl-C ends a genetic one with the best.

    Yields a function of a step and a word on what is being searched.
    """
    compile_kernel(silent=silent)
    console = Console(stderr=True, markup=False, emoji=False, highlight=False)
    if silent or not sys.stderr.isatty():
        yield lambda step, about: None
        return
    narrow = console.width < NARROW  # then only what cannot be done without
    columns: tuple[ProgressColumn, ...] = (
        TextColumn("{task.description}", markup=False),
        *(() if narrow else (BarColumn(bar_width=16),)),
        TextColumn("{task.fields[count]}", markup=False),
        TextColumn("{task.fields[left]}", markup=False),
        *((TextColumn("{task.fields[best]}", markup=False),) if console.width >= WIDE else ()),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(what, total=None, count="", left="", best="")

        begun = time.monotonic()
        stages: set[str] = set()

        def show(step: SearchProgress | Step, about: str) -> None:
            if isinstance(step, SearchProgress):
                left = _left(step, time.monotonic() - begun)
                shown = (
                    step.name if narrow else f"{about}: {step.name}",
                    step.total,
                    step.done,
                    left,
                    structure_in_words(step.structure),
                )
            else:
                best = f"{structure_in_words(step.best.job.structure)}, fit {step.fit_percent:.2f} %"
                left = f"{step.seconds_left:.0f} s left" + ("" if narrow else "; Ctrl-C keeps the best so far")
                shown = (
                    "generation" if narrow else f"{about}: generation",
                    step.generations,
                    step.generation,
                    left,
                    best,
                )
            description, total, done, left, best = shown
            fresh = description not in stages  # drawn at once: a stage may be over before the next frame
            stages.add(description)
            count = f"{done} fits" if total is None else f"{done}/{total}"
            progress.update(
                task, description=description, total=total, completed=done, count=count, left=left, best=best
            )
            if fresh:
                progress.refresh()

        yield show


def _left(step: SearchProgress, passed: float) -> str:
    """Time that is left; of a border also its parts that are decided and left, which may become more."""
    if step.total is not None:
        return f"{passed * (step.total - step.done) / step.done:.0f} s left"
    if step.border is None:
        return ""
    decided, left = step.border.decided, step.border.left
    least = f", {passed * left / step.done:.0f} s or more" if step.done and left else ""  # a structure for each part
    return f"{decided} decided, {left} left{least}"
