"""The cascade that drives have: P control of position around PI control of speed, with suggested gains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.control.linear.analysis import Analysis
from brightgrey.control.linear.controllability import minimal_realisation
from brightgrey.control.linear.margins import (
    Compensator,
    Margins,
    frequency_grid,
    frequency_response,
    stability_margins,
)
from brightgrey.errors import SettingsError
from brightgrey.kit import Linear

__all__ = ["Cascade", "CascadeGoal", "design_cascade", "position_loop_margins", "speed_loop_margins"]

_STEP = 1.5  # ratio of neighbouring gains in the search; then the last step is halved some times
_BISECTIONS = 4
_RESET = 4.0  # reset time in units of 1/crossover: costs 14 degrees of phase


@dataclass(frozen=True)
class CascadeGoal:
    """What a loop has to keep: gain margin (factor), phase margin (degrees), peaks of sensitivity and position."""

    gain: float = 2.0
    phase: float = 45.0
    sensitivity: float = 2.0
    overshoot: float = 1.05


@dataclass(frozen=True)
class Cascade:
    """Gains of the cascade.

    ``v_ref = position (q_ref - q) + q_ref'``, ``u = speed (e + integral of e / reset)`` with ``e = v_ref - v``.

    Attributes
    ----------
    position : float
        1/s.
    speed : float
        N m s/rad (N s/m).
    reset : float
        s.
    speed_margins, position_margins : tuple of Margins
        Of the speed loop alone and of the whole cascade opened at the drive's input, for each model it was asked for.
    """

    position_gain: float
    speed_gain: float
    reset_time: float
    speed_margins: tuple[Margins, ...]
    position_margins: tuple[Margins, ...]

    @property
    def controller(self) -> Compensator:
        """The PI controller of speed."""
        return _pi_controller(self.speed_gain, self.reset_time)


def _pi_controller(gain: float, reset: float) -> Compensator:
    return Compensator.of([gain, gain / reset], [1.0, 0.0])


def _output_row(analysis: Analysis, name: str) -> Array:
    if name not in analysis.outputs:
        raise SettingsError(f"the cascade needs the model's outputs position and velocity; '{name}' is not among them")
    return np.asarray(analysis.linear.C[analysis.outputs.index(name)])


def speed_loop_margins(analysis: Analysis, gain: float, reset: float, delay: float) -> Margins:
    """Margins of the speed loop; `delay` in s on top of the drive's dead time."""
    one = minimal_realisation(analysis.linear._replace(C=_output_row(analysis, "velocity")[None], D=np.zeros((1, 1))))
    return stability_margins(one, _pi_controller(gain, reset), dead_time=analysis.dead_time + delay)


def position_loop_margins(
    analysis: Analysis, position: float, gain: float, reset: float, delay: float
) -> tuple[Margins, float]:
    """Margins of the whole cascade opened at the drive's input, and the peak of the response from q_ref to q."""
    q, v = _output_row(analysis, "position"), _output_row(analysis, "velocity")
    both = Linear(analysis.linear.A, analysis.linear.B, (v + position * q)[None], np.zeros((1, 1)))
    total = analysis.dead_time + delay
    found = stability_margins(minimal_realisation(both), _pi_controller(gain, reset), dead_time=total)
    omega = frequency_grid(np.linalg.eigvals(both.A).tolist(), top=20.0 * max(position, 1.0))
    K = _pi_controller(gain, reset).response(omega)
    loop = K * frequency_response(both, omega, total)[0]
    way = K * frequency_response(both._replace(C=q[None]), omega, total)[0]
    return found, float(np.abs(position * way / (1.0 + loop)).max())


def design_cascade(
    analyses: Sequence[Analysis],
    inertia: float,
    dt: float,
    *,
    computing_time: float = 0.0,
    goal: CascadeGoal | None = None,
) -> Cascade:
    """Suggest the gains of the cascade: the stiffest that keep the goal in all models.

    Parameters
    ----------
    analyses : sequence of Analysis
        With the outputs position and velocity; in contact and in the gap, if there is one.
    inertia : float
        Of all masses, kg m² (kg).
    dt : float
        Sampling interval of the controller in s; its hold lags half of it.
    computing : float
        Time from sampling to output, s.
    goal : Goal, optional

    Returns
    -------
    Cascade

    Raises
    ------
    SettingsError
        If even soft gains miss the goal.
    """
    aim = goal or CascadeGoal()
    delay = 0.5 * dt + computing_time
    top = 1.0 / (delay + analyses[0].dead_time)

    def speed_good(w: float) -> bool:
        return all(_meets_goal(speed_loop_margins(a, inertia * w, _RESET / w, delay), aim) for a in analyses)

    crossover = _largest_gain(speed_good, 1e-4 * top, 3.0 * top, "speed loop")
    gain, reset = inertia * crossover, _RESET / crossover

    def position_good(k: float) -> bool:
        found = [position_loop_margins(a, k, gain, reset, delay) for a in analyses]
        return all(_meets_goal(m, aim) and peak <= aim.overshoot for m, peak in found)

    position = _largest_gain(position_good, 1e-3 * crossover, crossover, "position loop")
    return Cascade(
        position,
        gain,
        reset,
        tuple(speed_loop_margins(a, gain, reset, delay) for a in analyses),
        tuple(position_loop_margins(a, position, gain, reset, delay)[0] for a in analyses),
    )


def _meets_goal(found: Margins, goal: CascadeGoal) -> bool:
    enough = found.gain >= goal.gain and found.phase >= goal.phase and found.sensitivity <= goal.sensitivity
    return found.stable and enough


def _largest_gain(good: Callable[[float], bool], low: float, high: float, what: str) -> float:
    """End of the first range of gains that are good, from below."""
    best, bad = None, high
    for value in np.geomspace(low, high, int(np.log(high / low) / np.log(_STEP)) + 2):
        if good(float(value)):
            best = float(value)
        elif best is not None:
            bad = float(value)
            break
    if best is None:
        raise SettingsError(f"{what}: no gain keeps the margins that are asked for")
    for _ in range(_BISECTIONS):
        middle = float(np.sqrt(best * bad))
        best, bad = (middle, bad) if good(middle) else (best, middle)
    return best
