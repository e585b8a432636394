"""What an export is held against: an input, and what the native simulation makes of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError
from brightgrey.estimation.problem.initial_state import initial_state
from brightgrey.exports.numeric_model import NumericModel
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings, response

__all__ = ["VerificationRun", "deviation", "native", "verification_of", "verification_run"]

_SAMPLES = 600
_DOUBLINGS = 80
_FINER = 1e-2


@dataclass(frozen=True)
class VerificationRun:
    """An input and the native response, in the recording's units; the start in SI.

    Attributes
    ----------
    u : ndarray, shape (samples,)
    x0 : ndarray, shape (n,)
    y : ndarray, shape (outputs, samples)
    of : str
        What the input is, in words.
    fine : ndarray, shape (outputs, samples)
        The same with a hundredth of the tolerances: what a solver that is more exact than ours comes to.
    sensitive : float
        Deviation (of range) of the same simulation when the input is changed by 1e-10 of itself: an export cannot
        come closer than a motion that amplifies rounding lets it.
    """

    u: Array
    x0: Array
    y: Array
    of: str
    fine: Array
    sensitive: float = 0.0


def native(scheme: NumericModel, u: Array, x0: Array, settings: Settings | None = None) -> Array:
    """Outputs, shape (outputs, samples), of the native simulation; `u` and outputs in the recording's units."""
    how = settings or scheme.settings
    y = response(scheme.system, u * scheme.input_factor, scheme.dt, x0, how).y[:, :, 0]
    for row, output in enumerate(scheme.outputs):
        if output.differenced:
            speed = scheme.system.state_names.index(f"v{scheme.system.state_names[output.row][1:]}")
            before = y[row, 0] - scheme.dt * x0[speed]
            y[row] = np.diff(y[row], prepend=before) / scheme.dt
        y[row] *= output.factor
    return np.asarray(y)


def deviation(y: Array, other: Array) -> float:
    """Largest difference of two responses relative to each output's range; infinite where one is not a number."""
    span = np.ptp(y, axis=1)
    apart = np.abs(other - y).max(axis=1)
    worst = float(np.max(apart / np.where(span > 0.0, span, 1.0)))
    return worst if np.isfinite(worst) else float("inf")


def verification_run(scheme: NumericModel, u: Array, x0: Array, of: str) -> VerificationRun:
    """Trial with the input `u` from `x0`."""
    finer = replace(scheme.settings, speed_scale=_FINER * scheme.settings.speed_scale)
    return VerificationRun(u, x0, native(scheme, u, x0), of, native(scheme, u, x0, finer))


def verification_of(scheme: NumericModel, recording: Recording | None = None) -> VerificationRun:
    """Trial with the input of `recording`, or with a test input that brings the model to its usual speed.

    Raises
    ------
    SettingsError
        If the native simulation is lost on that input, so that there is nothing to compare with.
    """
    if recording is None:
        trial = _test_trial(scheme)
    else:
        if not np.isclose(recording.dt, scheme.dt, rtol=1e-6):
            raise SettingsError(
                f"{recording.name} is sampled every {recording.dt:g} s; the model every {scheme.dt:g} s. An export"
                " runs at the model's sampling interval only"
            )
        x0 = initial_state(recording, scheme.system)
        u = recording.u / scheme.input_factor
        trial = verification_run(scheme, u, x0, f"the input of {recording.name}")
    if not np.isfinite(trial.y).all():
        raise SettingsError(f"the native simulation is lost on {trial.of}: there is nothing to compare an export with")
    nudged = native(scheme, trial.u * (1.0 + 1e-10), trial.x0)
    return replace(trial, sensitive=deviation(trial.y, nudged))


def _test_trial(scheme: NumericModel) -> VerificationRun:
    """A reversing input: up, hold, down, pause and back with a faster shake, sized by the speed it leads to."""
    t = np.arange(_SAMPLES) / _SAMPLES
    shape = np.sin(2.0 * np.pi * 2.0 * t) * np.where(t % 0.5 < 0.4, 1.0, 0.0) + 0.3 * np.sin(2.0 * np.pi * 17.0 * t)
    shape *= np.minimum(1.0, 20.0 * t)
    row = np.eye(scheme.n)[[scheme.system.state_names.index("v1")]]
    speed = replace(scheme.system, C=row, D=np.zeros((1, 1)), outputs=("velocity",), derivative_rows=(-1,))
    x0 = scheme.system.rest()
    size = 1e-9 * scheme.settings.speed_scale
    alone = response(speed, 0.0 * shape, scheme.dt, x0, scheme.settings).y[0, :, 0]
    for _ in range(_DOUBLINGS):
        reached = response(speed, size * shape, scheme.dt, x0, scheme.settings).y[0, :, 0]
        if not np.nanmax(np.abs(reached - alone)) < 0.5 * scheme.settings.speed_scale:
            break
        size *= 2.0
    u = size * shape / scheme.input_factor
    return verification_run(scheme, u, x0, "a test input")
