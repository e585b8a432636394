"""What a recording says about the size of things: the scales that bounds and starts are declared in.

The input is regressed on acceleration, speed, sign of speed and a constant. Differentiating a noisy signal
would drown the inertia, so the balance is taken over windows: with ``box`` the mean over n samples and ``D``
the difference over n samples divided by their time, ``D`` of a signal is ``box`` of its derivative, exactly.
Every term is filtered three times, and where a derivative is due, ``D`` takes the place of ``box``; all terms
then have passed the same filter (modulating functions, Shinbrot 1957, in their simplest form), and
the noise of the difference falls with the window.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Scales
from brightgrey.numerics.bounded_least_squares import bounded_least_squares
from brightgrey.recordings import Recording

__all__ = ["scales", "speed_of"]


_FILTERS = 3
SHORTEST = 3  # samples
LONGEST = 1.0 / 20.0  # of the recording, for a smoothed speed
SLOWEST = 1.0 / 4.0  # of the recording, for the torque balance: it has to average over the swings of elastic drives
NOISY = 0.03  # of the speed: what smoothing may still change
TURNED = 0.02  # of the largest speed: where the sign of speed has turned
ROWS = 4000  # rows of the regression that are enough
REWEIGHTINGS = 4
ALIKE = 1.5  # times the least uncertainty: what is hardly worse
UNEXPLAINED = 0.2  # of the torque's variance, from which a balance does not hold: drives that swing leave half of it
DRIVEN = 0.05  # of the torque's standard deviation, that a window must leave to say anything
SMALLEST, LARGEST = 1e-4, 1e4  # relative to what torque, speed and acceleration make plausible
ORDER = {"position": 0, "velocity": 1, "velocity-differenced": 1, "acceleration": 2}


@dataclass(frozen=True)
class _Balance:
    """Window-averaged torque balance ``torque = terms @ (inertia, friction, viscous, offset)``."""

    torque: Array
    terms: Array


def scales(recordings: Recording | Sequence[Recording]) -> Scales:
    """Scales of one recording, or of several taken together.

    Parameters
    ----------
    recordings : Recording or sequence of Recording

    Returns
    -------
    Scales
        All finite; all but `offset` positive, also for a recording in which nothing moves.

    Notes
    -----
    The regression is good to some ten per cent: it knows nothing of elasticity, dead time and what
    else friction may do.
    """
    recordings = (recordings,) if isinstance(recordings, Recording) else tuple(recordings)
    torque = _size(max(float(np.abs(r.u).max()) for r in recordings), 1.0)
    interval = min(r.dt for r in recordings)
    duration = max((r.samples - 1) * r.dt for r in recordings)
    speed = max(_largest_speed(r) for r in recordings)
    travel = _size(max(_travel(r) for r in recordings), speed * duration)
    acceleration = max(_largest_acceleration(r) for r in recordings)
    acceleration = _size(acceleration, speed / duration)
    inertia, friction, viscous, offset = _regression(recordings, speed)
    return Scales(
        torque=torque,
        speed=speed,
        acceleration=acceleration,
        travel=travel,
        interval=interval,
        duration=duration,
        inertia=_within(inertia, torque / acceleration, LARGEST),
        friction=_within(friction, torque, 1.0),
        viscous=_within(viscous, torque / speed, 1.0),
        offset=float(np.clip(offset, -torque, torque)),
    )


def speed_of(recording: Recording) -> Array:
    """Speed in rad/s (m/s), shape (samples,), from the output that tells it best, smoothed if noisy."""
    return _speed(recording, _window(recording))


def _size(value: float, otherwise: float) -> float:
    """Return `value` if it can serve as a scale, else `otherwise`."""
    return float(value) if np.isfinite(value) and value > 0.0 else float(otherwise)


def _within(value: float, unit: float, high: float) -> float:
    """`value` kept between SMALLEST and `high` times `unit`."""
    return float(np.clip(value, SMALLEST * unit, high * unit)) if np.isfinite(value) else SMALLEST * unit


def _best_output(recording: Recording) -> int:
    """Output that tells motion best: velocity, else position, else acceleration."""
    orders = [ORDER[signal.kind] for signal in recording.outputs]
    return orders.index(next(order for order in (1, 0, 2) if order in orders))


def _integral(x: Array, dt: float) -> Array:
    """Integral of x from the first sample, by trapezoids."""
    return np.concatenate([[0.0], np.cumsum(0.5 * dt * (x[1:] + x[:-1]))])


def _difference(x: Array, n: int, dt: float) -> Array:
    return np.asarray((x[n:] - x[:-n]) / (n * dt))


def _box(x: Array, n: int, dt: float) -> Array:
    return _difference(_integral(x, dt), n, dt)


def _filtered(x: Array, n: int, dt: float, derivatives: int, times: int = _FILTERS) -> Array:
    """`x` differentiated `derivatives` times and averaged over n samples `times` times."""
    for k in range(times):
        x = _difference(x, n, dt) if k < derivatives else _box(x, n, dt)
    return x


def _window(recording: Recording) -> int:
    """Find how many samples to smooth speed over: doubled until that no longer changes much."""
    n, longest = 1, max(int(LONGEST * recording.samples), 1)
    fine = _speed(recording, n)
    while 2 * n <= longest:
        coarse = _speed(recording, 2 * n)
        if np.std(fine - coarse) <= NOISY * np.std(coarse):
            break
        n, fine = 2 * n, coarse
    return n


def _speed(recording: Recording, n: int) -> Array:
    """Speed, shape (samples,), smoothed over about 2n samples."""
    out = _best_output(recording)
    y, dt = recording.y[out], recording.dt
    order = ORDER[recording.outputs[out].kind]
    if order == 2:
        return _integral(y, dt)
    v = np.gradient(y, dt) if order == 0 else y
    if n > 1:
        kernel = np.convolve(np.ones(n), np.ones(n)) / n**2
        padded = np.pad(v, n - 1, mode="edge")
        v = np.convolve(padded, kernel, mode="valid")
    return np.asarray(v, float)


def _largest_speed(recording: Recording) -> float:
    """Largest speed; of a drive at rest, the smallest step that its sensor can tell, over the recording."""
    largest = float(np.abs(speed_of(recording)).max())
    out = _best_output(recording)
    time = (recording.samples - 1) * recording.dt
    step = float(recording.resolution[out]) * time ** (ORDER[recording.outputs[out].kind] - 1)
    return max(_size(largest, 0.0), _size(step, np.finfo(float).tiny ** 0.25))


def _travel(recording: Recording) -> float:
    """Range of position."""
    for signal, y in zip(recording.outputs, recording.y, strict=True):
        if signal.kind == "position":
            return float(np.ptp(y))
    return float(np.ptp(_integral(_speed(recording, 1), recording.dt)))


def _largest_acceleration(recording: Recording) -> float:
    for signal, y in zip(recording.outputs, recording.y, strict=True):
        if signal.kind == "acceleration":
            return float(np.abs(y).max())
    n = max(_window(recording), SHORTEST)
    return float(np.abs(_difference(_speed(recording, n), n, recording.dt)).max())


def _regression(recordings: tuple[Recording, ...], speed: float) -> Array:
    """Return inertia, friction, viscous and offset, from the longest window that tells the inertia about best.

    A short window leaves noise and swings of elastic drives in the acceleration, which pulls the inertia to zero; a
    long one averages the motion away. The relative standard error of the inertia, for as many rows as the window leaves
    independent, is least in between.

    If not even that window's balance holds, since the drive swings slower than it averages, the inertia is as large as
    it could be if all torque went into acceleration, in the window that leaves torque and in which that is largest.
    """
    fewest = min(r.samples for r in recordings)
    longest = max(int(SLOWEST * fewest), SHORTEST)
    samples = sum(r.samples for r in recordings)
    found, bare = [], []
    for n in np.unique(np.geomspace(SHORTEST, longest, 8).astype(int)):
        balances = [_balance(r, int(n), speed) for r in recordings]
        torque = np.concatenate([b.torque for b in balances])
        terms = np.concatenate([b.terms for b in balances])
        values = _robust(torque, terms)
        uncertainty = _uncertainty(torque, terms, values, n * _FILTERS * len(torque) / samples)
        found.append((uncertainty, values, float(np.var(torque - terms @ values)), float(np.var(torque))))
        bare.append((float(np.std(torque)), float(np.std(terms[:, 0]))))
    least = min(uncertainty for uncertainty, *_ in found)
    _, values, left, spread = [f for f in found if f[0] <= ALIKE * least][-1]
    if left > UNEXPLAINED * spread:
        driven = [t / a for t, a in bare if a > 0.0 and t >= DRIVEN * bare[0][0]]
        values[0] = max([values[0], *driven])
    return values


def _uncertainty(torque: Array, terms: Array, values: Array, memory: float) -> float:
    """Relative standard error of the inertia if `memory` rows count as one; inf if they say nothing."""
    size = np.abs(terms).max(axis=0)
    size[size == 0.0] = 1.0
    X = terms / size
    alone = X[:, 0] - X[:, 1:] @ np.linalg.lstsq(X[:, 1:], X[:, 0])[0]
    information = float(alone @ alone)
    if values[0] <= 0.0 or information <= 0.0:
        return float("inf")
    rest = float(np.mean((torque - terms @ values) ** 2))
    with np.errstate(over="ignore"):
        return float(np.sqrt(rest * memory / information) / size[0] / values[0])


def _balance(recording: Recording, n: int, speed: float) -> _Balance:
    out = _best_output(recording)
    y, dt = recording.y[out], recording.dt
    order = ORDER[recording.outputs[out].kind]
    if order == 2:
        acceleration = _filtered(y, n, dt, 0)
        rate = _filtered(_integral(y, dt), n, dt, 0)
    else:
        acceleration = _filtered(y, n, dt, 2 - order)
        rate = _filtered(y, n, dt, 1 - order)
    sign = _filtered(np.tanh(speed_of(recording) / (TURNED * speed)), n, dt, 0)
    torque = _filtered(recording.u, n, dt, 0)
    terms = np.stack([acceleration, sign, rate, np.ones_like(rate)], axis=1)
    keep = slice(None, None, max(1, len(torque) // ROWS))
    return _Balance(torque[keep], terms[keep])


def _robust(torque: Array, terms: Array) -> Array:
    """Regression with Huber's weights; nothing but the offset may be negative."""
    size = np.abs(terms).max(axis=0)
    size[size == 0.0] = 1.0
    X = terms / size
    low = np.array([0.0, 0.0, 0.0, -np.inf])
    weight = np.ones_like(torque)
    x = np.zeros(4)
    for _ in range(REWEIGHTINGS):
        root = np.sqrt(weight)
        with np.errstate(invalid="ignore"):  # a column of zeros makes its path along the bounds 0 times infinity
            x = bounded_least_squares(X * root[:, None], torque * root, low, np.full(4, np.inf))
        r = np.abs(torque - X @ x)
        spread = 1.345 * float(np.median(r)) / 0.6745
        weight = np.minimum(1.0, spread / np.maximum(r, np.finfo(float).tiny)) if spread > 0.0 else weight
    return np.asarray(x / size)
