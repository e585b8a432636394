"""Sampled controllers for the closed loop: state feedback, cascade, and linear output feedback."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from brightgrey.arrays import Array
from brightgrey.control.design.cascade import Cascade
from brightgrey.control.design.closed_loop import Reference
from brightgrey.control.design.state_feedback import StateFeedbackDesign
from brightgrey.control.linear.margins import Compensator
from brightgrey.control.linear.operating_point import ContactMode, trim_point
from brightgrey.excitation import Motion

__all__ = ["CascadeController", "OutputFeedback", "StateFeedback", "feedforward"]


def feedforward(mode: ContactMode, motion: Motion, *, torque: bool = True) -> Reference:
    """Reference with feedforward of the torque for inertia, friction and gravity.

    Parameters
    ----------
    mode : ContactMode
        In contact, because in the gap no torque reaches the load.
    motion : Motion
    torque : bool
        False gives a torque of 0, for comparison.
    """
    u = np.zeros(len(motion.t))
    if torque:
        course = zip(motion.velocity, motion.acceleration, motion.position, strict=True)
        u = np.array([trim_point(mode, v, a, q).u for v, a, q in course])
    return Reference(motion.position, motion.velocity, motion.acceleration, u)


@dataclass(frozen=True)
class OutputFeedback:
    """Linear controller on one output."""

    compensator: Compensator  #: Continuous controller; it is discretised by the trapezoidal rule.
    dt: float  #: Sampling interval, s.
    reference: Array  #: Reference of the output, shape (samples,).
    output: int = 0  #: Index of the output.

    @cached_property
    def _sampled(self) -> Compensator:
        return self.compensator.discretise(self.dt)

    def start(self) -> Array:
        """States of the controller, all 0."""
        return np.zeros(len(self.compensator.A))

    def command(self, memory: Array, k: int, x: Array, y: Array) -> tuple[float, Array]:
        """Torque command from the control error."""
        c, e = self._sampled, self.reference[k] - y[self.output]
        return float((c.C @ memory + c.D[:, 0] * e)[0]), c.A @ memory + c.B[:, 0] * e

    def anti_windup(self, memory: Array, commanded: float, applied: float) -> Array:
        """Leave the memory as it is, so that the loop stays linear."""
        return memory


@dataclass(frozen=True)
class StateFeedback:
    """State feedback with integral action on the states of the model.

    The twist of a shaft with a gap is taken relative to the position in the gap, on whichever side it is closed.
    """

    design: StateFeedbackDesign
    reference: Reference
    dt: float  #: Sampling interval, s.

    @cached_property
    def _state_map(self) -> Array:
        """Map from all states x to the states of the gains, shape (n, N)."""
        mode = self.design.analysis.operating_point.contact_mode
        W, keep, fixed = mode.model.W, list(mode.free_states), list(mode.fixed_states)
        if not fixed:
            return W
        A = mode.system.A
        positions = [i for i in keep if mode.system.states[i].dimension == mode.system.states[fixed[0]].dimension]
        gap_to_twist = np.linalg.lstsq(A[:, positions], A[:, fixed], rcond=None)[0]
        state_map = W[keep].copy()
        for row, i in enumerate(positions):
            state_map[keep.index(i)] += gap_to_twist[row] @ W[fixed]
        return np.asarray(state_map)

    @cached_property
    def _reference_states(self) -> Array:
        """Reference of the states of the gains, shape (samples, n)."""
        mode = self.design.analysis.operating_point.contact_mode
        r = self.reference
        course = zip(r.velocity, r.acceleration, r.position, strict=True)
        z = np.array([trim_point(mode, v, a, q).z for v, a, q in course])
        return np.asarray(z @ mode.model.V.T @ self._state_map.T)

    @property
    def _reference_output(self) -> Array:
        """Reference of the controlled output, shape (samples,)."""
        kind = self.design.analysis.outputs[self.design.output]
        return np.asarray(getattr(self.reference, kind))

    def start(self) -> float:
        """Integral of the control error."""
        return 0.0

    def command(self, memory: float, k: int, x: Array, y: Array) -> tuple[float, float]:
        """Torque command: feedforward, state feedback and integral."""
        error = y[self.design.output] - self._reference_output[k]
        integral = memory + self.dt * error
        u = self.reference.torque[k] - self.design.K @ (self._state_map @ x - self._reference_states[k])
        return float(u - self.design.integral * integral), integral

    def anti_windup(self, memory: float, commanded: float, applied: float) -> float:
        """Integral that would have commanded the applied torque."""
        return memory + (commanded - applied) / self.design.integral if commanded != applied else memory


@dataclass(frozen=True)
class CascadeController:
    """P control of position around PI control of speed, both of mass 1."""

    cascade: Cascade
    reference: Reference
    dt: float
    #: Indices of position and speed of mass 1 among the states.
    position: int
    speed: int

    def start(self) -> float:
        """Integral part of the torque."""
        return 0.0

    def command(self, memory: float, k: int, x: Array, y: Array) -> tuple[float, float]:
        """Torque command."""
        c, r = self.cascade, self.reference
        error = c.position_gain * (r.position[k] - x[self.position]) + r.velocity[k] - x[self.speed]
        integral = memory + c.speed_gain * self.dt / c.reset_time * error
        return float(r.torque[k] + c.speed_gain * error + integral), integral

    def anti_windup(self, memory: float, commanded: float, applied: float) -> float:
        """Integral part reduced by the torque that the limit has cut off."""
        return memory + applied - commanded
