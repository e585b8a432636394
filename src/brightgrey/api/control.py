"""A model at work: analysis at an operating point, control design, watching a machine. Inside it is SI."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brightgrey.control.design.cascade import Cascade, design_cascade
from brightgrey.control.design.lqg import kalman_gain, lqg_compensator
from brightgrey.control.design.state_feedback import StateFeedbackDesign, design_state_feedback
from brightgrey.control.faults.detection import FaultCase, FaultFinding, detect_faults
from brightgrey.control.filters.extended_kalman import FilterResult, Noise
from brightgrey.control.filters.gaussian_sum import gaussian_sum_filter
from brightgrey.control.filters.setup import PreparedRecording, estimate_noise, prepare
from brightgrey.control.linear.analysis import Analysis, analyse_system
from brightgrey.control.linear.margins import Margins
from brightgrey.control.linear.operating_point import CONTACTS, trim_point
from brightgrey.effects import SPEED, TORQUE
from brightgrey.errors import SettingsError
from brightgrey.kit import assemble
from brightgrey.model.model import Model
from brightgrey.recordings import Recording

__all__ = ["Design", "Watch", "analyse", "design", "innovation_correlation", "total_inertia", "watch"]

_HALF_SPEED = 0.5
_ERROR = 0.05  # of the speed scale: an error worth the whole torque
_DISTURBANCE = 0.05  # of the largest torque, a sample: generous, for margins
_SENSOR = 1e-3  # of the speed scale


@dataclass(frozen=True)
class Design:
    """Suggested control of a drive, SI.

    Attributes
    ----------
    analyses : tuple of Analysis
        What the cascade was designed for: in contact, and in the gap if there is one.
    cascade : Cascade
    state : StateControl
        Of speed, linear-quadratic with integral action.
    noise : Noise
        Disturbance and noise of a measured speed that the Kalman filter is laid out for.
    observer : ndarray, shape (n, 1)
        Gains of the stationary Kalman filter that finds the states from the measured speed.
    delay : float
        Assumed lag of the sampled controller, s.
    """

    analyses: tuple[Analysis, ...]
    cascade: Cascade
    state_feedback: StateFeedbackDesign
    noise: Noise
    observer_gain: NDArray[np.float64]
    delay: float

    @property
    def observer_margins(self) -> Margins:
        """Margins of the state control with the Kalman filter in the loop."""
        return self.state_feedback.analysis.margins(
            lqg_compensator(self.state_feedback, self.observer_gain), delay=self.delay
        )


@dataclass(frozen=True)
class Watch:
    """A recording watched by a Kalman filter.

    Attributes
    ----------
    seen : PreparedRecording
        Coordinates and data of the filter.
    filtered : Filtered
        Estimated states and innovations, SI.
    noise : Noise
    findings : tuple of FaultFinding
    """

    prepared: PreparedRecording
    filtered: FilterResult
    noise: Noise
    findings: tuple[FaultFinding, ...]


def _output_kinds(model: Model) -> list[str]:
    return ["velocity" if s.kind == "velocity-differenced" else s.kind for s in model.outputs]


def analyse(model: Model, *, speed: float | None = None, contact: str = "forward") -> Analysis:
    """Linearise a model in steady motion.

    Parameters
    ----------
    model : Model
    speed : float, optional
        In the model's units; half of the recording's largest speed if not given.
    contact : {'forward', 'backward', 'gap'}
        Where a gap stands.

    Returns
    -------
    Analysis
        In SI; ``.control()`` gives a ``control.StateSpace``.

    Raises
    ------
    SettingsError
        For an unknown contact or where no such motion exists.
    """
    settings = model.settings_si()
    system = assemble(model.structure, model.values_si(), settings.f_tanh, _output_kinds(model))
    at = _HALF_SPEED * settings.speed_scale if speed is None else speed / model.units.of(SPEED)[1]
    return analyse_system(system, speed=at, contact=contact)


def design(
    model: Model,
    *,
    torque: float,
    sampling_time: float | None = None,
    computing_time: float = 0.0,
    settling_time: float = 0.05,
) -> Design:
    """Suggest the gains of the cascade and of a state control of speed.

    Parameters
    ----------
    model : Model
    torque : float
        Largest torque of the drive, in the input's unit.
    sampling_time : float, optional
        Of the controller in s; the recording's if not given.
    computing_time : float
        Time from sampling to output in s.
    settling_time : float
        Time in s after which the state control shall have forgotten a constant disturbance.

    Returns
    -------
    Design

    Raises
    ------
    SettingsError
        Where no such control exists.
    """
    if not torque > 0.0:
        raise SettingsError(f"torque is {torque:g}; it has to be above 0")
    dt = model.settings.sampling_time if sampling_time is None else sampling_time
    if not (dt > 0.0 and computing_time >= 0.0 and settling_time > 0.0):
        raise SettingsError("sampling time and settling time have to be above 0, the computing time must not be below")
    settings, values = model.settings_si(), model.values_si()
    system = assemble(model.structure, values, settings.f_tanh, ("position", "velocity"))
    speed = _HALF_SPEED * settings.speed_scale
    gaps = any(e.limits is not None for e in system.elements)
    analyses = tuple(
        analyse_system(system, speed=speed, contact=c) for c in CONTACTS if c == "forward" or (c == "gap" and gaps)
    )
    moving = assemble(model.structure, values, settings.f_tanh, ("velocity",))
    delay = 0.5 * dt + computing_time
    state = design_state_feedback(
        analyse_system(moving, speed=speed),
        largest_error=_ERROR * settings.speed_scale,
        torque=torque / model.units.of(TORQUE)[1],
        settling=settling_time,
    )
    noise = Noise(_DISTURBANCE * torque / model.units.of(TORQUE)[1], np.array([_SENSOR * settings.speed_scale]))
    gain = kalman_gain(state.analysis.linear, noise, dt)
    suggested = design_cascade(analyses, total_inertia(analyses[0]), dt, computing_time=computing_time)
    return Design(analyses, suggested, state, noise, gain, delay)


def total_inertia(analysis: Analysis) -> float:
    """Inertia of all masses together, SI: what an acceleration adds to the torque of steady motion."""
    on, speed = analysis.operating_point.contact_mode, analysis.operating_point.speed
    return float(trim_point(on, speed, 1.0).u - trim_point(on, speed).u)


def watch(
    model: Model, recording: Recording, *, baseline: Recording, min_change: float = 0.1, confidence: float = 0.99
) -> Watch:
    """Run a Kalman filter over a new recording and look for faults.

    Parameters
    ----------
    model : Model
    recording : Recording
        With the model's signals.
    baseline : Recording
        One without fault, for the noise levels: that which the model was identified from.
    min_change : float
        Relative change that is not yet worth reporting, a ratio.
    confidence : float
        Probability at which a change is reported, from 0 to 1 (a ratio).

    Returns
    -------
    Watch
    """
    settings, values = model.settings_si(), model.values_si()
    noise = estimate_noise(model.structure, values, baseline, settings)
    std = {
        name: (part.std or 0.0) / model.units.of(model.structure.parameters[name].dimension)[1]
        for name, part in model.parameters.items()
    }
    case = FaultCase(values, recording, noise, std)
    (findings,) = detect_faults(model.structure, settings, [case], min_change=min_change, confidence=confidence)
    seen = prepare(model.structure, values, recording, settings)
    return Watch(seen, gaussian_sum_filter(seen.filter_input, noise), noise, findings)


def innovation_correlation(filtered: FilterResult) -> float:
    """Correlation of neighbouring innovations: 0 for a model that leaves only noise, 1 for one that is always off."""
    white = filtered.normalised_innovations[1:, 0]
    return float(np.mean(white[1:] * white[:-1]) / np.mean(white**2))
