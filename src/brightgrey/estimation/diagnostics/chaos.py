"""A load that rattles freely: derivatives that contacts have made meaningless in the end."""

from __future__ import annotations

import numpy as np

from brightgrey.estimation.diagnostics.finding import Finding
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian, neighbours
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem, systems
from brightgrey.simulation import Settings, response

__all__ = ["chaos_findings"]


def chaos_findings(
    problem: SimulationErrorProblem, search: ParameterSpace, settings: Settings, best: OptimumWithJacobian
) -> list[Finding]:
    """Say so if derivatives at the best fit had to begin anew on the way.

    Every contact multiplies what two simulations differ by. Where a millionth of a parameter has come to a
    hundredth of a gap, derivatives go on from one state (:class:`brightgrey.simulation.Response`), and what is
    told of parameters from there on rests on the stretch from one such sample to the next.
    """
    if not (problem.has_hard_limit and search.names and np.isfinite(best.cost)):
        return []
    _, sets = neighbours(search.to_scaled(best.values)[None, :], search)
    values, group = search.named(sets[:, 0, :]), 1 + len(search.names)
    times, length = 0, 0.0
    for r, onset in zip(problem.recordings, problem.initial_states, strict=True):
        system, u, x0 = systems(problem.structure, values, r, settings, initial_state=onset, gain=problem.gain)
        found = response(system, u, r.dt, x0, settings, group=group, threads=problem.threads)
        each = np.bincount(found.rejoined[:, 1], minlength=group)  # of every set: large groups rejoin in parts
        times, length = times + int(each.max()), length + r.samples * r.dt
    if not times:
        return []
    often = "once" if times == 1 else f"{times} times"
    text = (
        f"a difference of a millionth in a parameter grows to a hundredth of the gap {often} in {length:.3g} s: "
        "intervals rest on shorter stretches and are hardly to be trusted"
    )
    return [Finding("chaotic", text)]
