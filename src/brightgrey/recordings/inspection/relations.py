"""Relations between channels, found in their numbers: derivatives, setpoints, and what drives a motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings.inspection.meaning import MOTIONS, Meaning, stem_of
from brightgrey.recordings.inspection.profile import block_means
from brightgrey.recordings.policy import INSPECTION

__all__ = ["explained_by_motion", "find_derivatives", "find_setpoints", "is_count", "is_even_time", "on_one_time"]


def on_one_time(values: Mapping[int, Array], times: Mapping[int, Array]) -> dict[int, Array]:
    """Return channels with times of their own at the instants of the slowest of them, where all of them are there.

    Channels without a time of their own are left as they are, and so are all if no time is common to all.
    """
    there = {i: np.isfinite(values[i]) & np.isfinite(t) for i, t in times.items()}
    clocked = {i: (times[i][ok], values[i][ok]) for i, ok in there.items() if ok.any()}
    if not clocked:
        return dict(values)
    begin, end = max(t[0] for t, _ in clocked.values()), min(t[-1] for t, _ in clocked.values())
    slowest = min((t[(t >= begin) & (t <= end)] for t, _ in clocked.values()), key=len)
    if not slowest.size:
        return dict(values)
    return {**values, **{i: np.interp(slowest, t, x) for i, (t, x) in clocked.items()}}


def is_even_time(values: Array) -> bool:
    """Return True if a channel rises in steps that differ by half at most, as a time does."""
    steps = np.diff(values)
    if not np.isfinite(steps).all() or not steps.size or steps.min() <= 0:
        return False
    usual = float(np.median(steps))
    return bool(np.mean(np.abs(steps - usual) <= 0.5 * usual) > 0.9)


def is_count(values: Array) -> bool:
    """Return True if a channel counts the samples, by one from each to the next."""
    return values.size > 2 and bool((np.diff(values) == 1.0).all())


def find_derivatives(
    values: Mapping[int, Array], meanings: dict[int, Meaning], names: Mapping[int, str], dt: float
) -> None:
    """Find positions and velocities among channels that nothing names, and write them into `meanings`."""
    unknown = [i for i in values if not meanings[i].quantity][: INSPECTION.compared]
    if len(unknown) < 2:
        return
    means = np.array([block_means(values[i], INSPECTION.points) for i in unknown])
    step = dt * max(1, values[unknown[0]].size // means.shape[1])
    slopes = np.gradient(means, step, axis=1)
    scale = np.std(slopes, axis=1)[:, None] * np.std(means, axis=1)[None, :]
    covariance = (slopes - slopes.mean(axis=1)[:, None]) @ (means - means.mean(axis=1)[:, None]).T / means.shape[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = np.where(scale > 0, covariance / scale, 0.0)
    np.fill_diagonal(correlation, 0.0)
    order = np.argsort(-correlation, axis=None)
    for a, b in zip(*np.unravel_index(order, correlation.shape), strict=True):
        if correlation[a, b] < INSPECTION.derivative:
            return
        position, velocity = unknown[int(a)], unknown[int(b)]
        ratio = float(np.std(means[b]) / np.std(slopes[a]))
        if meanings[position].quantity or meanings[velocity].quantity or not 0.8 < ratio < 1.25:
            continue
        meanings[position] = Meaning("position", reason=f"'{names[velocity]}' is its derivative")
        meanings[velocity] = Meaning("velocity", reason=f"it is the derivative of '{names[position]}'")


def find_setpoints(values: Mapping[int, Array], meanings: dict[int, Meaning], names: Mapping[int, str]) -> None:
    """Tell setpoints from actual values, among channels whose names do not say it.

    Two channels belong together if they are correlated and of one size; one that nothing names takes its quantity from
    the other. The setpoint has less noise, or comes earlier. Names of motions that differ by their number alone are
    those of like sensors at several places, such as ``pos1`` and ``pos2``.
    """
    open_ones = [i for i in values if not meanings[i].role][: INSPECTION.compared]
    means = {i: block_means(values[i], INSPECTION.points) for i in open_ones}
    for n, i in enumerate(open_ones):
        for j in open_ones[n + 1 :]:
            if _are_numbered(i, j, meanings, names):
                continue
            if not meanings[i].role and not meanings[j].role and _belong(meanings[i], meanings[j], means[i], means[j]):
                _tell_apart(i, j, values, meanings, names)


def _are_numbered(i: int, j: int, meanings: Mapping[int, Meaning], names: Mapping[int, str]) -> bool:
    """Return True for two motions whose names differ by their number alone."""
    motions = {meanings[i].quantity, meanings[j].quantity} <= set(MOTIONS)
    return motions and names[i] != names[j] and stem_of(names[i]) == stem_of(names[j])


def _belong(one: Meaning, other: Meaning, x: Array, y: Array) -> bool:
    """Return True if two channels may be setpoint and actual value of one quantity."""
    if x.size != y.size or (one.quantity and other.quantity and one.quantity != other.quantity):
        return False
    named = bool(one.quantity and other.quantity)
    ratio = float(np.std(x) / np.std(y))
    alike = named or (0.75 < ratio < 1.33 and abs(float(np.mean(x - y))) < 0.1 * float(np.std(y)))
    return alike and float(np.corrcoef(x, y)[0, 1]) >= INSPECTION.same


def _tell_apart(
    i: int, j: int, values: Mapping[int, Array], meanings: dict[int, Meaning], names: Mapping[int, str]
) -> None:
    """Write into `meanings` which of two channels is the setpoint, if their noise or their delay shows it."""
    quantity = meanings[i].quantity or meanings[j].quantity
    if not (meanings[i].quantity and meanings[j].quantity):
        for k, other in ((i, j), (j, i)):
            if not meanings[k].quantity and quantity:
                meanings[k] = replace(meanings[k], quantity=quantity, reason=f"it nearly equals '{names[other]}'")
    noise = {k: float(np.std(np.diff(values[k][np.isfinite(values[k])], 2))) for k in (i, j)}
    setpoint, actual = sorted(noise, key=lambda k: noise[k])
    why = "and is smoother"
    if noise[setpoint] >= INSPECTION.smoother * noise[actual]:
        delay = _delay(block_means(values[i], INSPECTION.points), block_means(values[j], INSPECTION.points))
        if delay == 0.0:
            return
        setpoint, actual = (i, j) if delay > 0 else (j, i)
        why = "and comes earlier"
    for k, role, other, how in ((setpoint, "setpoint", actual, why), (actual, "actual", setpoint, "")):
        relation = f"it {'leads' if how else 'follows'} '{names[other]}' {how}".strip()
        reason = ", ".join(part for part in (meanings[k].reason, relation) if part)
        meanings[k] = replace(meanings[k], role=role, reason=reason)


def _delay(x: Array, y: Array) -> float:
    """Return by how many points `y` comes later than `x`; 0 if their difference is no delay."""
    slope = np.gradient(0.5 * (x + y))
    spread = float(np.std(y - x) * np.std(slope))
    if spread == 0.0 or abs(float(np.mean((y - x) * slope))) < INSPECTION.delayed * spread:
        return 0.0
    return -float(np.mean((y - x) * slope) / np.mean(slope**2))


def explained_by_motion(u: Array, motion: Array, quantity: str, dt: float) -> float:
    """Return the part of an input's variance that a motion explains, from 0 to 1.

    The input is regressed on acceleration, speed, the sign of the speed, position and a constant. A channel that
    drives the motion has a large part, any other one a small part.
    """
    u, y = block_means(u, INSPECTION.points), block_means(motion, INSPECTION.points)
    if u.size != y.size or u.size < 10 or np.std(u) == 0.0:
        return 0.0
    step = dt * max(1, motion.size // y.size)
    order = MOTIONS.index(quantity) if quantity in MOTIONS else 1
    x = y if order == 0 else np.cumsum(y) * step
    v = np.gradient(y, step) if order == 0 else y
    terms: Sequence[Array] = [
        np.gradient(v, step),
        v,
        np.tanh(v / (1e-12 + 0.05 * np.abs(v).max())),
        x,
        np.ones(u.size),
    ]
    matrix = np.array([term / (np.abs(term).max() or 1.0) for term in terms]).T
    rest = u - matrix @ np.linalg.lstsq(matrix, u, rcond=None)[0]
    return float(1.0 - np.var(rest) / np.var(u))
