"""Progress of a search."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from brightgrey.kit import Structure

__all__ = ["BorderProgress", "SearchProgress"]


@dataclass(frozen=True)
class BorderProgress:
    """Border of the adequate structures as it is so far; every part of it may still change."""

    decided: int  #: Parts of the border that are decided: minimal structures, and largest refuted ones.
    left: int  #: Largest structures that have to be fitted yet.
    minimal: tuple[str, ...]  #: The simplest structures that explain the recordings.
    #: Effects that each largest refuted structure lacks, with the RMS of its residual over the least one.
    refuted: tuple[tuple[tuple[str, ...], float], ...]
    most: int  #: Structures that are fitted at most before the search has to end.


@dataclass(frozen=True)
class SearchProgress:
    """Progress of a search: the name of its stage, how much of it is done, and the best structure so far."""

    name: str
    done: int
    total: int | None
    structure: Structure
    fit_percent: float | None = None  #: Of the best structure so far, all outputs together.
    values: Mapping[str, float] | None = None  #: Of the best structure so far, SI.
    border: BorderProgress | None = None  #: None before there is one.
