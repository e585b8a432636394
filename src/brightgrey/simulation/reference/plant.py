"""Input of the reference solvers: the numbers of one drive train, and the torque cut at its knots.

It is written from the physics and does not use the effects' stamps and laws, because it serves to check them. It is
therefore the only place beside the effects that knows the function set by name.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError, StructureError, one_of
from brightgrey.recordings.recording import HOLDS, Hold

__all__ = ["Load", "Plant", "Segments", "Trajectory", "cut", "difference"]

_MASSES = {"one_mass": 1, "two_mass": 2, "three_mass": 3, "four_mass": 4}
_AT_MASS = {
    "coulomb": ("M_C",),
    "viscous": ("f_v",),
    "stribeck": ("M_S", "omega_S"),
    "gravity": ("M_G",),
    "directional_viscous": ("f_d",),
    "ground_spring": ("c_g",),
    "pendulum": ("G", "k", "phi_0"),
}
_AT_SHAFT = {"backlash": ("alpha",), "cubic_spring": ("c_cubic",)}
_ELSEWHERE = {**_AT_SHAFT, "current_control": ("T_1",), "delay": ("T_d",)}
_PARAMETERS = {**_AT_MASS, **_ELSEWHERE}
_POSITIVE = ("J", "omega_S", "T_1")
_NOT_NEGATIVE = ("c", "d", "alpha", "T_d", "c_g", "c_cubic")


@dataclass(frozen=True)
class Load:
    """Torque on one mass beside that of the shafts, in SI units: ``-M_F(v) + M_G - c_g q - G sin(k q + phi_0)``."""

    f_v: float = 0.0  #: Friction of eq. (2), at this mass.
    M_C: float = 0.0
    M_S: float = 0.0
    fading: float = 1.0  #: omega_S
    f_d: float = 0.0  #: Of friction f_d |v|.
    M_G: float = 0.0
    c_g: float = 0.0
    G: float = 0.0
    k: float = 0.0
    phi_0: float = 0.0

    @property
    def breakaway(self) -> float:
        """Torque in N m that dry friction withstands at rest, A(0) = M_C + M_S."""
        return self.M_C + self.M_S

    @property
    def is_dry(self) -> bool:
        """There is friction that reverses with the motion."""
        return self.M_C != 0.0 or self.M_S != 0.0

    def of_position(self, q: float) -> float:
        """Torque that depends on the position, and the constant one."""
        return self.M_G - self.c_g * q - self.G * math.sin(self.k * q + self.phi_0)


@dataclass(frozen=True)
class Plant:
    """Numbers of a drive train in SI units. An effect that is absent has its neutral value."""

    J: tuple[float, ...]  #: Moments of inertia, motor first, kg m² (kg).
    #: Spring (N m/rad) and damper constants (N m s/rad) of the shafts.
    c: tuple[float, ...]
    d: tuple[float, ...]
    hardening: tuple[float, ...]  #: Of the shafts: torque over the third power of the twist, N m/rad³.
    loads: tuple[Load, ...]  #: Of the masses.
    f_tanh: float  #: Gain of eq. (2), s/rad; infinite for exact dry friction.
    gap_at: int  #: Shaft with the gap, counted from 0.
    alpha: float | None  #: Half the gap in rad; None without backlash.
    T_1: float | None  #: Reset time of the current loop in s; None without it.
    T_d: float  #: Dead time of the input in s.
    actuator: int = 1  #: Mass that the input acts on, counted from 1.

    @property
    def masses(self) -> int:
        """Number of masses N."""
        return len(self.J)

    @property
    def state_names(self) -> tuple[str, ...]:
        """q1.., v1.., lambda, T: the order of :mod:`brightgrey.kit`."""
        numbers = range(1, self.masses + 1)
        names = [f"q{i}" for i in numbers] + [f"v{i}" for i in numbers]
        names += [f"lambda{self.gap_at + 1}"] if self.alpha is not None else []
        names += ["T"] if self.T_1 is not None else []
        return tuple(names)

    @property
    def sticks(self) -> tuple[bool, ...]:
        """Masses that have exact dry friction, so that they can stick."""
        return tuple(math.isinf(self.f_tanh) and load.is_dry for load in self.loads)

    @property
    def fastest_rate(self) -> float:
        """Upper estimate of the fastest rate in 1/s, without the gap's c/d, which is solved exactly.

        Exact dry friction has no slope at standstill; sliding, its rate is that of Stribeck's exponential.
        """
        rates = [1.0, 0.0 if self.T_1 is None else 1.0 / self.T_1]
        for J, load in zip(self.J, self.loads, strict=True):
            slope = abs(load.M_S) / load.fading
            if math.isfinite(self.f_tanh):
                slope = self.f_tanh * (abs(load.M_C) + abs(load.M_S))
            rates.append((slope + abs(load.f_v) + abs(load.f_d)) / J)
            rates.append(math.sqrt((load.c_g + abs(load.G * load.k)) / J))
        for k, (c, d) in enumerate(zip(self.c, self.d, strict=True)):
            lightness = 1.0 / self.J[k] + 1.0 / self.J[k + 1]
            rates += [2.0 * d * lightness, math.sqrt(2.0 * c * lightness)]
        return max(rates)

    @classmethod
    def of(cls, structure: str, values: Mapping[str, float], f_tanh: float, actuator: int = 1) -> Plant:
        """Read a structure such as ``two_mass+coulomb@2``, its parameter values and the mass that the input acts on.

        Raises
        ------
        StructureError
            For an unknown effect, not exactly one multiple-mass system, or more than one gap.
        SettingsError
            For a missing or unknown parameter, or a value that is not physical; for exact dry friction that would
            push at standstill instead of holding; for an actuator at a mass that is not there.
        """
        placed = [_placed(text) for text in structure.split("+")]
        chains = [name for name, _ in placed if name in _MASSES]
        if len(chains) != 1 or len(set(placed)) != len(placed):
            raise StructureError(f"'{structure}': exactly one of {', '.join(_MASSES)}, and no effect twice")
        n = _MASSES[chains[0]]
        if not 1 <= actuator <= n:
            raise SettingsError(f"actuator at mass {actuator}: '{structure}' has masses 1 to {n}")
        gaps = [place for name, place in placed if name == "backlash"]
        if len(gaps) > 1:
            raise StructureError(f"'{structure}': the reference solves one gap at most")
        for name, place in placed:
            if place > (n if name in _AT_MASS else n - 1 if name in _AT_SHAFT else 1):
                count = f"{('one', 'two', 'three', 'four')[n - 1]} mass{'es' if n > 1 else ''}"
                raise StructureError(f"'{structure}': there is no place for '{name}@{place}' with {count}")
        if any(("cubic_spring", place) in placed for place in gaps):
            raise StructureError(f"'{structure}': a shaft with a gap has no hardening spring")
        symbols = [f"J{i + 1}" for i in range(n)]
        symbols += [f"{s}{k + 1}" for s in "cd" for k in range(n - 1)]
        symbols += [_at(p, place) for name, place in placed for p in _PARAMETERS.get(name, ())]
        _check_values(structure, symbols, values, f_tanh)
        has = set(symbols)
        if gaps and not values[f"d{gaps[0]}"] > 0.0:
            raise SettingsError(f"d{gaps[0]} must be positive with backlash: the gap relaxes with c/d")

        def load(place: int) -> Load:
            known = [p for name in _AT_MASS for p in _AT_MASS[name] if (name, place) in placed]
            return Load(**{{"omega_S": "fading"}.get(p, p): float(values[_at(p, place)]) for p in known})

        plant = cls(
            J=tuple(float(values[f"J{i + 1}"]) for i in range(n)),
            c=tuple(float(values[f"c{k + 1}"]) for k in range(n - 1)),
            d=tuple(float(values[f"d{k + 1}"]) for k in range(n - 1)),
            hardening=tuple(float(values.get(_at("c_cubic", k + 1), 0.0)) for k in range(n - 1)),
            loads=tuple(load(i + 1) for i in range(n)),
            f_tanh=float(f_tanh),
            gap_at=gaps[0] - 1 if gaps else 0,
            alpha=float(values[_at("alpha", gaps[0])]) if gaps else None,
            T_1=float(values["T_1"]) if "T_1" in has else None,
            T_d=float(values["T_d"]) if "T_d" in has else 0.0,
            actuator=actuator,
        )
        for i, (can_stick, own) in enumerate(zip(plant.sticks, plant.loads, strict=True)):
            if can_stick and own.breakaway < 0.0:
                raise SettingsError(
                    f"M_C + M_S = {own.breakaway:g} at mass {i + 1} must not be negative with exact dry friction"
                )
        return plant

    def initial(self, x0: Array | None, u_first: float) -> Array:
        """Return `x0` checked, or standstill at 0 with lambda = 0 and T = u[0]. Raises SettingsError."""
        names = self.state_names
        if x0 is None:
            return np.array([u_first if name == "T" else 0.0 for name in names])
        x = np.array(x0, dtype=float)
        if x.shape != (len(names),) or not np.all(np.isfinite(x)):
            raise SettingsError(f"x0 must hold {len(names)} finite numbers: {', '.join(names)}")
        if self.alpha is not None:
            gap, name = x[2 * self.masses], names[2 * self.masses]
            if not -2.0 * self.alpha <= gap <= 0.0:
                raise SettingsError(f"{name} = {gap:g} lies outside of the gap [{-2.0 * self.alpha:g}, 0]")
        return x


def _placed(text: str) -> tuple[str, int]:
    """Effect and place of ``name`` or ``name@place``."""
    name, _, place = text.partition("@")
    one_of("effect", name, (*_MASSES, *_PARAMETERS), error=StructureError)
    return name, int(place or 1)


def _at(symbol: str, place: int) -> str:
    """Name of a parameter; the first place is not written."""
    return symbol if place == 1 else f"{symbol}@{place}"


def _check_values(structure: str, symbols: list[str], values: Mapping[str, float], f_tanh: float) -> None:
    """Check that names are complete and known and that values are physical."""
    for symbol in values:
        one_of(f"parameter of '{structure}'", symbol, symbols)
    missing = [symbol for symbol in symbols if symbol not in values]
    if missing:
        raise SettingsError(f"no value for parameter {', '.join(missing)} of '{structure}'")
    for symbol in symbols:
        bare = symbol.partition("@")[0]
        value, kind = float(values[symbol]), bare.rstrip("1234") if bare[0] in "Jcd" else bare
        wrong = not math.isfinite(value)
        wrong |= kind in _POSITIVE and not value > 0.0
        wrong |= kind in _NOT_NEGATIVE and not value >= 0.0
        if wrong:
            raise SettingsError(f"{symbol} = {value:g} is not physical")
    if not f_tanh > 0.0:
        raise SettingsError(f"f_tanh = {f_tanh:g} must be a positive number, or infinite for exact dry friction")


@dataclass(frozen=True)
class Segments:
    """The delayed input as straight pieces, cut at the samples and where the delayed samples fall."""

    length: Array  #: Duration of each piece in s, shape (pieces,).
    #: Input at the beginning of the piece (right limit) and at its end (left limit), shape (pieces,).
    start: Array
    end: Array
    sample: NDArray[np.int64]  #: Index of the sample at which the piece ends, or -1, shape (pieces,).
    #: Delayed input at the samples (right limit), as an acceleration output sees it, shape (samples,).
    at_sample: Array


def cut(u: Array, dt: float, T_d: float, hold: Hold) -> Segments:
    """Cut the input, delayed by `T_d`, into pieces on which it is a straight line.

    Before the first sample the input is u[0]. A dead time closer than 1e-9 samples to a whole number is one.

    Raises
    ------
    SettingsError
        For an input that is not a row of at least two finite numbers, a `dt` that is not positive, or an
        unknown `hold`.
    """
    u = np.asarray(u, dtype=float)
    if u.ndim != 1 or len(u) < 2 or not np.all(np.isfinite(u)):
        raise SettingsError("the input must be a row of at least two finite numbers")
    if not (math.isfinite(dt) and dt > 0.0):
        raise SettingsError(f"dt = {dt:g} must be a positive number of seconds")
    one_of("hold", hold, HOLDS)
    whole = round(T_d / dt)
    if abs(T_d / dt - whole) < 1e-9:
        part = 0.0
    else:
        whole = math.floor(T_d / dt)
        part = T_d / dt - whole

    intervals = len(u) - 1
    k = np.arange(intervals)
    now = u[np.clip(k - whole, 0, None)]
    after = u[np.clip(k - whole + 1, 0, None)]
    if part == 0.0:
        end = after if hold == "linear" else now
        last = u[max(intervals - whole, 0)]
        return Segments(np.full(intervals, dt), now, end, k + 1, np.append(now, last))
    # Piece one of each interval still belongs to the input interval before, piece two to the next.
    before = u[np.clip(k - whole - 1, 0, None)]
    if hold == "linear":
        first = before + (now - before) * (1.0 - part)
        final = now + (after - now) * (1.0 - part)
        start, end = np.stack([first, now], axis=1), np.stack([now, final], axis=1)
    else:
        start = end = np.stack([before, now], axis=1)
    length = np.tile([part * dt, (1.0 - part) * dt], intervals)
    sample = np.stack([np.full(intervals, -1), k + 1], axis=1)
    at_sample = np.append(start[:, 0], end[-1, 1])
    return Segments(length, start.ravel(), end.ravel(), sample.ravel(), at_sample)


@dataclass(frozen=True)
class Trajectory:
    """Motion at the samples."""

    names: tuple[str, ...]  #: Names of the states.
    states: Array  #: Shape (states, samples).
    acceleration: Array  #: Of mass 1, shape (samples,).

    def output(self, kind: str) -> Array:
        """``position``, ``velocity``, ``acceleration`` of mass 1, or any state by name; shape (samples,), SI.

        Any other name raises SettingsError.
        """
        if kind == "acceleration":
            return self.acceleration
        names = {"position": "q1", "velocity": "v1", **{name: name for name in self.names}}
        known = one_of("output", kind, (*names, "acceleration"))
        return np.asarray(self.states[self.names.index(names[known])])


def difference(kind: str, one: Trajectory, other: Trajectory) -> float:
    """Largest difference of an output relative to its peak; acceleration, which jumps at contacts, by RMS."""
    y, z = one.output(kind), other.output(kind)
    if not (np.all(np.isfinite(y)) and np.all(np.isfinite(z))):
        return math.inf
    if kind == "acceleration":
        size, apart = float(np.sqrt(np.mean(y**2))), float(np.sqrt(np.mean((y - z) ** 2)))
    else:
        size, apart = float(np.max(np.abs(y))), float(np.max(np.abs(y - z)))
    if apart == 0.0:
        return 0.0
    return apart / size if size > 0.0 else math.inf
