"""Rivals that are fitted anew: what remains of a truth in the recordings so far and in a new motion.

Rivals begin where the recordings so far have left them, or where their torques balance those of the truth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Scales
from brightgrey.estimation.problem.torque_balance import torque_kinds
from brightgrey.kit import Structure
from brightgrey.planning.alternatives import with_free
from brightgrey.planning.drive import PlannedDrive
from brightgrey.planning.envelope import MotionCommand, nominal_reaction
from brightgrey.search.undecided.question import Question

__all__ = ["refitted", "refitted_from_torques", "remaining", "scales_with"]


@dataclass(frozen=True)
class _Policy:
    """Numbers of the descents."""

    steps: int = 12  #: Levenberg-Marquardt steps of a rival that is refitted, the first without damping.
    first_damping: float = 0.01  #: Of a step that is tried again, over the diagonal of the normal equations.
    most_damping: float = 10.0  #: Damping above which a rival counts as fitted.
    negligible: float = 0.01  #: Relative decrease that is not worth another step,
    irrelevant: float = 0.1  #: and decrease of a deviance that changes no power.
    near: float = 2.0  #: Factor of a shape within which the normal equations of the recordings so far hold.
    samples: int = 16  #: Shapes of a rival's effects that are tried with torques like those of the truth.


POLICY = _Policy()


def remaining(
    information: Array,
    gradient: Array,
    deviance: float,
    change: Array,
    jacobian: Array,
    box: tuple[Array, Array] | None = None,
) -> float:
    """Sum of squares that remains when a rival is fitted to old recordings and a new motion, at first order.

    Parameters
    ----------
    information : ndarray, shape (P, P)
        Of the old recordings.
    gradient : ndarray, shape (P,)
        Of half the old sum of squares.
    deviance : float
        Old sum of squares.
    change : ndarray, shape (residuals,)
        Whitened outputs of the rival minus those of the truth in the new motion.
    jacobian : ndarray, shape (residuals, P)
    box : pair of ndarray, shape (P,), optional
        Least and largest step of the rival's parameters to their bounds.
    """
    H, g = information + jacobian.T @ jacobian, gradient + jacobian.T @ change
    d = _least_squares_step(H, g, box)
    return max(float(deviance + change @ change + 2.0 * d @ g + d @ H @ d), 0.0)


def _least_squares_step(H: Array, g: Array, box: tuple[Array, Array] | None = None) -> Array:
    """Least-norm step d in units of the diagonal that minimises d H d + 2 d g; what leaves the box is held at it."""
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    low, high = box if box is not None else (np.full(len(g), -np.inf), np.full(len(g), np.inf))
    d, free = np.zeros(len(g)), np.ones(len(g), bool)
    while free.any():
        left = (g + H @ np.where(free, 0.0, d))[free] / scale[free]
        part = (H / np.outer(scale, scale))[np.ix_(free, free)]
        d[free] = -np.linalg.pinv(part, rcond=1e-12, hermitian=True) @ left / scale[free]
        beyond = free & ((d < low) | (d > high))
        if not beyond.any():
            break
        d, free = np.where(beyond, np.clip(d, low, high), d), free & ~beyond
    return d


def scales_with(drive: PlannedDrive, torque: Array) -> Scales:
    """Scales of the recordings so far and of a new one, which give the ranges when both are identified.

    A faster motion admits friction that fades at a higher speed, for example.

    Parameters
    ----------
    drive : PlannedDrive
    torque : ndarray, shape (samples,)
        As the new recording holds it, N m (N).
    """
    so_far, dt = drive.known.scales, drive.known.sampling_time
    found = nominal_reaction(replace(drive, loop=None), MotionCommand(torque, None))
    q, v = found.position[0, :, 0], found.velocity[0, :, 0]
    new = {
        "torque": np.abs(torque).max(),
        "speed": np.abs(v).max(),
        "acceleration": np.abs(np.diff(v)).max() / dt,
        "travel": np.ptp(q),
        "duration": (torque.size - 1) * dt,
    }
    sizes = {name: max(getattr(so_far, name), float(size)) for name, size in new.items()}
    return replace(so_far, **sizes)


def refitted(drive: PlannedDrive, q: Question, torque: Array, truth: Array, scales: Scales) -> float:
    """Sum of squares that remains when the rival is fitted to the recordings so far and the new one, simulated anew.

    It begins where the recordings so far have left it, and with the truth's values of the parameters that both have.
    Where friction sticks and slips, a motion may be far from linear in them.

    Parameters
    ----------
    drive : PlannedDrive
    q : Question
    torque : ndarray, shape (samples,)
        Of the new motion, N m (N).
    truth : ndarray, shape (residuals,)
        Whitened outputs of the truth in it.
    scales : Scales
        Of the recordings so far and the new one, which give the ranges.
    """
    shared = {name: q.values.get(name, value) for name, value in q.rival.values.items()}
    end = _descended(drive, q, torque, truth, drive.theta(q.rival), scales)
    if end.smooth:
        return end.remaining
    begin = drive.theta(replace(q.rival, values=shared))
    return min(end.remaining, _descended(drive, q, torque, truth, begin, scales).remaining)


class _End(NamedTuple):
    """End of a descent."""

    remaining: float  #: Sum of squares.
    theta: Array  #: Scaled parameters, shape (P,).
    smooth: bool  #: True if the steps came to an end.


def _descended(drive: PlannedDrive, q: Question, torque: Array, truth: Array, begin: Array, scales: Scales) -> _End:
    """Levenberg-Marquardt steps of the rival.

    What one more step would take off at first order counts as taken off: where the descent gets stuck, nobody knows.
    The recordings so far are linear in the parameters themselves, not in their logarithms: sizes of effects may change
    by far.
    """
    H0, g0, known, space = (
        np.array(q.rival.information),
        np.array(q.gradient),
        drive.theta(q.rival),
        drive.space(q.rival),
    )
    low, high = drive.box(q.rival, scales)

    def at(theta: Array) -> tuple[float, Array, Array]:
        y, J = drive.outputs_and_jacobian(q.rival, theta, torque)
        e, d = y - truth, np.where(space.log, np.expm1(theta - known), theta - known)
        slope = np.where(space.log, 1.0 + d, 1.0)
        cost = float(q.deviance + 2.0 * d @ g0 + d @ H0 @ d + e @ e)
        finite = np.isfinite(cost) and np.isfinite(J).all()
        return (cost if finite else np.inf), np.outer(slope, slope) * H0 + J.T @ J, slope * (g0 + H0 @ d) + J.T @ e

    theta, damping, smooth = np.clip(begin, low, high), 0.0, False
    best, H, g = at(theta)
    for _ in range(POLICY.steps):
        if not np.isfinite(best):
            return _End(0.0, theta, False)
        d = _least_squares_step(H + damping * np.diag(np.diag(H)), g, (low - theta, high - theta))
        smooth = damping == 0.0 and -float(2.0 * d @ g + d @ H @ d) <= max(POLICY.negligible * best, POLICY.irrelevant)
        if smooth or damping > POLICY.most_damping:
            break
        cost, H_tried, g_tried = at(theta + d)
        if cost < best:
            theta, best, H, g = theta + d, cost, H_tried, g_tried
            damping = 0.1 * damping if damping > POLICY.first_damping else 0.0
        else:
            damping = max(10.0 * damping, POLICY.first_damping)
    d = _least_squares_step(H, g, (low - theta, high - theta))
    return _End(max(best + min(float(2.0 * d @ g + d @ H @ d), 0.0), 0.0), theta, smooth)


def refitted_from_torques(drive: PlannedDrive, q: Question, torque: Array, truth: Array, scales: Scales) -> float:
    """Sum of squares that remains when the rival begins with torques that balance those of the truth.

    Stribeck friction that fades slowly is like Coulomb friction with less viscous friction, for example. No descent
    leads there from where the recordings so far have left it. Their normal equations hold while the shapes of torques,
    such as the speed at which friction fades, stay near. Further away they are taken to say nothing of single torques,
    since others could have stood for them. No less remains than the recordings so far leave alone.

    Parameters
    ----------
    drive : PlannedDrive
    q : Question
    torque : ndarray, shape (samples,)
        Of the new motion, N m (N).
    truth : ndarray, shape (residuals,)
        Whitened outputs of the truth in it.
    scales : Scales
        Of the recordings so far and the new one, which give the ranges.

    Returns
    -------
    float
        Infinite where no torque of the rival has a shape besides its size, or none can be balanced.
    """
    torques = [p for kind in torque_kinds(Structure.parse(q.rival.structure)) for p in kind]
    sizes = {p.parameter(o.symbol) for p in torques for o in p.effect.parameters if o.size}
    shapes = {p.parameter(o.symbol) for p in torques for o in p.effect.parameters if not o.size}
    begin = drive.start_by_torques(q, shapes, torque, scales, POLICY.samples) if shapes & set(q.rival.names) else None
    if begin is None:
        return np.inf
    end = _descended(drive, with_free(q, sizes | shapes), torque, truth, begin, scales)
    change = np.abs(end.theta - drive.theta(q.rival))[[name in shapes for name in q.rival.names]]
    if change.max() < np.log(POLICY.near):
        end = _descended(drive, q, torque, truth, end.theta, scales)
    H, g, none = np.array(q.rival.information), np.array(q.gradient), np.zeros(0)
    so_far = remaining(H, g, q.deviance, none, np.zeros((0, g.size)), drive.steps_to_bounds(q.rival, scales))
    return max(end.remaining, so_far)
