"""Simulated drives with one thing that no structure of the function set has, and their recordings.

The drives are integrated by scipy's Radau or LSODA method from their equations of motion, written down here once more.
Nothing of the package simulates them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.integrate import solve_ivp

from brightgrey.arrays import Array
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import Structure
from brightgrey.recordings import Recording
from brightgrey.simulation.reference import UnsettledError
from support.drives import MOTIONS, coloured_noise, excitation, simulated_recording

__all__ = ["KINDS", "ForeignDrive"]

KINDS = ("friction at mass 2", "presliding", "friction with position", "torque with position", "fifth mass", "loop")
"""What the drive has and the function set has not. ``loop``: a noisy closed loop, its torque recorded with noise."""
SHARPNESS = 1000.0
"""Gain of friction's sign over the largest speed."""


class ForeignDrive:
    """One random drive with one of `KINDS` in turn; `truth` is the part of it that the function set has.

    The truth is drawn from the structures without gap, current control and dead time: with Coulomb friction for
    presliding and friction with position, with two masses at least for friction at mass 2, with four for a fifth.
    """

    def __init__(self, seed: int, number: int, candidates: Sequence[Structure]) -> None:
        rng = np.random.default_rng([seed, number])
        self.seed, self.number, self.kind = seed, number, KINDS[number % len(KINDS)]
        fitting = [s for s in candidates if _allows(s, self.kind)]
        self.truth = fitting[int(rng.integers(len(fitting)))]
        self.values = random_values(self.truth.parameters, rng)
        self.motion = MOTIONS[number // len(KINDS) % len(MOTIONS)]
        self.u = excitation(self.motion, rng)
        e = PAPER_EXPERIMENT
        peak = float(np.abs(self.u).max())
        self.extra = {
            "M_C2": peak * rng.uniform(0.05, 0.25),
            "slip": e.distance * np.exp(rng.uniform(np.log(1e-4), np.log(1e-2))),
            "ripple": rng.uniform(0.2, 0.7),
            "torque": peak * rng.uniform(0.03, 0.15),
            "wave": 2.0 * np.pi / (e.distance * rng.uniform(0.2, 1.0)),
            "phase": rng.uniform(0.0, 2.0 * np.pi),
            "J5": self.values["J1"] * rng.uniform(0.5, 2.0),
            "rate5": 2.0 * np.pi * rng.uniform(10.0, 100.0),
            "noise": 0.02 * e.speed,
        }
        self.disturbance = coloured_noise(self.u.size, 0.0, rng) * self.extra["noise"]
        self.applied, self.v = self._simulate()

    def recording(self, noise: float) -> Recording:
        """Recording of torque and velocity.

        Parameters
        ----------
        noise : float
            Standard deviation of the velocity's noise over its peak.
        """
        rng = np.random.default_rng([self.seed, self.number, round(1e6 * noise)])
        y = self.v + noise * float(np.abs(self.v).max()) * rng.standard_normal(self.v.size)
        u = self.applied
        if self.kind == "loop":
            u = u + 0.02 * float(np.abs(u).max()) * rng.standard_normal(u.size)
        return simulated_recording(u, y)

    def _simulate(self) -> tuple[Array, Array]:
        """Torque and velocity of mass 1 at the samples."""
        values, extra, kind = dict(self.values), self.extra, self.kind
        masses = self.truth.masses
        J = [values[f"J{i + 1}"] for i in range(masses)]
        c = [values[f"c{i + 1}"] for i in range(masses - 1)]
        d = [values[f"d{i + 1}"] for i in range(masses - 1)]
        if kind == "fifth mass":
            J.append(extra["J5"])
            c.append(extra["J5"] * extra["rate5"] ** 2)
            d.append(0.05 * extra["J5"] * extra["rate5"])
        n, e = len(J), PAPER_EXPERIMENT
        inertia, c_, d_ = np.array(J), np.array(c), np.array(d)
        gain = SHARPNESS / e.speed
        M_C, M_S, f_v, M_G = (values.get(name, 0.0) for name in ("M_C", "M_S", "f_v", "M_G"))
        omega_S = values.get("omega_S", 1.0)
        t = e.dt * np.arange(self.u.size)
        wanted = np.cumsum(self.u) * e.dt / inertia.sum()  # speed that the loop is to follow
        total = float(inertia.sum())

        def torque(time: float, x: Array) -> float:
            if kind != "loop":
                return float(np.interp(time, t, self.u))
            error = np.interp(time, t, wanted) - x[n] - np.interp(time, t, self.disturbance)
            return float(total * (40.0 * error + 400.0 * x[-1]))

        def rates(time: float, x: Array) -> Array:
            q, v = x[:n], x[n : 2 * n]
            shaft = c_ * (q[:-1] - q[1:]) + d_ * (v[:-1] - v[1:])
            force = np.zeros(n)
            force[:-1] -= shaft
            force[1:] += shaft
            side = np.tanh(gain * v[0])
            coulomb = M_C * side
            out = np.zeros_like(x)
            if kind == "presliding":  # Dahl: the friction's spring slips
                stiffness = M_C / extra["slip"]
                coulomb = x[2 * n]
                out[2 * n] = stiffness * v[0] * (1.0 - np.sign(v[0]) * x[2 * n] / M_C)
            elif kind == "friction with position":
                coulomb *= 1.0 + extra["ripple"] * np.sin(extra["wave"] * q[0] + extra["phase"])
            elif kind == "torque with position":
                force[0] += extra["torque"] * np.sin(extra["wave"] * q[0] + extra["phase"])
            elif kind == "friction at mass 2":
                force[1] -= extra["M_C2"] * np.tanh(gain * v[1])
            force[0] += torque(time, x) + M_G - coulomb - f_v * v[0] - M_S * side * np.exp(-abs(v[0]) / omega_S)
            out[:n], out[n : 2 * n] = v, force / inertia
            if kind == "loop":
                out[-1] = np.interp(time, t, wanted) - x[n] - np.interp(time, t, self.disturbance)
            return out

        x0 = np.zeros(2 * n + (kind in ("presliding", "loop")))
        options = {"t_eval": t, "rtol": 1e-7, "atol": 1e-7, "max_step": 2.0 * e.dt}
        found = solve_ivp(rates, (0.0, float(t[-1])), x0, method="LSODA", **options)
        if not found.success:
            raise UnsettledError(f"'{self.truth}', {kind}: {found.message}")
        applied = np.array([torque(time, x) for time, x in zip(t, found.y.T, strict=True)])
        return applied, found.y[n]


def _allows(structure: Structure, kind: str) -> bool:
    """True if the kind can be added to a structure."""
    names = set(structure.names)
    if names & {"backlash", "current_control", "delay"}:
        return False
    if kind == "fifth mass":
        return structure.masses == 4
    if kind == "friction at mass 2":
        return structure.masses > 1
    if kind in ("presliding", "friction with position"):
        return "coulomb" in names
    return True
