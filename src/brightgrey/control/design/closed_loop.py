"""Closed loop on the non-linear model: a sampled controller, its torque limited and held, around it."""

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
    """What the drive shall do: motion and the torque that leads to it.

    Attributes
    ----------
    position, velocity, acceleration : ndarray, shape (samples,)
    torque : ndarray, shape (samples,)
        Feedforward; 0 where nothing is fed forward.
    """

    position: Array
    velocity: Array
    acceleration: Array
    torque: Array


class Controller(Protocol):
    """A sampled controller. It changes nothing but the memory that it hands on."""

    def start(self) -> Any:
        """Memory before the first sample."""

    def command(self, memory: Any, k: int, x: Array, y: Array) -> tuple[float, Any]:
        """Wanted torque at sample k from states and outputs, and the memory without the torque being limited."""

    def anti_windup(self, memory: Any, wanted: float, given: float) -> Any:
        """Memory once it is known what the limit has left of the wanted torque (anti-windup)."""


@dataclass(frozen=True)
class ClosedLoopRun:
    """Closed-loop run, SI.

    Attributes
    ----------
    t : ndarray, shape (samples,)
    u : ndarray, shape (samples,)
        Torque after the limit, held until the next sample.
    x : ndarray, shape (samples, n)
        States of the model; ``names`` tells which.
    y : ndarray, shape (samples, outputs)
    names : tuple of str
    """

    t: Array
    u: Array
    x: Array
    y: Array
    names: tuple[str, ...]

    def state(self, name: str) -> Array:
        """Course of one state, shape (samples,)."""
        return np.asarray(self.x[:, self.names.index(name)])


def standstill(samples: int) -> Reference:
    """Stay where you are."""
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
        Largest torque, N m (N).
    x0 : ndarray, shape (n,), optional
        Standstill at 0 if not given.
    disturbance : ndarray, shape (samples,), optional
        Torque beside the controller's, not limited.
    noise : ndarray, shape (samples, outputs), optional
        Of the sensors: what the controller is told is the outputs and this.

    Returns
    -------
    Closed

    Raises
    ------
    SettingsError
        If the loop diverges.
    """
    n = len(system.states)
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
    torque, push = np.zeros(samples), np.zeros(samples) if disturbance is None else disturbance
    xs, ys = np.empty((samples, n)), np.empty((samples, len(system.outputs)))
    for k in range(samples):
        applied = _torque_at(torque, push, k - whole - 1)
        xs[k], ys[k] = x, system.output(x, applied)
        told = ys[k] if noise is None else ys[k] + noise[k]
        wanted, memory = controller.command(memory, k, x, told)
        torque[k] = float(np.clip(wanted, -limit, limit))
        memory = controller.anti_windup(memory, wanted, torque[k])
        for span, u in ((part * dt, applied), ((1.0 - part) * dt, _torque_at(torque, push, k - whole))):
            if span > 1e-9 * dt:
                x = response(plant, np.array([u, u]), span, x, held).y[:, -1, 0]
        if not np.all(np.isfinite(x)):
            raise SettingsError(f"the closed loop diverges after {k * dt:.4g} s")
    return ClosedLoopRun(np.asarray(dt * np.arange(samples), float), torque, xs, ys, system.state_names)


def _torque_at(torque: Array, push: Array, k: int) -> float:
    return float(torque[k] + push[k]) if k >= 0 else 0.0
