"""Closed loop: a sampled controller with limited and held torque around the non-linear model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError
from brightgrey.kit import StateSpace
from brightgrey.simulation import Settings, response

__all__ = ["ClosedLoopRun", "Controller", "Reference", "closed_loop", "standstill"]


@dataclass(frozen=True)
class Reference:
    """Reference motion, and the feedforward torque for it."""

    #: rad, rad/s and rad/s² (m), shape (samples,).
    position: Array
    velocity: Array
    acceleration: Array
    torque: Array  #: Feedforward; 0 without one, shape (samples,).


class Controller(Protocol):
    """Sampled controller. It keeps no state of its own: its memory is passed from sample to sample."""

    def start(self) -> Any:
        """Memory before the first sample."""

    def command(self, memory: Any, k: int, x: Array, y: Array) -> tuple[float, Any]:
        """Torque command at sample k from states and outputs, and the memory before the torque is limited."""

    def anti_windup(self, memory: Any, commanded: float, applied: float) -> Any:
        """Memory corrected for the difference of commanded and applied torque (anti-windup)."""


@dataclass(frozen=True)
class ClosedLoopRun:
    """Simulation of a closed loop, SI."""

    t: Array  #: Shape (samples,).
    u: Array  #: Torque after the limit, held until the next sample, shape (samples,).
    x: Array  #: States of the model, with their ``names``, shape (samples, n).
    y: Array  #: Shape (samples, outputs).
    names: tuple[str, ...]

    def state(self, name: str) -> Array:
        """One state over time, shape (samples,)."""
        return np.asarray(self.x[:, self.names.index(name)])


def standstill(samples: int) -> Reference:
    """Reference of standstill at 0."""
    zero = np.zeros(samples)
    return Reference(zero, zero, zero, zero)


def closed_loop(
    system: StateSpace,
    controller: Controller,
    samples: int,
    dt: float,
    settings: Settings,
    *,
    limit: float = np.inf,
    x0: Array | None = None,
    disturbance: Array | None = None,
    noise: Array | None = None,
) -> ClosedLoopRun:
    """Simulate a controller around the non-linear model.

    Parameters
    ----------
    system : StateSpace
        One parameter set, all states (not twist coordinates).
    controller : Controller
    samples : int
    dt : float
        Sampling interval of the controller in s.
    settings : Settings
        ``hold`` is ignored: the torque is held.
    limit : float
        Largest absolute torque, N m (N).
    x0 : ndarray, shape (n,), optional
        Standstill at 0 if not given.
    disturbance : ndarray, shape (samples,), optional
        Torque beside the controller's; it is not limited.
    noise : ndarray, shape (samples, outputs), optional
        Of the sensors; the controller gets the outputs plus this noise.

    Returns
    -------
    Closed

    Raises
    ------
    SettingsError
        If the loop diverges, or for an acceleration that is measured on a drive with exact dry friction: at rest it
        does not follow from the state.
    """
    n = len(system.states)
    if max(system.derivative_rows) >= 0 and any(e.has_exact_sign for e in system.elements):
        raise SettingsError("a closed loop with an acceleration output needs a finite f_tanh")
    delay = float(np.asarray(system.dead_time)) / dt
    whole = int(np.floor(delay + 1e-9))
    part = max(delay - whole, 0.0)
    plant = replace(
        system,
        C=np.eye(n),
        D=np.zeros((n, 1)),
        outputs=tuple(system.state_names),
        derivative_rows=(-1,) * n,
        dead_time=0.0,
    )
    held = replace(settings, hold="zoh")
    x = system.rest() if x0 is None else np.asarray(x0, float)
    memory = controller.start()
    torque, disturbed = np.zeros(samples), np.zeros(samples) if disturbance is None else disturbance
    xs, ys = np.empty((samples, n)), np.empty((samples, len(system.outputs)))
    for k in range(samples):
        applied = _torque_at(torque, disturbed, k - whole - 1)
        xs[k], ys[k] = x, system.output(x, applied)
        measured = ys[k] if noise is None else ys[k] + noise[k]
        commanded, memory = controller.command(memory, k, x, measured)
        torque[k] = float(np.clip(commanded, -limit, limit))
        memory = controller.anti_windup(memory, commanded, torque[k])
        for span, u in ((part * dt, applied), ((1.0 - part) * dt, _torque_at(torque, disturbed, k - whole))):
            if span > 1e-9 * dt:
                x = response(plant, np.array([u, u]), span, x, held).y[:, -1, 0]
        if not np.all(np.isfinite(x)):
            raise SettingsError(f"the closed loop diverges after {k * dt:.4g} s; reduce the gains of the controller")
    return ClosedLoopRun(np.asarray(dt * np.arange(samples), float), torque, xs, ys, system.state_names)


def _torque_at(torque: Array, disturbance: Array, k: int) -> float:
    return float(torque[k] + disturbance[k]) if k >= 0 else 0.0
