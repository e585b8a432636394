"""Repetitions of a genetic search with many seeds, and the rates at which it finds the true structure."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, fields

import numpy as np

from brightgrey.kit import Structure
from brightgrey.numerics.proportions import wilson_interval
from brightgrey.paper.experiment import RecoveryVerdict, first_appearance, recovery_verdict
from brightgrey.search.genetic.history import Run

__all__ = ["RunSummary", "Summary", "repetitions_csv", "summarise_run", "summary"]


@dataclass(frozen=True)
class RunSummary:
    """Result of one search whose true structure is known."""

    seed: int
    #: Best structure of all generations, and of the last one.
    best: str
    last: str
    #: See :func:`brightgrey.paper.experiment.recovery_verdict`.
    best_verdict: RecoveryVerdict
    last_verdict: RecoveryVerdict
    first: int | None  #: Generation in which the true structure first is in the population.
    #: Parameter sets that were simulated; the same, each counted by its share of the recordings' samples; structures
    #: that were identified.
    simulations: int
    passes: int
    identifications: int
    generations: str  #: Best structure of each generation, separated by spaces.


@dataclass(frozen=True)
class Summary:
    """Rates and medians over several repetitions."""

    count: int
    #: Best individual of all generations has the true structure; the true one with redundant extras.
    true: int
    extras: int
    #: Wilson intervals (95 %) of the rates of `true`, and of `true` or `extras`.
    interval: tuple[float, float]
    lenient: tuple[float, float]
    last_true: int  #: Best individual of the last generation has the true structure.
    seen: int  #: Runs in which the true structure was identified in any generation.
    #: Median of the generation in which it first appeared; None if it did in fewer than half of the runs.
    first: float | None
    #: Medians.
    simulations: float
    passes: float


def summarise_run(done: Run, truth: Structure, seed: int) -> RunSummary:
    """Summary of a search for the structure `truth`."""
    per_generation = [done.best_of(g).job.structure for g in range(done.generations)]
    best = done.best.job.structure
    return RunSummary(
        seed=seed,
        best=str(best),
        last=str(per_generation[-1]),
        best_verdict=recovery_verdict(best, truth),
        last_verdict=recovery_verdict(per_generation[-1], truth),
        first=first_appearance(done, truth),
        simulations=done.simulations,
        passes=round(done.passes),
        identifications=done.identifications,
        generations=" ".join(map(str, per_generation)),
    )


def summary(repetitions: Sequence[RunSummary]) -> Summary:
    """Rates over at least one repetition."""
    n = len(repetitions)
    true = sum(r.best_verdict == "true" for r in repetitions)
    extras = sum(r.best_verdict == "true with extras" for r in repetitions)
    first = float(np.median([np.inf if r.first is None else r.first for r in repetitions]))
    return Summary(
        count=n,
        true=true,
        extras=extras,
        interval=wilson_interval(true, n),
        lenient=wilson_interval(true + extras, n),
        last_true=sum(r.last_verdict == "true" for r in repetitions),
        seen=sum(r.first is not None for r in repetitions),
        first=first if np.isfinite(first) else None,
        simulations=float(np.median([r.simulations for r in repetitions])),
        passes=float(np.median([r.passes for r in repetitions])),
    )


def repetitions_csv(repetitions: Iterable[RunSummary]) -> str:
    """One row per seed."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([f.name for f in fields(RunSummary)])
    writer.writerows(["" if cell is None else cell for cell in astuple(r)] for r in repetitions)
    return text.getvalue()
