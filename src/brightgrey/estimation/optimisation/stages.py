"""Easier problems that descents pass through: beginnings of the recordings, and output feedback."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brightgrey.estimation.optimisation.options import MULTISTART_DEFAULTS, MultistartOptions
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem

__all__ = ["begins_small", "growing_horizons", "stages_of"]


def growing_horizons(share: float, options: MultistartOptions = MULTISTART_DEFAULTS) -> Iterator[float]:
    """Growing parts of the excitation, less than the whole, on which a drive is fitted in succession.

    Contacts and unstable motions make the valley of the cost narrower the longer the recording is. From one part to
    the next, the estimate has to improve more than the valley narrows.
    """
    while share < 1.0:
        yield share
        share *= options.share_growth


def stages_of(
    problem: SimulationErrorProblem, number: int, options: MultistartOptions, rng: np.random.Generator
) -> list[SimulationErrorProblem]:
    """Easier problems that the descents of batch `number` pass through: truncated ones, or with output feedback."""
    share = options.shares[number % len(options.shares)]
    if problem.has_hard_limit:
        low, high = np.log(options.min_share), np.log(options.first_share)
        share = None if number % 2 else float(np.exp(rng.uniform(low, high)))
    if share is None:
        stages = [problem.with_output_feedback(gain) for gain in options.feedback_shares]
        return [stage for stage in stages if stage is not None]
    shares = growing_horizons(share, options) if begins_small(problem) else [share] if share < 1.0 else []
    parts = [problem.truncated(share) for share in shares]
    longer = [k == 0 or part.samples > parts[k - 1].samples for k, part in enumerate(parts)]
    return [part for part, more in zip(parts, longer, strict=True) if more and part.samples < problem.samples]


def begins_small(problem: SimulationErrorProblem) -> bool:
    """True if descents begin on a small part of the recordings: hard limits and instability make the cost rugged."""
    return problem.has_hard_limit or problem.structure.may_be_unstable
