"""Cascade control: P control of position around PI control of speed, with suggested gains."""

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


@dataclass(frozen=True)
class CascadeGoal:
    """Requirements on the loops of a cascade, and resolution of the search for the largest gains that meet them."""

    gain: float = 2.0  #: Smallest gain margin, a factor.
    phase: float = 45.0  #: Smallest phase margin, degrees.
    sensitivity: float = 2.0  #: Largest peak of the sensitivity.
    overshoot: float = 1.05  #: Largest peak of the response from reference position to position.
    #: Reset time of the PI controller times the crossover frequency; 4 costs 14 degrees of phase.
    reset_crossover: float = 4.0
    gain_step: float = 1.5  #: Ratio of neighbouring gains in the search.
    bisections: int = 4  #: Bisections of the last step of the search.
    slower: int = 6  #: Speed loops that are tried, from the fastest one on,
    slower_step: float = 0.75  #: and the ratio of their crossover frequencies.
    position_low: float = (
        1e-2  #: Position gain over the crossover frequency at which the search for the largest begins,
    )
    position_bisections: int = 7  #: and its bisections up to the crossover frequency.


CASCADE_GOAL = CascadeGoal()


@dataclass(frozen=True)
class Cascade:
    """Gains of the cascade.

    ``v_ref = position_gain (q_ref - q) + q_ref'`` and ``u = speed_gain (e + integral of e / reset_time)`` with the
    control error ``e = v_ref - v``.
    """

    position_gain: float  #: 1/s.
    speed_gain: float  #: N m s/rad (N s/m).
    reset_time: float  #: s.
    #: Of the speed loop alone, and of the whole cascade opened at the drive's input, for each model of the design.
    speed_margins: tuple[Margins, ...]
    position_margins: tuple[Margins, ...]

    @property
    def stiffness(self) -> float:
        """Servo stiffness: torque per position error as long as the integral does not act, N m/rad (N/m)."""
        return self.position_gain * self.speed_gain

    @property
    def controller(self) -> Compensator:
        """PI controller of speed."""
        return _pi_controller(self.speed_gain, self.reset_time)


def _pi_controller(gain: float, reset: float) -> Compensator:
    return Compensator.of([gain, gain / reset], [1.0, 0.0])


def _output_row(analysis: Analysis, name: str) -> Array:
    if name not in analysis.outputs:
        raise SettingsError(f"the cascade needs the outputs position and velocity; the model has no output '{name}'")
    return np.asarray(analysis.linear.C[analysis.outputs.index(name)])


def speed_loop_margins(analysis: Analysis, gain: float, reset: float, delay: float) -> Margins:
    """Stability margins of the speed loop; `delay` in s is added to the drive's dead time."""
    one = minimal_realisation(analysis.linear._replace(C=_output_row(analysis, "velocity")[None], D=np.zeros((1, 1))))
    return stability_margins(one, _pi_controller(gain, reset), dead_time=analysis.dead_time + delay)


def position_loop_margins(
    analysis: Analysis, position: float, gain: float, reset: float, delay: float
) -> tuple[Margins, float]:
    """Stability margins of the cascade opened at the drive's input, and the peak of the response from q_ref to q."""
    q, v = _output_row(analysis, "position"), _output_row(analysis, "velocity")
    both = Linear(analysis.linear.A, analysis.linear.B, (v + position * q)[None], np.zeros((1, 1)))
    total = analysis.dead_time + delay
    found = stability_margins(minimal_realisation(both), _pi_controller(gain, reset), dead_time=total)
    omega = frequency_grid(np.linalg.eigvals(both.A).tolist(), top=20.0 * max(position, 1.0))
    K = _pi_controller(gain, reset).response(omega)
    loop = K * frequency_response(both, omega, total)[0]
    forward = K * frequency_response(both._replace(C=q[None]), omega, total)[0]
    return found, float(np.abs(position * forward / (1.0 + loop)).max())


def design_cascade(
    analyses: Sequence[Analysis],
    inertia: float,
    dt: float,
    *,
    computing_time: float = 0.0,
    goal: CascadeGoal = CASCADE_GOAL,
) -> Cascade:
    """Design the cascade with the largest servo stiffness that meets the goal in all models.

    The fastest speed loop has no phase to spare, and a position loop around it would be very slow. So slower speed
    loops are tried as well, each with the largest position gain that meets the goal.

    Parameters
    ----------
    analyses : sequence of Analysis
        With the outputs position and velocity; in contact and, if there is a gap, in the gap.
    inertia : float
        Of all masses, kg m² (kg).
    dt : float
        Sampling interval of the controller, s. Its hold delays the torque by half of it.
    computing_time : float
        Time from sampling to output, s.
    goal : CascadeGoal

    Returns
    -------
    Cascade

    Raises
    ------
    SettingsError
        If even small gains miss the goal.
    """
    delay = 0.5 * dt + computing_time
    fastest = 1.0 / (delay + analyses[0].dead_time)

    def speed_meets_goal(crossover: float) -> bool:
        gain, reset = inertia * crossover, goal.reset_crossover / crossover
        return all(_meets_goal(speed_loop_margins(a, gain, reset, delay), goal) for a in analyses)

    fastest_crossover = _largest_gain(speed_meets_goal, 1e-4 * fastest, 3.0 * fastest, goal)
    if fastest_crossover is None:
        raise _unattainable("speed loop", goal)

    def around(crossover: float) -> Cascade | None:
        """Cascade with the largest position gain around a speed loop; None if there is none."""
        gain, reset = inertia * crossover, goal.reset_crossover / crossover

        def position_meets_goal(position_gain: float) -> bool:
            found = [position_loop_margins(a, position_gain, gain, reset, delay) for a in analyses]
            return all(_meets_goal(m, goal) and peak <= goal.overshoot for m, peak in found)

        position, too_high = goal.position_low * crossover, crossover
        if not position_meets_goal(position):
            return None
        for _ in range(goal.position_bisections):
            middle = float(np.sqrt(position * too_high))
            position, too_high = (middle, too_high) if position_meets_goal(middle) else (position, middle)
        return Cascade(
            position,
            gain,
            reset,
            tuple(speed_loop_margins(a, gain, reset, delay) for a in analyses),
            tuple(position_loop_margins(a, position, gain, reset, delay)[0] for a in analyses),
        )

    best: Cascade | None = None
    for crossover in (fastest_crossover * goal.slower_step ** np.arange(goal.slower)).tolist():
        if best is not None and inertia * crossover**2 <= best.stiffness:  # no slower loop can be as stiff
            break
        found = around(crossover) if speed_meets_goal(crossover) else None
        if found is not None and (best is None or found.stiffness > best.stiffness):
            best = found
    if best is None:
        raise _unattainable("position loop", goal)
    return best


def _meets_goal(found: Margins, goal: CascadeGoal) -> bool:
    enough = found.gain >= goal.gain and found.phase >= goal.phase and found.sensitivity <= goal.sensitivity
    return found.stable and enough


def _largest_gain(meets_goal: Callable[[float], bool], low: float, high: float, goal: CascadeGoal) -> float | None:
    """Upper end of the first range of gains, from below, that meet the goal; None if none does."""
    best, too_high = None, high
    for value in np.geomspace(low, high, int(np.log(high / low) / np.log(goal.gain_step)) + 2):
        if meets_goal(float(value)):
            best = float(value)
        elif best is not None:
            too_high = float(value)
            break
    if best is None:
        return None
    for _ in range(goal.bisections):
        middle = float(np.sqrt(best * too_high))
        best, too_high = (middle, too_high) if meets_goal(middle) else (best, middle)
    return best


def _unattainable(loop: str, goal: CascadeGoal) -> SettingsError:
    return SettingsError(
        f"{loop}: no gain keeps a gain margin of {goal.gain:g}, a phase margin of {goal.phase:g}° and a "
        f"sensitivity below {goal.sensitivity:g}; reduce the delays or ask for less"
    )
