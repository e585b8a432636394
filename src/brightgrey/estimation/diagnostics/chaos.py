"""Chaotic simulations: a load that rattles freely, so that contacts amplify small differences."""

from __future__ import annotations

import numpy as np

from brightgrey.estimation.diagnostics.finding import Finding
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian, neighbours
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem, systems
from brightgrey.simulation import Settings, response

__all__ = ["chaos_findings"]


def chaos_findings(
    problem: SimulationErrorProblem, space: ParameterSpace, settings: Settings, best: OptimumWithJacobian
) -> list[Finding]:
    """Report if the derivatives at the optimum had to be restarted within a recording.

    Every contact amplifies the difference of two simulations. Where a millionth of a parameter has grown to a hundredth
    of a gap, derivatives continue from a common state (:class:`brightgrey.simulation.Response`). What they say about
    parameters then rests on the time between two such samples.
    """
    if not (problem.has_hard_limit and space.names and np.isfinite(best.cost)):
        return []
    _, sets = neighbours(space.to_scaled(best.values)[None, :], space)
    values, group = space.named(sets[:, 0, :]), 1 + len(space.names)
    restarts, duration = 0, 0.0
    for r, state in zip(problem.recordings, problem.initial_states, strict=True):
        system, u, x0 = systems(problem.structure, values, r, settings, initial_state=state, gain=problem.gain)
        found = response(system, u, r.dt, x0, settings, group=group)
        each = np.bincount(found.rejoined[:, 1], minlength=group)  # of every set: large groups rejoin in parts
        restarts, duration = restarts + int(each.max()), duration + r.samples * r.dt
    if not restarts:
        return []
    times = "once" if restarts == 1 else f"{restarts} times"
    text = (
        f"a difference of a millionth in a parameter grows to a hundredth of the gap {times} in {duration:.3g} s: "
        "intervals rest on shorter times and are unreliable"
    )
    return [Finding("chaotic", text)]
