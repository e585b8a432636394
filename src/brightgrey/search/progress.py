"""Progress of a search."""

from __future__ import annotations

from dataclasses import dataclass

from brightgrey.kit import Structure

__all__ = ["SearchProgress"]


@dataclass(frozen=True)
class SearchProgress:
    """Progress of a search: the name of its stage, how much of it is done, and the best structure so far."""

    name: str
    done: int
    total: int | None
    structure: Structure
