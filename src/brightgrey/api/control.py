"""Linear analysis and control design with an identified model. Inside, all values are SI."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brightgrey.arguments import checked_arguments
from brightgrey.control.design.cascade import Cascade, design_cascade
from brightgrey.control.design.lqg import kalman_gain, lqg_compensator
from brightgrey.control.design.state_feedback import StateFeedbackDesign, design_state_feedback
from brightgrey.control.filters.extended_kalman import Noise
from brightgrey.control.linear.analysis import Analysis, analyse_system
from brightgrey.control.linear.margins import Margins
from brightgrey.control.linear.operating_point import OperatingPoint, trim_point
from brightgrey.control.policy import ANALYSIS
from brightgrey.effects import DAMPING, POSITION, SPEED, STIFFNESS, TORQUE
from brightgrey.errors import SettingsError
from brightgrey.kit import assemble
from brightgrey.model.model import Model
from brightgrey.recordings import Units

__all__ = [
    "Design",
    "DesignAssumptions",
    "analyse",
    "cascade_models",
    "design",
    "total_inertia",
]


@dataclass(frozen=True)
class DesignAssumptions:
    """Assumptions of the suggested design where the user gives no values.

    Attributes
    ----------
    largest_error : float
        Speed error that justifies the largest torque, over the largest speed.
    disturbance : float
        Standard deviation of the disturbance per sample, over the largest torque.
    sensor_noise : float
        Standard deviation of the measured speed, over the largest speed.
    sensitivity : float
        Largest peak of the sensitivity of the state feedback; below 2 a loop is well damped.
    slowest : int
        Times that the state feedback is made half as fast to reach that, at most.
    """

    largest_error: float = 0.05
    disturbance: float = 0.05
    sensor_noise: float = 1e-3
    sensitivity: float = 2.0
    slowest: int = 20


DESIGN_ASSUMPTIONS = DesignAssumptions()

_NO_STATE_FEEDBACK = (
    "There is no state feedback of speed: the load depends on the position, so that no constant torque keeps a speed."
)
_EXTREMES = "The cascade was designed where the load pulls back most, and where it pushes away most."


@dataclass(frozen=True)
class Design:
    """Suggested control of a drive, SI.

    Attributes
    ----------
    analyses : tuple of Analysis
        Linear models of the design: in contact, and in the gap if there is one; with a position-dependent load where it
        pulls back most, and where it pushes away most.
    cascade : Cascade
        P control of position around PI control of speed.
    state_feedback : StateFeedbackDesign or None
        Linear-quadratic control of speed with integral action. None if a load depends on the position, so that no
        constant torque keeps a speed.
    noise : Noise or None
        Disturbance and measurement noise of the Kalman filter.
    observer_gain : ndarray, shape (n, 1), or None
        Gains of the stationary Kalman filter that estimates the states from the measured speed.
    delay : float
        Assumed delay of the sampled controller, s.
    units : Units
        Units of the recording, for :meth:`cascade_gains` and :meth:`feedback_gains`.
    notes : tuple of str
        What the delay has cost, and where the model is used beyond what was recorded.
    """

    analyses: tuple[Analysis, ...]
    cascade: Cascade
    state_feedback: StateFeedbackDesign | None
    noise: Noise | None
    observer_gain: NDArray[np.float64] | None
    delay: float
    units: Units
    notes: tuple[str, ...] = ()

    @property
    def places(self) -> tuple[str, ...]:
        """Name of each linear model: its contact, and the position of mass 1 where there are several."""
        points = [a.operating_point for a in self.analyses]
        several = len({p.position for p in points}) > 1
        shown = [self._in_units(p.position, POSITION) for p in points]
        return tuple(
            p.contact_mode.contact + (f" at {value:.3g} {unit}" if several else "")
            for p, (value, unit) in zip(points, shown, strict=True)
        )

    def cascade_gains(self) -> list[tuple[str, float, str]]:
        """Name, value and unit of the gains of the cascade, in the units of the recording."""
        c = self.cascade
        speed_gain = self._in_units(c.speed_gain, DAMPING)
        return [
            ("position gain", c.position_gain, "1/s"),
            ("speed gain", *speed_gain),
            ("reset time", 1e3 * c.reset_time, "ms"),
        ]

    def feedback_gains(self) -> list[tuple[str, float, str]]:
        """State in words, gain and unit of the state feedback and of its integral, in the units of the recording."""
        feedback = self.state_feedback
        if feedback is None:
            return []
        mode = feedback.analysis.operating_point.contact_mode
        states = [mode.system.states[i] for i in mode.free_states]
        rows = []
        for state, gain in zip(states, feedback.K.tolist(), strict=True):
            of_input, of_motion, of_time = state.dimension
            rows.append((_state_in_words(state.name), *self._in_units(gain, (1 - of_input, -of_motion, -of_time))))
        return [*rows, ("integral of the speed error", *self._in_units(feedback.integral, STIFFNESS))]

    def _in_units(self, value: float, dimension: tuple[int, int, int]) -> tuple[float, str]:
        text, factor = self.units.of(dimension)
        return factor * value, text

    @property
    def observer_margins(self) -> Margins | None:
        """Stability margins of the state feedback with the Kalman filter in the loop; None without a state feedback."""
        if self.state_feedback is None or self.observer_gain is None:
            return None
        compensator = lqg_compensator(self.state_feedback, self.observer_gain)
        return self.state_feedback.analysis.margins(compensator, delay=self.delay)


def _output_kinds(model: Model) -> list[str]:
    return [s.physical for s in model.outputs]


@checked_arguments
def analyse(model: Model, *, speed: float | None = None, contact: str = "forward", position: float = 0.0) -> Analysis:
    """Linearise a model in steady motion.

    Parameters
    ----------
    model : Model
    speed : float, optional
        In the model's units; half of the recording's largest speed if not given.
    contact : {'forward', 'backward', 'gap'}
        Side on which a gap is closed, or open.
    position : float
        Of mass 1, in the model's units. It matters where a load depends on the position: the linear model holds there.

    Returns
    -------
    Analysis
        In SI; ``.to_python_control()`` gives a ``control.StateSpace``.

    Raises
    ------
    SettingsError
        For an unknown contact, an open gap of a model without one, or if no such motion exists.
    """
    settings = model.settings_si()
    system = assemble(model.structure, model.values_si(), settings.f_tanh, _output_kinds(model), model.input.mass)
    if contact == "gap" and not model.structure.has_hard_limit:
        raise SettingsError("contact 'gap': this model has no gap; take forward or backward")
    at = ANALYSIS.part_of_speed * settings.speed_scale if speed is None else speed / model.units.of(SPEED)[1]
    return analyse_system(system, speed=at, contact=contact, position=position / model.units.of(POSITION)[1])


@checked_arguments
def design(
    model: Model,
    *,
    torque: float,
    sampling_time: float | None = None,
    computing_time: float = 0.0,
    settling_time: float = 0.05,
    assumptions: DesignAssumptions = DESIGN_ASSUMPTIONS,
) -> Design:
    """Suggest the gains of a cascade, of a state feedback for speed and of its Kalman filter.

    Parameters
    ----------
    model : Model
    torque : float
        Largest torque of the drive, in the input's unit.
    sampling_time : float, optional
        Of the controller, s; the recording's if not given.
    computing_time : float
        Time from sampling to output, s.
    settling_time : float
        Time after which a constant disturbance has no more effect on the state feedback, s. It is doubled, as the
        largest error is, until the loop is well damped in spite of all delays.
    assumptions : DesignAssumptions

    Returns
    -------
    Design

    Raises
    ------
    SettingsError
        If an argument is out of range, the torque does not move the drive, the input does not act on mass 1, or no
        such control exists.
    """
    if model.input.mass > 1:
        raise SettingsError(
            f"'{model.input.name}' acts on mass {model.input.mass}, and a cascade closes its loops at mass 1; count the"
            " masses from the driven one, or take the linear model of analyse()"
        )
    dt = model.settings.sampling_time if sampling_time is None else sampling_time
    _check_range("torque", torque, 1e-30, 1e30)
    _check_range("sampling_time", dt, 1e-9, 1e3)
    _check_range("settling_time", settling_time, 1e-9, 1e6)
    _check_range("computing_time", computing_time, 0.0, 1e3)
    settings, values = model.settings_si(), model.values_si()
    largest_torque = torque / model.units.of(TORQUE)[1]
    largest_speed, speed = settings.speed_scale, ANALYSIS.part_of_speed * settings.speed_scale
    analyses, delay = cascade_models(model), 0.5 * dt + computing_time
    left = largest_torque - _steady_torque(analyses, model, torque)
    cascade = design_cascade(analyses, total_inertia(analyses[0]), dt, computing_time=computing_time)
    if any(p.effect.port_reads == "position" for p in model.structure.placed):
        found = Design(analyses, cascade, None, None, None, delay, model.units)
        said = (_NO_STATE_FEEDBACK, *([_EXTREMES] if len({p.position for p in map(_point, analyses)}) > 1 else []))
        return replace(found, notes=(*said, *_notes_on_cascade(found, model.settings.sampling_time)))
    analysis = analyse_system(assemble(model.structure, values, settings.f_tanh, ("velocity",)), speed=speed)
    noise = Noise(assumptions.disturbance * largest_torque, np.array([assumptions.sensor_noise * largest_speed]))
    gain = kalman_gain(analysis.linear, noise, dt)
    for slower in (2.0**k for k in range(assumptions.slowest + 1)):
        feedback = design_state_feedback(
            analysis,
            largest_error=slower * assumptions.largest_error * largest_speed,
            torque=left,
            settling_time=slower * settling_time,
        )
        found = Design(analyses, cascade, feedback, noise, gain, delay, model.units)
        if _is_well_damped(found, assumptions):
            return replace(found, notes=_notes_on_design(found, slower, settling_time, model.settings.sampling_time))
    raise SettingsError(
        f"no state feedback of this model is well damped with a delay of {1e3 * (delay + analysis.dead_time):.4g} ms,"
        " the dead time of the drive included; take a shorter sampling time"
    )


def _is_well_damped(found: Design, assumptions: DesignAssumptions) -> bool:
    """True if the state feedback is stable with a small peak of the sensitivity, with its Kalman filter and without."""
    assert found.state_feedback is not None
    loops = (found.state_feedback.margins(found.delay), found.observer_margins)
    return all(loop and loop.stable and loop.sensitivity <= assumptions.sensitivity for loop in loops)


def _steady_torque(analyses: Sequence[Analysis], model: Model, limit: float) -> float:
    """Torque that keeps the speed of the linear models, in the direction and at the position that need most, SI.

    What a spring to the ground takes away from position 0 is not counted: nothing says how far the drive will travel.

    Raises
    ------
    SettingsError
        If the `limit`, in the model's units, is less than that.
    """
    forward = _point(analyses[0]).contact_mode
    back, speed = replace(forward, contact="backward"), _point(analyses[0]).speed
    steady = [
        abs(trim_point(mode, v, position=q).u)
        for mode, v in ((forward, speed), (back, -speed))
        for q in _extreme_positions(model)[1]
    ]
    needed, (unit, factor) = max(steady), model.units.of(TORQUE)
    if limit > needed * factor:
        return needed
    at, of_speed = model.units.of(SPEED)
    raise SettingsError(
        f"a torque of {limit:g} {unit} does not move this drive: friction and load take {needed * factor:.4g} {unit} at"
        f" {speed * of_speed:.4g} {at}, half the largest speed of the recording; give a larger limit"
    )


def _point(analysis: Analysis) -> OperatingPoint:
    return analysis.operating_point


def _notes_on_design(found: Design, slower: float, settling_time: float, recorded: float) -> tuple[str, ...]:
    """Sentences on a design."""
    said = []
    if slower > 1.0:
        assert found.state_feedback is not None
        dead = found.state_feedback.analysis.dead_time
        drive = f" and the drive's dead time of {1e3 * dead:.3g} ms" if dead > 0.0 else ""
        said.append(
            f"The state feedback was slowed down to a settling time of {slower * settling_time:.3g} s: with the"
            f" controller's delay of {1e3 * found.delay:.3g} ms{drive} a faster one is not well damped."
        )
    return (*said, *_notes_on_cascade(found, recorded))


def _notes_on_cascade(found: Design, recorded: float) -> tuple[str, ...]:
    """Sentences on the cascade of a design, with the sampling interval of the recording."""
    said = []
    fastest = max(m.crossover for m in found.cascade.speed_margins) / (2.0 * np.pi)
    if fastest > 0.5 / recorded:
        said.append(
            f"The speed loop crosses over at {fastest:.3g} Hz. The recording shows nothing above {0.5 / recorded:.3g}"
            " Hz, half its sampling rate: a resonance there would be unknown. Record faster, or stay below it."
        )
    return tuple(said)


def _state_in_words(name: str) -> str:
    kinds = {"q": "position of mass", "v": "speed of mass", "twist": "twist of shaft"}
    found = re.fullmatch(r"(q|v|twist)(\d+)", name)
    return f"{kinds[found[1]]} {found[2]}" if found else name


def cascade_models(model: Model) -> tuple[Analysis, ...]:
    """Linear models that a cascade is designed for: in contact, and in the gap if there is one.

    With a position-dependent load they are taken where it pulls back most, and where it pushes away most.
    """
    settings = model.settings_si()
    both = assemble(model.structure, model.values_si(), settings.f_tanh, ("position", "velocity"))
    contacts = ("forward", "gap") if any(e.limits is not None for e in both.elements) else ("forward",)
    speed, at = ANALYSIS.part_of_speed * settings.speed_scale, _extreme_positions(model)[0]
    return tuple(analyse_system(both, speed=speed, contact=c, position=q) for c in contacts for q in at)


def _extreme_positions(model: Model) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Positions of mass 1, SI, at which loads by sines of the position are steepest, and at which they are largest.

    First the one where they pull back most, and the one where they push away most: hanging and upright. All masses are
    taken at one position. Without such loads it is 0 alone.
    """
    values = model.values_si()
    waves = [p for p in model.structure.placed if p.effect.search.wave is not None and p.effect.law is not None]
    numbers = [tuple(values[p.parameter(q.symbol)] for q in p.effect.parameters) for p in waves]
    if not waves:
        return (0.0,), (0.0,)
    of_wave = [tuple(values[p.parameter(s)] for s in p.effect.search.wave or ()) for p in waves]
    k, phase = min(of_wave, key=lambda pair: abs(pair[0]))
    q = (2.0 * np.pi * np.arange(ANALYSIS.points_of_a_wave) / ANALYSIS.points_of_a_wave - phase) / k
    loads = [p.effect.law.value((q,), own) for p, own in zip(waves, numbers, strict=True) if p.effect.law]
    slope, torque = sum(slopes[0] for _, slopes in loads), sum(load for load, _ in loads)
    at = [float(q[int(np.argmin(x))]) for x in (slope, -slope, torque, -torque)]
    return tuple(at[:2]), tuple(at[2:])


def _check_range(name: str, value: float, least: float, largest: float) -> None:
    """Refuse what no drive has, and numerical methods fail at."""
    if not least <= value <= largest:
        raise SettingsError(f"{name} is {value:g}; allowed is {least:g} to {largest:g}")


def total_inertia(analysis: Analysis) -> float:
    """Inertia of all masses, SI: the torque that an acceleration of 1 adds to steady motion."""
    mode, speed = analysis.operating_point.contact_mode, analysis.operating_point.speed
    return float(trim_point(mode, speed, 1.0).u - trim_point(mode, speed).u)
