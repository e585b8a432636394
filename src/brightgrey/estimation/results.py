"""What an estimation hands back: frozen values in SI, also where it failed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from brightgrey.kit import Structure
from brightgrey.simulation import Settings

__all__ = ["Estimate", "Fit", "Outcome", "OutcomeKind", "OutputFit", "Start"]

OutcomeKind = Literal[
    "converged", "at bound", "not identifiable", "evaluation limit", "diverged", "abandoned", "nothing to do"
]


@dataclass(frozen=True)
class Estimate:
    """One parameter in SI units.

    Attributes
    ----------
    value : float
    std : float
        Standard deviation; 0 for a fixed parameter, NaN at a bound (the quadratic picture does not hold there), inf
        where the recording says nothing.
    ci95 : tuple of float
        95 % interval, symmetric in the parameter's scale: around a logarithmic one it is lopsided. NaN at a bound.
    at_bound : {'low', 'high'} or None
    """

    value: float
    std: float
    ci95: tuple[float, float]
    at_bound: Literal["low", "high"] | None = None


@dataclass(frozen=True)
class OutputFit:
    """How well one output is met, all recordings taken together.

    Attributes
    ----------
    rss : float
        Residual sum of squares in the output's SI unit squared; NaN if a simulation diverged.
    rmse : float
        Root of the mean square residual.
    fit_percent : float
        100 (1 - |y - ysim| / |y - mean y|), the mean taken per recording.
    """

    rss: float
    rmse: float
    fit_percent: float


@dataclass(frozen=True)
class Outcome:
    """How it ended. `text` is one sentence for people."""

    kind: OutcomeKind
    text: str


@dataclass(frozen=True)
class Start:
    """One start of the search.

    Attributes
    ----------
    begin, end : mapping of str to float
        Values of the free parameters, SI.
    rss : float
        Residual sum of squares at the end, outputs weighted relative to the first one; NaN if diverged.
    outcome : Outcome
    evaluations : int
        Parameter sets that were simulated.
    """

    begin: Mapping[str, float]
    end: Mapping[str, float]
    rss: float
    outcome: Outcome
    evaluations: int


@dataclass(frozen=True)
class Fit:
    """Structure with estimated parameters.

    Attributes
    ----------
    structure : Structure
    estimates : mapping of str to Estimate
        All parameters, fixed ones too.
    bounds : mapping of str to (low, high)
        Ranges that were searched, SI; free parameters only.
    settings : Settings
        With the hold of the first recording.
    initial_states : tuple of mapping of str to float
        Per recording, by state name, SI.
    train : mapping of str to OutputFit
        By output name.
    outcome : Outcome
    cost : float
        Half the sum of squared residuals, each divided by its output's noise level.
    evaluations : int
        Parameter sets that were simulated in all.
    starts : tuple of Start
        The one from the declarations first.
    """

    structure: Structure
    estimates: Mapping[str, Estimate]
    bounds: Mapping[str, tuple[float, float]]
    settings: Settings
    initial_states: tuple[Mapping[str, float], ...]
    train: Mapping[str, OutputFit]
    outcome: Outcome
    cost: float
    evaluations: int
    starts: tuple[Start, ...]
