"""Recording: time, input and measured motion of a drive, checked once and frozen, in coherent SI."""

from __future__ import annotations

import hashlib
import html
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Integral
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from brightgrey.arrays import Array
from brightgrey.errors import RecordingError, one_of
from brightgrey.notebook_html import sparkline, table
from brightgrey.recordings.policy import READING
from brightgrey.recordings.sample_values import resolution
from brightgrey.recordings.units.parser import parse_unit
from brightgrey.recordings.units.signals import KINDS, Units, check_kind, motion_unit

__all__ = ["HOLDS", "Hold", "Recording", "Signal", "Source", "check_hold", "interval"]

Hold = Literal["linear", "zoh"]
HOLDS: tuple[Hold, ...] = ("linear", "zoh")


def check_hold(hold: str) -> Hold:
    """Return `hold` if it is one of `HOLDS`; raise SettingsError if it is not."""
    return one_of("hold", hold, HOLDS)


def interval(first: float, last: float, steps: int, slack: float = 1e-3) -> float:
    """Return the sampling interval in s of `steps` equal steps from `first` to `last`.

    The interval has as few digits as possible; the last sample may be off by `slack` intervals. Two recordings
    of one logger thus get exactly the same interval.
    """
    exact = (last - first) / steps
    rounded = (float(f"{exact:.{digits}g}") for digits in range(1, 16))
    return next((dt for dt in rounded if abs(dt - exact) * steps <= slack * exact), exact)


@dataclass(frozen=True)
class Signal:
    """Meaning of one column of a recording.

    Attributes
    ----------
    name : str
        Name of the column.
    kind : str
        ``input``, ``position``, ``velocity``, ``velocity-differenced`` or ``acceleration``. A velocity that
        was made by differencing an encoder is ``velocity-differenced``: it lags half a sample. ``speed`` is the
        magnitude of a velocity, from a sensor without a sign.
    unit : str
        Unit that the values are shown in, e.g. ``N m``, ``mm/s``.
    gain : float
        Recorded column times gain stands in `unit`.
    unit_given : bool
        False where no unit was given and SI was assumed.
    mass : int
        Mass that an output is measured at, or that the input acts on, counted along the drive train.

    Raises
    ------
    RecordingError
        For an unknown kind or unit, or a mass that is no whole number from 1.
    """

    name: str
    kind: str
    unit: str
    gain: float = 1.0
    unit_given: bool = True
    mass: int = 1

    def __post_init__(self) -> None:
        if self.kind != "input":
            check_kind(self.kind)
        if not (isinstance(self.mass, Integral) and self.mass >= 1):
            raise RecordingError(f"'{self.name}' is at mass {self.mass!r}; expected a whole number from 1")
        object.__setattr__(self, "unit", parse_unit(self.unit).text)

    @property
    def sensor(self) -> str:
        """Kind of an output, with its mass unless that is the first: ``velocity@2``."""
        return self._at_mass(self.kind)

    @property
    def simulated(self) -> str:
        """Output of a model from which the signal is made: the position for a differenced velocity."""
        return self._at_mass({"velocity-differenced": "position", "speed": "velocity"}.get(self.kind, self.kind))

    @property
    def physical(self) -> str:
        """Output of a model that is the measured quantity itself: the velocity for a differenced one."""
        return self._at_mass("velocity" if KINDS[self.kind] == 1 else self.kind)

    def _at_mass(self, kind: str) -> str:
        return kind if self.mass == 1 else f"{kind}@{self.mass}"

    @property
    def factor(self) -> float:
        """Factor from SI to `unit`: shown value = factor · value in SI."""
        return 1.0 / parse_unit(self.unit).si


@dataclass(frozen=True)
class Source:
    """File of a recording, with all that reading it again needs."""

    path: str  #: As it was given.
    sha256: str  #: Of the content of all its files, 64 hexadecimal digits.
    options: Mapping[str, Any]  #: Arguments of :func:`read_recording` that are not its defaults, as plain data.


@dataclass(frozen=True, eq=False)
class Recording:
    """Input and motion of a drive over time. Made by :func:`read_recording`; arrays cannot be written to.

    Attributes
    ----------
    name : str
        File name without folder.
    t : ndarray, shape (samples,)
        Time in s, uniform; starts where the file's time starts.
    u : ndarray, shape (samples,)
        Input in coherent SI (N m, N, V, ...), gain applied.
    y : ndarray, shape (outputs, samples)
        Motion in rad or m, per s as the kind says.
    input : Signal
    outputs : tuple of Signal
    hold : {'linear', 'zoh'}
        Course of the input between two samples: straight line or zero-order hold.
    notes : tuple of str
        Repairs and assumptions that concern the user.
    resolution : ndarray, shape (outputs,)
        Smallest step of each output in rad or m (per s), by which even a perfect model may be off. Found in
        `y` if it is not given.
    source : Source or None
        None for arrays in memory. No result depends on it.

    Raises
    ------
    RecordingError
        For arrays that do not fit each other, numbers that are not finite or absurd, too few samples or a time that
        is not uniform.
    SettingsError
        For an unknown hold.
    """

    name: str
    t: Array
    u: Array
    y: Array
    input: Signal
    outputs: tuple[Signal, ...]
    hold: Hold = "linear"
    notes: tuple[str, ...] = ()
    resolution: Array = field(default_factory=lambda: np.empty(0))
    source: Source | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        check_hold(self.hold)
        t, u, y = _frozen(self.t), _frozen(self.u), _frozen(np.atleast_2d(self.y))
        if t.ndim != 1 or u.shape != t.shape or y.shape != (len(self.outputs), t.size) or not self.outputs:
            raise RecordingError(
                f"{self.name}: time {t.shape}, input {u.shape} and outputs {y.shape} do not fit together;"
                f" expected (samples,), (samples,) and ({len(self.outputs)}, samples)"
            )
        check_samples(self.name, t.size)
        if not (np.isfinite(t).all() and np.isfinite(u).all() and np.isfinite(y).all()):
            raise RecordingError(f"{self.name}: a number is not finite")
        for signal, values in zip((self.input, *self.outputs), (u, *y), strict=True):
            self._check_size(signal, float(np.abs(values).max()))
        dt = (t[-1] - t[0]) / (t.size - 1)
        uneven = np.abs(t - (t[0] + dt * np.arange(t.size))).max()
        if not dt > 0 or uneven > 0.01 * dt + 4 * np.spacing(np.abs(t).max()):
            raise RecordingError(f"{self.name}: the time does not rise in equal steps")
        if not 1.0 / READING.absurd < dt < READING.absurd:
            raise RecordingError(f"{self.name}: steps of {dt:.6g} s are absurd; check the time and its unit")
        steps = self.resolution if np.size(self.resolution) else np.array([resolution(row) for row in y])
        for name, value in (("t", t), ("u", u), ("y", y), ("resolution", _frozen(steps))):
            object.__setattr__(self, name, value)

    def _check_size(self, signal: Signal, largest: float) -> None:
        """Refuse values whose squares, or those of their rates, a computer cannot hold."""
        if largest and not 1.0 / READING.absurd < largest < READING.absurd:
            raise RecordingError(
                f"{self.name}: '{signal.name}' reaches {largest:.6g} in SI, which no drive does; check its unit and"
                " the factors that are given"
            )

    @property
    def samples(self) -> int:
        """Number of samples."""
        return int(self.t.size)

    @cached_property
    def dt(self) -> float:
        """Sampling interval in s."""
        return interval(float(self.t[0]), float(self.t[-1]), self.samples - 1)

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of all that it holds, as 64 hexadecimal digits."""
        signals = [(s.name, s.sensor, s.unit, s.gain) for s in (self.input, *self.outputs)]
        whole = hashlib.sha256(repr((self.name, self.hold, self.notes, signals, self.y.shape)).encode())
        for array in (self.t, self.u, self.y, self.resolution):
            whole.update(array.astype("<f8").tobytes())
        return whole.hexdigest()

    @property
    def units(self) -> Units:
        """Units that parameters of a model of this recording are shown in."""
        return Units(self.input.unit, motion_unit(parse_unit(self.outputs[0].unit)))

    def _repr_html_(self) -> str:
        rows = []
        for signal, values in zip((self.input, *self.outputs), (self.u, *self.y), strict=True):
            shown = values * signal.factor
            least, largest = f"{shown.min():.4g}", f"{shown.max():.4g}"
            rows.append((signal.name, signal.sensor, signal.unit, least, largest, sparkline(shown)))
        length = f"{self.samples} samples every {self.dt:.6g} s from {self.t[0]:.6g} s to {self.t[-1]:.6g} s"
        notes = "".join(f"<li>{html.escape(note)}</li>" for note in self.notes)
        return (
            f"<div><p><b>{html.escape(self.name)}</b>: {length}</p>"
            f"{table(('Signal', 'Kind', 'Unit', 'Least', 'Largest', 'Over time'), rows)}<ul>{notes}</ul></div>"
        )


def check_samples(name: str, samples: int, remedy: str = "") -> None:
    """Refuse fewer samples than `READING.min_samples`; `remedy` is appended to the message."""
    if samples < READING.min_samples:
        raise RecordingError(
            f"{name}: {samples} samples are too few, at least {READING.min_samples} are needed{remedy}"
        )


def _frozen(values: ArrayLike) -> Array:
    array = np.array(values, dtype=np.float64, order="C")
    array.setflags(write=False)
    return array
