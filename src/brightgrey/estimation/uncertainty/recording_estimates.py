"""Estimates of the parameters that differ between recordings, for each recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from brightgrey.estimation.problem.per_recording import deviation_shares
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.estimation.uncertainty.estimates import Estimate, Estimates

__all__ = ["estimates_in_recordings", "with_spread"]


def estimates_in_recordings(problem: SimulationErrorProblem, estimates: Estimates) -> dict[str, tuple[Estimate, ...]]:
    """Estimates in each recording, by parameter; empty where nothing may differ.

    A value is the sum of the mean and of deviations, of logarithms for positive parameters. So its variance follows
    from theirs and from the correlation of their errors. The quantile is that of the mean.
    """
    names = [part.name for part in problem.deviations]
    tags = [state.tag for state in problem.initial_states]
    return {
        parameter: tuple(
            _in_recording(problem, estimates, parameter, deviation_shares(parameter, t, names)) for t in tags
        )
        for parameter in problem.structure.parameters
        if deviation_shares(parameter, tags[0], names)
    }


def with_spread(estimate: Estimate, each: tuple[Estimate, ...]) -> Estimate:
    """Estimate of a mean with the standard deviation between recordings; as it is if nothing differs."""
    if not each:
        return estimate
    return replace(estimate, between=float(np.std([e.value for e in each], ddof=1)))


def _in_recording(
    problem: SimulationErrorProblem, estimates: Estimates, parameter: str, shares: Mapping[str, float]
) -> Estimate:
    mean = estimates.by_name[parameter]
    is_log = problem.structure.parameters[parameter].scale == "log"
    factors = {parameter: 1.0, **shares}
    # in the scale in which they are added
    stds = {name: estimates.by_name[name].std for name in factors}
    stds[parameter] = mean.std / mean.value if is_log else mean.std
    variance = sum(
        a * b * stds[m] * stds[n] * estimates.correlation.get((m, n), np.nan)
        for m, a in factors.items()
        for n, b in factors.items()
    )
    std = float(np.sqrt(max(variance, 0.0))) if np.isfinite(variance) else np.nan
    deviation = sum(share * estimates.by_name[name].value for name, share in shares.items())
    if not is_log:
        value, quantile = mean.value + deviation, (mean.ci95[1] - mean.value) / mean.std if mean.std else np.nan
        return Estimate(value, std, (value - quantile * std, value + quantile * std), None)
    value = mean.value * float(np.exp(deviation))
    if mean.ci95[0] == 0.0:  # a size that may be zero as well
        half = (mean.ci95[1] / mean.value - 1.0) / stds[parameter] * std
        return Estimate(value, value * std, (max(value * (1.0 - half), 0.0), value * (1.0 + half)), None)
    quantile = float(np.log(mean.ci95[1] / mean.value)) / stds[parameter] if mean.std else np.nan
    factor = float(np.exp(quantile * std))
    return Estimate(value, value * std, (value / factor, value * factor), None)
