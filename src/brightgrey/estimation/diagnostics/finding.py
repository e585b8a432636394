"""Findings: statements about a fit, as values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["Finding", "Kind"]

Kind = Literal[
    "diverged",
    "not identifiable",
    "recordings disagree",
    "saturated",
    "at bound",
    "evaluation limit",
    "converged",
    "uninformative",
    "equivalent model",
    "sampling",
    "confounded",
    "contradicted",
    "not observable",
    "scale unknown",
    "chaotic",
    "unstable",
]
"""Kinds of findings, the gravest first. Up to ``converged`` they may be the outcome; the rest are cautions."""


@dataclass(frozen=True)
class Finding:
    """A statement about a fit."""

    kind: Kind
    text: str  #: One sentence without its full stop.
    parameters: tuple[str, ...] = ()  #: Parameters that it is about.
