"""Course of a search: error over size of every structure, best criterion of every generation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from brightgrey.kit import Structure
from brightgrey.kit.in_words import structure_in_words
from brightgrey.model.ranking import Row, front
from brightgrey.report.charts.chart import Chart, Line, Panel
from brightgrey.report.options import REPORT_OPTIONS

if TYPE_CHECKING:
    from brightgrey.search.genetic import Evaluation, Run

__all__ = ["ancestors", "front_chart", "history_chart", "parents"]


def front_chart(rows: Sequence[Row], chosen: str) -> tuple[Chart, ...]:
    """Unexplained motion of each structure over its number of parameters; `chosen` is marked."""
    finite = [r for r in rows if np.isfinite(r.fit_percent) and r.fit_percent > 0.0]
    if len(finite) < REPORT_OPTIONS.min_front:
        return ()

    def line(part: Sequence[Row], label: str, colour: str, style: str, width: float) -> Line:
        x = np.array([float(r.n_parameters) for r in part])
        y = np.array([100.0 - r.fit_percent for r in part])
        texts = tuple(structure_in_words(Structure.parse(r.structure)) for r in part)
        return Line(x, y, label, colour, style, width, texts=texts)  # type: ignore[arg-type]

    tied = [r for r in finite if r.tied and r.structure != chosen]
    lines = [
        line([r for r in finite if not r.tied], "tried", "measured", "points", 2.0),
        line(front(finite), "Pareto front", "simulated", "line", 1.2),
    ]
    lines += [line(tied, "tied with the chosen", "second", "points", 4.0)] if tied else []
    lines += [line([r for r in finite if r.structure == chosen], "chosen", "residual", "points", 4.5)]
    panel = Panel("unexplained motion\nin % (100 - fit)", tuple(lines), "estimated parameters", y_log=True)
    caption = f"{len(finite)} structures were tried. The lower, the better the fit; the further left, the simpler."
    return (Chart("pareto", (panel,), caption),)


def history_chart(run: Run | None) -> tuple[Chart, ...]:
    """Criterion of the best individual of every generation, and of the best so far; none without a genetic search."""
    if run is None or run.generations < 2:
        return ()
    best = [run.best_of(number) for number in range(run.generations)]
    values = np.array([e.value for e in best])
    generation = np.arange(float(run.generations))
    texts = tuple(structure_in_words(e.job.structure) for e in best)
    lines = (
        Line(generation, np.maximum.accumulate(values), "best so far", "simulated"),
        Line(generation, values, "best of the generation", "residual", "points", 3.0, texts=texts),
    )
    panel = Panel("criterion\n(larger is better)", lines, "generation")
    caption = f"{run.identifications} identifications, {run.simulations} simulations."
    return (Chart("history", (panel,), caption + (" Interrupted." if run.interrupted else "")),)


def parents(run: Run, e: Evaluation) -> tuple[Evaluation, ...]:
    """Parents of an individual; of an elite, the same individual of an earlier generation."""
    before = [other for other in run.evaluations if other.generation < e.generation]
    if not e.parents:  # an elite, of the first generation, or identified besides
        same = [other for other in before if other.job.structure == e.job.structure and e.operator == "elite"]
        return (max(same, key=lambda other: (other.value, other.generation)),) if same else ()
    return tuple(o for o in before if o.generation == e.generation - 1 and o.individual in e.parents)


def ancestors(run: Run) -> tuple[Evaluation, ...]:
    """The best individual and all its ancestors, the youngest first."""
    found: dict[tuple[int, int], Evaluation] = {}
    ahead = [run.best]
    while ahead:
        e = ahead.pop(0)
        if found.setdefault((e.generation, e.individual), e) is e:
            ahead += parents(run, e)
    return tuple(sorted(found.values(), key=lambda e: (-e.generation, e.individual)))
