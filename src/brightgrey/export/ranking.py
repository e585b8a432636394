"""ranking.csv: one row per structure tried, best first."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from dataclasses import dataclass

__all__ = ["COLUMNS", "Row", "ranking_csv"]

COLUMNS = ("rank", "structure", "n_parameters", "rss", "fit_percent", "criterion", "tied")


@dataclass(frozen=True)
class Row:
    """A structure that was tried.

    Attributes
    ----------
    structure : str
        As it is written, ``two_mass+coulomb``.
    n_parameters : int
        Number of parameters that were estimated.
    rss : float
        Residual sum of squares over all samples and outputs, in the outputs' units.
    fit_percent : float
        Mean over the outputs.
    criterion : float or None
        What the rows are sorted by.
    tied : bool
        The recording cannot tell it from the best.
    """

    structure: str
    n_parameters: int
    rss: float
    fit_percent: float
    criterion: float | None
    tied: bool = False


def ranking_csv(rows: Iterable[Row]) -> str:
    """Text of ranking.csv; `rows` come best first. Floats are written so that they read back the same."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for rank, row in enumerate(rows, 1):
        criterion = "" if row.criterion is None else repr(row.criterion)
        cells = (repr(row.rss), repr(row.fit_percent), criterion, "true" if row.tied else "false")
        writer.writerow((rank, row.structure, row.n_parameters, *cells))
    return text.getvalue()
