"""State feedback with integral action: linear-quadratic, or by pole placement.

The design uses twist coordinates and a model in contact. An unobservable absolute position and a position in the gap
that rests are states that no input moves. With them the Riccati equation has no stabilising solution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.linalg import LinAlgError, solve_continuous_are

from brightgrey.arrays import Array
from brightgrey.control.linear.analysis import Analysis
from brightgrey.control.linear.margins import Compensator, Margins, stability_margins
from brightgrey.control.policy import ANALYSIS
from brightgrey.errors import SettingsError
from brightgrey.kit import Linear

__all__ = ["FeedbackGain", "StateFeedbackDesign", "design_state_feedback", "lqr", "place_poles"]


class FeedbackGain(NamedTuple):
    """Feedback ``u = -K x`` and the poles of the closed loop in 1/s."""

    K: Array
    poles: NDArray[np.complex128]


@dataclass(frozen=True)
class StateFeedbackDesign:
    """Feedback ``u = u_ref - K (z - z_ref) - integral * (integral of y - y_ref)``."""

    analysis: Analysis  #: Linear model of the design.
    output: int  #: Index of the controlled output.
    K: Array  #: Gains of ``analysis.states``, shape (n,).
    integral: float  #: Gain of the integrated control error.
    poles: NDArray[np.complex128]  #: Of the closed loop, without dead time, shape (n + 1,).

    def margins(self, delay: float = 0.0) -> Margins:
        """Stability margins of the loop opened at the drive's input; `delay` in s is added to the dead time."""
        A, B = _augment_with_integral(self.analysis.linear, self.output)
        loop = Linear(A, B, np.append(self.K, self.integral)[None], np.zeros((1, 1)))
        return stability_margins(loop, Compensator.of([1.0], [1.0]), dead_time=self.analysis.dead_time + delay)


def lqr(A: Array, B: Array, Q: Array, R: Array) -> FeedbackGain:
    """Linear-quadratic regulator: the feedback that minimises the integral of ``x' Q x + u' R u``.

    Parameters
    ----------
    A, B : ndarray, shape (n, n), (n, inputs)
    Q, R : ndarray, shape (n, n), (inputs, inputs)

    Raises
    ------
    SettingsError
        If no stabilising solution exists: a mode that does not decay is not controllable or has no weight.
    """
    try:
        P = solve_continuous_are(A, B, Q, R)
    except (LinAlgError, ValueError) as error:
        raise SettingsError(f"the Riccati equation has no stabilising solution ({error})") from None
    K = np.asarray(np.linalg.solve(np.atleast_2d(R), B.T @ P), float)
    poles = np.asarray(np.linalg.eigvals(A - B @ K), complex)
    if np.any(poles.real >= -ANALYSIS.axis_tolerance * np.abs(poles).max()):
        raise SettingsError(
            "the Riccati equation has no stabilising solution: a mode is not controllable or has no weight"
        )
    return FeedbackGain(K, poles)


def place_poles(A: Array, B: Array, poles: Sequence[complex]) -> FeedbackGain:
    """Place the poles of the closed loop at `poles` in 1/s; a pole may be repeated at most once per input.

    Raises
    ------
    SettingsError
        For a wrong number of poles, poles without their conjugates, or a mode that is not controllable.
    """
    if len(poles) != len(A):
        raise SettingsError(f"{len(poles)} poles for a system of order {len(A)}; give one for each state")
    try:
        K = signal.place_poles(A, B, np.asarray(poles)).gain_matrix
    except ValueError as error:
        raise SettingsError(f"these poles cannot be placed: {error}") from None
    found = np.asarray(np.linalg.eigvals(A - B @ K), complex)
    miss = max(float(np.abs(found - p).min()) for p in poles)
    if miss > 1e-3 * float(np.abs(np.asarray(poles)).max()):
        raise SettingsError("these poles cannot be placed: a mode is not controllable")
    return FeedbackGain(K, found)


def design_state_feedback(
    analysis: Analysis,
    *,
    largest_error: float | None = None,
    torque: float = 1.0,
    settling_time: float = 0.1,
    poles: Sequence[complex] | None = None,
    output: int = 0,
) -> StateFeedbackDesign:
    """Design a state feedback with integral action.

    Without `poles` the design is linear-quadratic with Bryson's rule: an output error of `largest_error` costs as much
    as the torque `torque`. The integral is weighed so that a constant disturbance is gone after about `settling_time`.

    Parameters
    ----------
    analysis : Analysis
    largest_error : float, optional
        Output error that justifies `torque`, in the output's SI unit; needed without `poles`.
    torque : float
        N m (N).
    settling_time : float
        Time after which a constant disturbance has no more effect, s.
    poles : sequence of complex, optional
        Poles of the closed loop, one more than the model has states.
    output : int
        Index of the controlled output.

    Returns
    -------
    StateControl

    Raises
    ------
    SettingsError
        If no such feedback exists.
    """
    A, B = _augment_with_integral(analysis.linear, output)
    if poles is not None:
        gain = place_poles(A, B, poles)
    elif largest_error is None or not (largest_error > 0.0 and torque > 0.0 and settling_time > 0.0):
        raise SettingsError("state feedback needs a largest error, a torque and a settling time above 0, or else poles")
    else:
        c = np.append(analysis.linear.C[output], 0.0) / largest_error
        i = np.append(np.zeros(len(analysis.linear.A)), 1.0) / (largest_error * settling_time)
        gain = lqr(A, B, np.outer(c, c) + np.outer(i, i), np.array([[torque**-2]]))
    return StateFeedbackDesign(analysis, output, gain.K[0, :-1], float(gain.K[0, -1]), gain.poles)


def _augment_with_integral(linear: Linear, output: int) -> tuple[Array, Array]:
    """System with the integral of one output as its last state."""
    n = len(linear.A)
    A = np.zeros((n + 1, n + 1))
    A[:n, :n], A[n, :n] = linear.A, linear.C[output]
    return A, np.vstack([linear.B, linear.D[output : output + 1]])
