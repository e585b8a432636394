"""Reference solution by either method, and the comparison of the two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import BrightgreyError, one_of
from brightgrey.kit import Structure
from brightgrey.recordings.recording import Hold
from brightgrey.simulation.reference import adaptive as events
from brightgrey.simulation.reference import fixed_step as fixed
from brightgrey.simulation.reference.plant import Plant, Trajectory, cut, difference
from brightgrey.simulation.reference.tolerances import REFERENCE_TOLERANCES

__all__ = ["Method", "SolverAgreement", "UnsettledError", "compare_solvers", "reference"]

Method = Literal["events", "fixed"]


class UnsettledError(BrightgreyError):
    """The reference did not converge: the system is chaotic, unstable or stiffer than the finest step."""


@dataclass(frozen=True)
class SolverAgreement:
    """Reference solution and measures of its accuracy."""

    y: Array  #: Solution of the method 'fixed' at its finest step, shape (outputs, samples).
    #: Largest distance between the two methods relative to the output's peak (acceleration: RMS of the distance
    #: relative to RMS). NaN where only one method was run. Shape (outputs,).
    difference: Array
    #: The same measure for the response to an input that is changed by 1e-9 of its peak: once shifted, once with a
    #: random sign at every sample. The larger of the two counts, as a shift hardly moves the times of fast contacts.
    #: Shape (outputs,).
    growth: Array
    #: Position or velocity has grown apart by more than 1e-5 of its peak. No step rule is accurate then, so that such
    #: a system has to be listed separately.
    chaotic: bool
    step: float  #: Step of the method 'fixed' in s.


def reference(
    structure: str | Structure,
    values: Mapping[str, float],
    u: Array,
    dt: float,
    *,
    f_tanh: float,
    x0: Array | None = None,
    hold: Hold = "linear",
    outputs: Sequence[str] = ("velocity",),
    actuator: int = 1,
    method: Method = "fixed",
) -> Array:
    """Response of a structure, accurate to about 1e-8 of its peak.

    Parameters
    ----------
    structure : str or Structure
        Such as ``two_mass+coulomb``.
    values : mapping of str to float
        All parameters by name, SI.
    u : ndarray, shape (samples,)
        Input in N m (N). Before the first sample it is u[0].
    dt : float
        Sampling interval in s.
    f_tanh : float
        Gain of eq. (2) in s/rad (s/m). ``math.inf`` is exact dry friction: the sign of the speed is set-valued at
        standstill (Filippov 1988, doi:10.1007/978-94-015-7793-9), and a mass can stick.
    x0 : ndarray, shape (states,), optional
        q.., v.., lambda1, T as far as they exist; standstill at 0 with T = u[0] if not given.
    hold : {'linear', 'zoh'}
        Input between the samples.
    outputs : sequence of str
        ``position``, ``velocity``, ``acceleration`` of mass 1, or any state by name (``q2``, ``lambda1``).
    actuator : int
        Mass that the input acts on.
    method : {'fixed', 'events'}
        The same equations, written down twice: in `fixed_step` and in `adaptive`. 'events' takes longer.

    Returns
    -------
    ndarray, shape (outputs, samples)

    Raises
    ------
    StructureError, SettingsError
        For wrong use.
    UnsettledError
        If the solution does not settle when the step is halved, or leaves the finite numbers.
    """
    plant = Plant.of(str(structure), values, f_tanh, actuator)
    if one_of("method", method, get_args(Method)) == "fixed":
        solution = _fixed(plant, u, dt, x0, hold)
        if not solution.change <= REFERENCE_TOLERANCES.unsettled:
            raise UnsettledError(
                f"'{structure}' still changes by {solution.change:.1e} of its peak"
                f" when the step is halved to {solution.step:.1e} s"
            )
        trajectory = solution.trajectory
    else:
        trajectory = _events(plant, u, dt, x0, hold)
    return np.stack([trajectory.output(kind) for kind in outputs])


def compare_solvers(
    structure: str | Structure,
    values: Mapping[str, float],
    u: Array,
    dt: float,
    *,
    f_tanh: float,
    x0: Array | None = None,
    hold: Hold = "linear",
    outputs: Sequence[str] = ("position", "velocity", "acceleration"),
    actuator: int = 1,
    both: bool = True,
) -> SolverAgreement:
    """Solve by both methods, and twice more with the input changed by 1e-9 of its peak.

    Parameters as for :func:`reference`; ``both=False`` leaves the slower method out, for long benchmarks.

    Returns
    -------
    SolverAgreement

    Raises
    ------
    StructureError, SettingsError
        For wrong use.
    UnsettledError
        If a solution leaves the finite numbers.
    """
    plant = Plant.of(str(structure), values, f_tanh, actuator)
    u = np.asarray(u, dtype=float)
    solution = _fixed(plant, u, dt, x0, hold)
    found = solution.trajectory
    push = REFERENCE_TOLERANCES.push * (float(np.max(np.abs(u))) or 1.0)
    signs = np.random.default_rng(len(u)).choice([-1.0, 1.0], len(u))
    pushed = [_fixed(plant, u + push * change, dt, x0, hold).trajectory for change in (1.0, signs)]
    growth = np.array([max(difference(kind, found, other) for other in pushed) for kind in outputs])
    motion = ("position", "velocity")
    chaotic = any(difference(kind, found, other) > REFERENCE_TOLERANCES.chaos for kind in motion for other in pushed)
    apart = np.full(len(outputs), np.nan)
    if both:
        other = _events(plant, u, dt, x0, hold)
        apart = np.array([difference(kind, found, other) for kind in outputs])
    y = np.stack([found.output(kind) for kind in outputs])
    return SolverAgreement(y, apart, growth, chaotic, solution.step)


def _fixed(plant: Plant, u: Array, dt: float, x0: Array | None, hold: Hold) -> fixed.FixedStepSolution:
    segments = cut(u, dt, plant.T_d, hold)
    solution = fixed.solve_fixed_step(plant, segments, plant.initial(x0, float(u[0])), REFERENCE_TOLERANCES.settled)
    if not np.all(np.isfinite(solution.trajectory.states)):
        raise UnsettledError("the solution left the finite numbers")
    return solution


def _events(plant: Plant, u: Array, dt: float, x0: Array | None, hold: Hold) -> Trajectory:
    segments = cut(u, dt, plant.T_d, hold)
    try:
        return events.solve_adaptive(plant, segments, plant.initial(x0, float(u[0])))
    except (FloatingPointError, OverflowError) as error:
        raise UnsettledError(str(error)) from error
