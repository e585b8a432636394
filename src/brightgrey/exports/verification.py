"""Verification of an export: an input, the native response to it, and the deviation of the exported model from that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError
from brightgrey.estimation.problem.initial_state import initial_state
from brightgrey.exports.external_tools import ExportError, MissingToolError
from brightgrey.exports.numeric_model import NumericModel
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings, response

__all__ = [
    "VerificationPolicy",
    "VerificationRun",
    "Verified",
    "Verify",
    "compare_with_native",
    "deviation",
    "native",
    "verification_of",
    "verification_run",
]


@dataclass(frozen=True)
class VerificationPolicy:
    """Settings of the verification."""

    samples: int = 600  #: Length of the test input.
    #: Number of times that the amplitude of the test input is doubled at most, until the model reaches half of its
    #: usual speed.
    max_doublings: int = 80
    finer: float = 1e-2  #: Factor on the speed scale, and so on all tolerances, of the finer native simulation.
    nudge: float = 1e-10  #: Relative change of the input that shows how much the motion amplifies rounding errors.


VERIFICATION = VerificationPolicy()


@dataclass(frozen=True)
class VerificationRun:
    """An input and the native response to it, in the recording's units; the initial state in SI."""

    u: Array  #: Shape (samples,).
    x0: Array  #: Shape (n,).
    y: Array  #: Shape (outputs, samples).
    input_text: str  #: The input in words.
    #: The same response with a hundredth of the tolerances. A solver that is more exact than ours comes to this. Shape
    #: (outputs, samples).
    y_fine: Array
    #: Deviation (of range) of the same simulation when the input is changed by 1e-10 of itself. Where the motion
    #: amplifies rounding errors, no export can come closer than this.
    input_sensitivity: float = 0.0


class Verified(NamedTuple):
    """Response of the exported files, by their own tool chain.

    Attributes
    ----------
    y : ndarray or None
        Outputs, shape (outputs, samples), in the recording's units; None where the tool chain can only check form.
    by : str
        Tool and kind of check, e.g. ``gcc, compiled and run``.
    """

    y: Array | None
    by: str


Verify = Callable[[Path, NumericModel, VerificationRun], Verified]


def native(numeric: NumericModel, u: Array, x0: Array, settings: Settings | None = None) -> Array:
    """Outputs, shape (outputs, samples), of the native simulation; `u` and outputs in the recording's units."""
    y = response(numeric.system, u * numeric.input_factor, numeric.dt, x0, settings or numeric.settings).y[:, :, 0]
    return numeric.shown(y, x0)


def deviation(y: Array, other: Array) -> float:
    """Largest difference of two responses relative to each output's range; infinite where one is not a number."""
    span = np.ptp(y, axis=1)
    apart = np.abs(other - y).max(axis=1)
    worst = float(np.max(apart / np.where(span > 0.0, span, 1.0)))
    return worst if np.isfinite(worst) else float("inf")


def compare_with_native(
    folder: Path,
    numeric: NumericModel,
    run: VerificationRun,
    verify: Verify,
    tolerance: float,
) -> tuple[float | None, str, bool]:
    """Run the exported files in `folder` by `verify` and compare their response with the native one.

    A target with a more exact solver may deviate from the native response and agree with the finer one: the error is
    ours then, and the export is good.

    Returns
    -------
    tuple
        `deviation`, `text` and `good` of :class:`brightgrey.exports.registry.Export`.

    Raises
    ------
    ExportError
        If the tool chain refuses the files or returns outputs of another shape.
    """
    try:
        verified = verify(folder, numeric, run)
    except MissingToolError as missing:
        return (None, f"not verified: {missing}", True)
    if verified.y is None:
        return (None, f"form checked, not simulated: {verified.by}", True)
    if verified.y.shape != run.y.shape:
        raise ExportError(f"{verified.by}: outputs of shape {verified.y.shape} came back; {run.y.shape} are wanted")
    found = deviation(run.y, verified.y)
    text = f"deviation {found:.1e} of range on {run.input_text} ({verified.by})"
    if found <= tolerance:
        return (found, text, True)
    exact = deviation(run.y_fine, verified.y)
    if exact <= tolerance:
        text += f"; {exact:.1e} from a native simulation with a hundredth of the tolerances: the error is brightgrey's"
        return (found, text, True)
    text += f"; up to {tolerance:.0e} was to be expected"
    if run.input_sensitivity > VERIFICATION.nudge:
        text += f", but a change of the input by {VERIFICATION.nudge:.0e} already makes {run.input_sensitivity:.1e}"
    text += f"; use it only where {100 * found:.2g} % of the range do not matter"
    return (found, text, False)


def verification_run(numeric: NumericModel, u: Array, x0: Array, input_text: str) -> VerificationRun:
    """Native response to the input `u` from the initial state `x0`; `input_text` names the input."""
    finer = replace(numeric.settings, speed_scale=VERIFICATION.finer * numeric.settings.speed_scale)
    return VerificationRun(u, x0, native(numeric, u, x0), input_text, native(numeric, u, x0, finer))


def verification_of(numeric: NumericModel, recording: Recording | None = None) -> VerificationRun:
    """Native response to the input of `recording`, or to a test input that brings the model to its usual speed.

    Raises
    ------
    SettingsError
        If the recording is sampled at another interval than the model, or if the native simulation diverges on the
        input, so that there is nothing to compare with.
    """
    if recording is None:
        run = _test_run(numeric)
    else:
        if not np.isclose(recording.dt, numeric.dt, rtol=1e-6):
            raise SettingsError(
                f"{recording.name} is sampled every {recording.dt:g} s; the model every {numeric.dt:g} s. An export"
                " runs at the model's sampling interval only"
            )
        x0 = initial_state(recording, numeric.system)
        u = recording.u / numeric.input_factor
        run = verification_run(numeric, u, x0, f"the input of {recording.name}")
    if not np.isfinite(run.y).all():
        raise SettingsError(
            f"the native simulation diverges on {run.input_text}: there is nothing to compare an export with"
        )
    nudged = native(numeric, run.u * (1.0 + VERIFICATION.nudge), run.x0)
    return replace(run, input_sensitivity=deviation(run.y, nudged))


def _test_run(numeric: NumericModel) -> VerificationRun:
    """Run with a reversing input: up, hold, down, pause and back, with a faster shake.

    The motion slides, stops, reverses and rattles within two periods. The amplitude is doubled until the model reaches
    half of its usual speed.
    """
    t = np.arange(VERIFICATION.samples) / VERIFICATION.samples
    shape = np.sin(2.0 * np.pi * 2.0 * t) * np.where(t % 0.5 < 0.4, 1.0, 0.0) + 0.3 * np.sin(2.0 * np.pi * 17.0 * t)
    shape *= np.minimum(1.0, 20.0 * t)
    row = np.eye(numeric.n)[[numeric.system.state_names.index("v1")]]
    speed = replace(numeric.system, C=row, D=np.zeros((1, 1)), outputs=("velocity",), derivative_rows=(-1,))
    x0 = numeric.system.rest()
    size = 1e-9 * numeric.settings.speed_scale
    alone = response(speed, 0.0 * shape, numeric.dt, x0, numeric.settings).y[0, :, 0]
    for _ in range(VERIFICATION.max_doublings):
        reached = response(speed, size * shape, numeric.dt, x0, numeric.settings).y[0, :, 0]
        if not np.nanmax(np.abs(reached - alone)) < 0.5 * numeric.settings.speed_scale:
            break
        size *= 2.0
    return verification_run(numeric, size * shape / numeric.input_factor, x0, "a test input")
