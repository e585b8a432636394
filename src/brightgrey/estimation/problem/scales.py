"""Scales of a recording: the magnitudes in which bounds and start values are declared.

The input is regressed on acceleration, speed, sign of speed and a constant. Differentiating a noisy signal would drown
the inertia, so the torque balance is averaged over windows. Let ``box`` be the mean over n samples and ``D`` the
difference over n samples divided by their time; then ``D`` of a signal is exactly ``box`` of its derivative. Every term
is filtered three times, and where a derivative is due, ``D`` takes the place of ``box``. All terms then have passed the
same filter, and the noise of the difference falls with the window (modulating functions in their simplest form,
Shinbrot 1957).

Where that leaves the inertia uncertain and positions are measured, a wave over the position is one more term. On an arm
gravity balances most of the inertia, and friction would take the place of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Scales
from brightgrey.numerics.bounded_least_squares import bounded_least_squares
from brightgrey.recordings import Recording
from brightgrey.recordings.units.signals import KINDS

__all__ = ["ScalesOptions", "scales", "speed_of"]

_FILTER_PASSES = 3


@dataclass(frozen=True)
class ScalesOptions:
    """Windows, limits and robustness of the regression that gives the scales."""

    shortest_window: int = 3  #: Samples.
    longest_smoothing: float = 1.0 / 20.0  #: Longest window that smooths the speed, as part of the recording.
    #: Longest window of the torque balance, as part of the recording: it averages over oscillations of the drive.
    longest_window: float = 1.0 / 4.0
    windows: int = 8  #: Number of windows that are tried, between the shortest and the longest.
    #: Smoothing of the speed ends when it changes the speed by less than this part of its standard deviation.
    smoothing_change: float = 0.03
    reversal_speed: float = 0.02  #: Part of the largest speed at which the sign of the speed has changed.
    rows: int = 4000  #: Rows of the regression that are enough.
    reweightings: int = 4  #: Rounds of Huber's weights.
    #: The longest window is taken whose standard error of the inertia is within this factor of the least one.
    similar_uncertainty: float = 1.5
    #: Part of the torque's variance; a balance that leaves more does not hold. An oscillating drive leaves half of it.
    unexplained_torque: float = 0.2
    least_inertia: float = 0.01  #: Of a balance that does not hold, as a part of that upper limit.
    driven_torque: float = 0.05  #: Part of the torque's standard deviation that a window has to leave.
    #: Relative standard error of the inertia from which a torque that depends on the position is a further term.
    uncertain_inertia: float = 0.2
    most_waves: float = 4.0  #: Most periods of that torque over the travel.
    wave_rows: int = 1000  #: Rows of its regressions that are enough: there is one for each period.
    #: Limits of the inertia, relative to the largest torque over the largest acceleration, and the lower limit of
    #: friction and damping, relative to the largest torque.
    plausible_low: float = 1e-4
    plausible_high: float = 1e4


SCALES_DEFAULTS = ScalesOptions()


@dataclass(frozen=True)
class _Balance:
    """Averaged torque balance ``torque = terms @ (inertia, friction, viscous, offset)``: one row per window."""

    torque: Array
    terms: Array


@dataclass(frozen=True)
class _Solution:
    """Regression of a torque balance that is averaged over windows of one length."""

    uncertainty: float  #: Relative standard error of the inertia.
    values: Array  #: Inertia, friction, viscous friction and offset.
    unexplained: float  #: Part of the torque's variance.
    deviations: tuple[float, float]  #: Standard deviations of torque and acceleration.


def scales(recordings: Recording | Sequence[Recording], options: ScalesOptions = SCALES_DEFAULTS) -> Scales:
    """Scales of one recording, or of several taken together.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
    options : ScalesOptions

    Returns
    -------
    Scales
        All finite; all but `offset` positive, also for a recording in which nothing moves.

    Notes
    -----
    The regression is accurate to some ten per cent: it neglects elasticity, dead time and other friction.
    """
    recordings = (recordings,) if isinstance(recordings, Recording) else tuple(recordings)
    torque = _positive_or(max(float(np.abs(r.u).max()) for r in recordings), 1.0)
    interval = min(r.dt for r in recordings)
    duration = max((r.samples - 1) * r.dt for r in recordings)
    speed = max(_largest_speed(r, options) for r in recordings)
    travel = _positive_or(max(_travel(r) for r in recordings), speed * duration)
    acceleration = max(_largest_acceleration(r, options) for r in recordings)
    acceleration = _positive_or(acceleration, speed / duration)
    (inertia, friction, viscous, offset), factor = _regression(recordings, speed, options)
    low, high = options.plausible_low, options.plausible_high
    return Scales(
        torque=torque,
        speed=speed,
        acceleration=acceleration,
        travel=travel,
        interval=interval,
        duration=duration,
        inertia=_clipped(inertia, torque / acceleration, low, high),
        friction=_clipped(friction, torque, low, 1.0),
        viscous=_clipped(viscous, torque / speed, low, 1.0),
        offset=float(np.clip(offset, -torque, torque)),
        inertia_factor=factor,
    )


def speed_of(recording: Recording, options: ScalesOptions = SCALES_DEFAULTS) -> Array:
    """Speed in rad/s (m/s), shape (samples,), from the output that measures it best, smoothed if noisy."""
    return _speed(recording, _smoothing_window(recording, options))


def _positive_or(value: float, default: float) -> float:
    """Return `value` if it is positive and finite, else `default`."""
    return float(value) if np.isfinite(value) and value > 0.0 else float(default)


def _clipped(value: float, unit: float, low: float, high: float) -> float:
    """Clip `value` to between `low` and `high` times `unit`."""
    return float(np.clip(value, low * unit, high * unit)) if np.isfinite(value) else low * unit


def _best_output(recording: Recording) -> int:
    """Index of the output that measures motion best: velocity, else position, else acceleration; near the motor."""

    def rank(out: int) -> tuple[bool, int, int]:
        signal = recording.outputs[out]
        return signal.kind == "speed", (1, 0, 2).index(KINDS[signal.kind]), signal.mass

    return min(range(len(recording.outputs)), key=rank)


def _integral(x: Array, dt: float) -> Array:
    """Integral of x from the first sample, by trapezoids."""
    return np.concatenate([[0.0], np.cumsum(0.5 * dt * (x[1:] + x[:-1]))])


def _difference(x: Array, n: int, dt: float) -> Array:
    return np.asarray((x[n:] - x[:-n]) / (n * dt))


def _box(x: Array, n: int, dt: float) -> Array:
    return _difference(_integral(x, dt), n, dt)


def _window_means(x: Array, n: int, dt: float, derivatives: int, times: int = _FILTER_PASSES) -> Array:
    """Signal `x` after `times` means over n samples, of which `derivatives` differentiate it."""
    for k in range(times):
        x = _difference(x, n, dt) if k < derivatives else _box(x, n, dt)
    return x


def _smoothing_window(recording: Recording, options: ScalesOptions) -> int:
    """Samples over which the speed is smoothed: doubled until that no longer changes the speed."""
    n, longest = 1, max(int(options.longest_smoothing * recording.samples), 1)
    fine = _speed(recording, n)
    while 2 * n <= longest:
        coarse = _speed(recording, 2 * n)
        if np.std(fine - coarse) <= options.smoothing_change * np.std(coarse):
            break
        n, fine = 2 * n, coarse
    return n


def _speed(recording: Recording, n: int) -> Array:
    """Speed, shape (samples,), smoothed over about 2n samples."""
    out = _best_output(recording)
    y, dt = recording.y[out], recording.dt
    order = KINDS[recording.outputs[out].kind]
    if order == 2:
        return _integral(y, dt)
    v = np.gradient(y, dt) if order == 0 else y
    if n > 1:
        kernel = np.convolve(np.ones(n), np.ones(n)) / n**2
        ends = n if order == 0 else 1  # samples whose mean goes on beyond an end: a difference is nearly all noise
        padded = np.pad(v, n - 1, mode="mean", stat_length=ends)
        v = np.convolve(padded, kernel, mode="valid")
    return np.asarray(v, float)


def _largest_speed(recording: Recording, options: ScalesOptions) -> float:
    """Largest speed; of a drive at rest, the resolution of its sensor over the duration of the recording."""
    largest = float(np.abs(speed_of(recording, options)).max())
    out = _best_output(recording)
    time = (recording.samples - 1) * recording.dt
    step = float(recording.resolution[out]) * time ** (KINDS[recording.outputs[out].kind] - 1)
    return max(_positive_or(largest, 0.0), _positive_or(step, np.finfo(float).tiny ** 0.25))


def _travel(recording: Recording) -> float:
    """Range of position."""
    for signal, y in zip(recording.outputs, recording.y, strict=True):
        if signal.kind == "position":
            return float(np.ptp(y))
    return float(np.ptp(_integral(_speed(recording, 1), recording.dt)))


def _largest_acceleration(recording: Recording, options: ScalesOptions) -> float:
    """Largest acceleration, measured or by differences of the speed."""
    for signal, y in zip(recording.outputs, recording.y, strict=True):
        if signal.kind == "acceleration":
            return float(np.abs(y).max())
    n = max(_smoothing_window(recording, options), options.shortest_window)
    return float(np.abs(_difference(_speed(recording, n), n, recording.dt)).max())


def _regression(recordings: tuple[Recording, ...], speed: float, options: ScalesOptions) -> tuple[Array, float]:
    """Inertia, friction, viscous friction and offset, by the longest window with nearly the least standard error.

    And the factor by which the inertia may be smaller.

    A short window leaves noise and oscillations in the acceleration, which pull the inertia to zero. A long window
    averages the motion away. In between, the relative standard error of the inertia is least; it counts the rows that
    the window leaves independent.

    Not even that balance may hold, because the drive oscillates more slowly than the window, or it may leave no
    inertia. Then the inertia is an upper limit. All torque accelerates, in the window where that gives the largest
    inertia and enough torque is left.
    """
    shortest = options.shortest_window
    longest = max(int(options.longest_window * min(r.samples for r in recordings)), shortest)
    windows = [int(n) for n in np.unique(np.geomspace(shortest, longest, options.windows).astype(int))]
    found = [_solve_balance(recordings, n, speed, options) for n in windows]
    best = _longest_certain(found, options)
    if _measures_travel(recordings) and not (_holds(best, options) and best.uncertainty <= options.uncertain_inertia):
        waved = _longest_certain([_solve_with_wave(recordings, n, speed, options) for n in windows], options)
        best = waved if _holds(waved, options) and waved.uncertainty < best.uncertainty else best
    if _holds(best, options):
        return best.values, 1.0
    enough = options.driven_torque * found[0].deviations[0]
    deviations = [solution.deviations for solution in found]
    driven = [torque / acceleration for torque, acceleration in deviations if acceleration > 0.0 and torque >= enough]
    limit = max([best.values[0], *driven])
    least = max(float(best.values[0]), options.least_inertia * limit)
    return np.array([limit, *best.values[1:]]), limit / least if least > 0.0 else 1.0


def _measures_travel(recordings: tuple[Recording, ...]) -> bool:
    """True if positions are measured in all recordings, and change."""
    measured = all(any(s.kind == "position" for s in r.outputs) for r in recordings)
    return measured and any(_travel(r) > 0.0 for r in recordings)


def _longest_certain(found: list[_Solution], options: ScalesOptions) -> _Solution:
    """Solution of the longest window whose standard error of the inertia is nearly the least."""
    least = min(solution.uncertainty for solution in found)
    return [s for s in found if s.uncertainty <= options.similar_uncertainty * least][-1]


def _holds(solution: _Solution, options: ScalesOptions) -> bool:
    return bool(solution.values[0] > 0.0) and solution.unexplained <= options.unexplained_torque


def _solve_balance(recordings: tuple[Recording, ...], n: int, speed: float, options: ScalesOptions) -> _Solution:
    """Regression of the balance over windows of n samples."""
    balances = [_balance(r, n, speed, options) for r in recordings]
    torque = np.concatenate([b.torque for b in balances])
    terms = np.concatenate([b.terms for b in balances])
    values = _robust_regression(torque, terms, options.reweightings)
    memory = n * _FILTER_PASSES * len(torque) / sum(r.samples for r in recordings)
    return _solution(torque, terms, values, memory)


def _solve_with_wave(recordings: tuple[Recording, ...], n: int, speed: float, options: ScalesOptions) -> _Solution:
    """Regression of the balance with a torque that is a wave over the position, of the period that explains most."""
    travel = max(_travel(r) for r in recordings)
    few = replace(options, rows=options.wave_rows)
    balances = [_balance(r, n, speed, few) for r in recordings]
    torque = np.concatenate([b.torque for b in balances])
    memory = n * _FILTER_PASSES * len(torque) / sum(r.samples for r in recordings)
    solutions = []
    for k in np.arange(0.25 * np.pi, 2.0 * np.pi * options.most_waves, 1.0) / travel:  # half a radian apart at the ends
        waves = [_waves(r, n, float(k), few) for r in recordings]
        terms = np.concatenate([np.hstack([b.terms, wave]) for b, wave in zip(balances, waves, strict=True)])
        values = _robust_regression(torque, terms, 1)
        solutions.append(_solution(torque, terms, values, memory))
    return min(solutions, key=lambda s: s.unexplained)


def _waves(recording: Recording, n: int, k: float, options: ScalesOptions) -> Array:
    """Means of sine and cosine of k times the position over windows of n samples, shape (rows, 2)."""
    position = next(y for s, y in zip(recording.outputs, recording.y, strict=True) if s.kind == "position")
    waves = [_window_means(wave(k * position), n, recording.dt, 0) for wave in (np.sin, np.cos)]
    return np.stack(waves, axis=1)[:: max(1, len(waves[0]) // options.rows)]


def _solution(torque: Array, terms: Array, values: Array, memory: float) -> _Solution:
    variance, rest = float(np.var(torque)), float(np.var(torque - terms @ values))
    uncertainty = _inertia_error(torque, terms, values, memory)
    unexplained = rest / variance if variance > 0.0 else float(rest > 0.0)
    return _Solution(uncertainty, values[:4], unexplained, (float(np.std(torque)), float(np.std(terms[:, 0]))))


def _inertia_error(torque: Array, terms: Array, values: Array, memory: float) -> float:
    """Relative standard error of the inertia if `memory` rows count as one; infinite if they do not determine it."""
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


def _balance(recording: Recording, n: int, speed: float, options: ScalesOptions) -> _Balance:
    """Torque balance of a recording over windows of n samples."""
    out = _best_output(recording)
    y, dt = recording.y[out], recording.dt
    order = KINDS[recording.outputs[out].kind]
    if order == 2:
        acceleration = _window_means(y, n, dt, 0)
        rate = _window_means(_integral(y, dt), n, dt, 0)
    else:
        acceleration = _window_means(y, n, dt, 2 - order)
        rate = _window_means(y, n, dt, 1 - order)
    sign = np.tanh(speed_of(recording, options) / (options.reversal_speed * speed))
    sign = _window_means(sign, n, dt, 0)
    torque = _window_means(recording.u, n, dt, 0)
    terms = np.stack([acceleration, sign, rate, np.ones_like(rate)], axis=1)
    keep = slice(None, None, max(1, len(torque) // options.rows))
    return _Balance(torque[keep], terms[keep])


def _robust_regression(torque: Array, terms: Array, reweightings: int) -> Array:
    """Regression with Huber's weights; inertia and friction are not negative."""
    size = np.abs(terms).max(axis=0)
    size[size == 0.0] = 1.0
    X = terms / size
    low = np.where(np.arange(terms.shape[1]) < 3, 0.0, -np.inf)
    weight = np.ones_like(torque)
    x = np.zeros(low.size)
    for _ in range(reweightings):
        root = np.sqrt(weight)
        with np.errstate(invalid="ignore"):  # a column of zeros makes its path along the bounds 0 times infinity
            x = bounded_least_squares(X * root[:, None], torque * root, low, np.full(low.size, np.inf))
        r = np.abs(torque - X @ x)
        spread = 1.345 * float(np.median(r)) / 0.6745  # Huber: 95 % efficiency; median to standard deviation
        weight = np.minimum(1.0, spread / np.maximum(r, np.finfo(float).tiny)) if spread > 0.0 else weight
    return np.asarray(x / size)
