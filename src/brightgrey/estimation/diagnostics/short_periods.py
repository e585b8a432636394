"""Loads that repeat over a shorter way than the simulated position is off: in which period they act is chance."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.diagnostics.finding import Finding
from brightgrey.estimation.problem.segments import segments
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.kit.in_words import effect_in_words
from brightgrey.recordings.units.signals import KINDS

__all__ = ["short_period_findings"]


def short_period_findings(
    problem: SimulationErrorProblem, values: Mapping[str, float], residual: Array
) -> list[Finding]:
    """Report loads over the position whose angle is off by more than one radian (RMS), where positions are measured.

    A simulation that is off by a part of the period meets the load elsewhere than the drive did. The cost has an
    optimum for each way to do so, and its curvature at one of them says nothing of the others.

    Parameters
    ----------
    problem : SimulationErrorProblem
    values : mapping of str to float
        SI.
    residual : ndarray, shape (residuals,)
        Weighted residual at these values.
    """
    off, unit, factor = 0.0, "", 1.0
    for rows, r, output in segments(problem.recordings):
        signal = r.outputs[output]
        if KINDS[signal.kind] == 0:
            error = float(np.sqrt(np.mean(np.square(residual[rows])))) / float(problem.weights[output])
            off, unit, factor = max(off, error), signal.unit, signal.factor
    found = []
    for placed in problem.structure.placed:
        if placed.effect.search.wave is None:
            continue
        number = values[placed.parameter(placed.effect.search.wave[0])]
        if number * off > 1.0:
            period = 2.0 * np.pi / number
            text = (
                f"{effect_in_words(placed)} repeats every {period * factor:.3g} {unit}, and the simulated position is "
                f"{off * factor:.2g} {unit} off (RMS): in which period it acts is chance, and intervals of all "
                "parameters are too narrow"
            )
            names = tuple(placed.parameter(q.symbol) for q in placed.effect.parameters)
            found.append(Finding("chaotic", text, names))
    return found
