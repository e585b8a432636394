"""ranking.csv: one row per structure tried, best first, and the Pareto front among them."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

__all__ = ["RANKING_COLUMNS", "Row", "front", "ranking_csv"]

RANKING_COLUMNS = ("rank", "structure", "n_parameters", "rss", "fit_percent", "criterion", "tied", "front", "status")


@dataclass(frozen=True)
class Row:
    """A structure that was tried."""

    structure: str  #: As it is written, ``two_mass+coulomb``.
    n_parameters: int  #: Number of parameters that were estimated.
    rss: float  #: Residual sum of squares over all samples and outputs, in the outputs' units.
    fit_percent: float  #: Mean over the outputs.
    criterion: float | None  #: Value that the rows are sorted by.
    tied: bool = False  #: The recording does not distinguish it from the best.
    status: str = ""  #: 'minimal', 'adequate', 'refuted' or 'undecided'; empty where nothing was decided.


def front(rows: Iterable[Row]) -> tuple[Row, ...]:
    """Pareto front of error against number of parameters, few parameters first.

    On it are the structures that no other one beats: none has fewer parameters and an RSS as small, or as few and a
    smaller one. Of equals the first counts; a structure that diverged never does.
    """
    best: dict[int, Row] = {}
    for row in rows:
        known = best.get(row.n_parameters)
        if np.isfinite(row.rss) and (known is None or row.rss < known.rss):
            best[row.n_parameters] = row
    found: list[Row] = []
    for _, row in sorted(best.items()):
        if not found or row.rss < found[-1].rss:
            found.append(row)
    return tuple(found)


def ranking_csv(rows: Sequence[Row]) -> str:
    """Text of ranking.csv; `rows` come best first. Floats are written so that they read back the same.

    `front` marks the Pareto front of RSS against the number of parameters.
    """
    text, ahead = io.StringIO(), {id(row) for row in front(rows)}
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(RANKING_COLUMNS)
    for rank, row in enumerate(rows, 1):
        criterion = "" if row.criterion is None else repr(row.criterion)
        marks = ["true" if mark else "false" for mark in (row.tied, id(row) in ahead)]
        cells = (rank, row.structure, row.n_parameters, repr(row.rss), repr(row.fit_percent), criterion)
        writer.writerow((*cells, *marks, row.status))
    return text.getvalue()
