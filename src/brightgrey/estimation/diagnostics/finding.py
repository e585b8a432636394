"""One thing to say about a fit, as a value."""

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
    "not observable",
    "scale unknown",
    "chaotic",
]
"""From ``diverged`` to ``converged`` the gravest first, these may be the outcome; the rest are cautions beside it."""


@dataclass(frozen=True)
class Finding:
    """What there is to say, and of which parameters.

    Attributes
    ----------
    kind : str
    text : str
        One sentence without its full stop.
    parameters : tuple of str
    """

    kind: Kind
    text: str
    parameters: tuple[str, ...] = ()
