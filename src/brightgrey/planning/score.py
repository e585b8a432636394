"""Power of a motion to decide open questions, and its information on the parameters.

Between a truth and a rival a likelihood ratio test decides. Its noncentrality is the whitened sum of squares that
remains between both. The rival is fitted to the truth, to the recordings so far and to the new motion jointly. It is
the T-criterion of Atkinson and Fedorov (1975, doi:10.1093/biomet/62.1.57), here for dynamic models with coloured
noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.planning.alternatives import share_that_matters, truth_between
from brightgrey.planning.drive import PlannedDrive
from brightgrey.planning.envelope import command_of, recorded_torque
from brightgrey.search.detectability import power
from brightgrey.search.undecided.question import Known, Question

__all__ = ["Answer", "Score", "mean_powers", "power_so_far", "remaining", "score"]


@dataclass(frozen=True)
class _Policy:
    """Numbers of the score."""

    enough: float = 1.3  #: Multiple of the critical deviance beyond which more noncentrality is worth little.
    information_share: float = 0.02  #: Weight of the parameters' information: it decides among equals.
    refits: int = 12  #: Levenberg-Marquardt steps of a rival that is refitted, the first without damping.
    first_damping: float = 0.01  #: Of a step that is tried again, over the diagonal of the normal equations.
    most_damping: float = 10.0  #: Damping above which a rival counts as fitted.
    draws: int = 4  #: Draws of the parameters that powers are averaged over,
    gaps: tuple[float, ...] = (0.0, -0.5, -1.0)  #: and positions in a gap at the begin, in widths.
    negligible: float = 0.01  #: Relative decrease that is not worth another step,
    irrelevant: float = 0.1  #: and decrease of a deviance that changes no power.
    confusable: float = 0.2  #: Power from which an effect is also told from all others together.


POLICY = _Policy()


@dataclass(frozen=True)
class Answer:
    """Answer of a motion to a question."""

    question: Question
    noncentrality: float  #: With the recordings so far.
    critical: float  #: Deviance that has to be exceeded.

    @property
    def power(self) -> float:
        """Probability that the question is decided."""
        return power(self.noncentrality, self.question.parameters, self.critical)


@dataclass(frozen=True)
class Score:
    """Score of a motion."""

    answers: tuple[Answer, ...]
    information: Array  #: Of the best structure, with the recordings so far, shape (P, P), scaled space.
    gain: float  #: Mean logarithm of the growth of the information's eigenvalues.

    @property
    def value(self) -> float:
        """Number to be maximised: a geometric mean over the questions, which lifts the worst first."""
        ratios = [a.noncentrality / a.critical for a in self.answers]
        decided = [np.log(max(r, 1e-6)) if r < 1.0 else POLICY.enough * (1.0 - 1.0 / (1.0 + np.log(r))) for r in ratios]
        return float(np.mean(decided) if decided else 0.0) + POLICY.information_share * self.gain


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


def score(drive: PlannedDrive, torque: Array, *, refit: bool = False) -> Score | None:
    """Score of a torque, shape (samples,); None if a simulation diverges.

    With `refit` the rivals descend to their optima, and the largest structures without an effect are rivals, too, in
    which all others may do the same together. Else rivals are taken as linear in their parameters.
    """
    if not np.isfinite(torque).all():
        return None
    jacobians: dict[tuple[object, ...], tuple[Array, Array]] = {}
    for known in (drive.known.model, *(q.rival for q in drive.asked)):
        if _key(known) not in jacobians:
            jacobians[_key(known)] = drive.outputs_and_jacobian(known, drive.theta(known), torque)
    if not all(np.isfinite(part).all() for pair in jacobians.values() for part in pair):
        return None
    answers = []
    for k, (q, truth) in enumerate(zip(drive.asked, drive.truths(drive.asked, torque), strict=True)):
        y, J = jacobians[_key(q.rival)]
        H, g = np.array(q.rival.information), np.array(q.gradient)
        found = remaining(H, g, q.deviance, y - truth, J, drive.steps_to_bounds(q.rival))
        if refit:
            found = min(found, _refitted(drive, q, torque, truth)) if found > 0.0 else found
        answer = Answer(q, found, critical(drive, q, torque.size))
        if refit and answer.power >= POLICY.confusable:
            left = [_refitted(drive, wide, torque, truth) for wide in drive.against_largest[k]]
            answer = replace(answer, noncentrality=min([answer.noncentrality, *left]))
        answers.append(answer)
    old, J = np.array(drive.known.model.information), jacobians[_key(drive.known.model)][1]
    new = old + J.T @ J
    scale = np.sqrt(np.maximum(np.diag(old), 1e-300))
    grown = [float(np.linalg.slogdet(H / np.outer(scale, scale) + 1e-12 * np.eye(len(H)))[1]) for H in (old, new)]
    return Score(tuple(answers), new, (grown[1] - grown[0]) / max(len(old), 1))


def _key(known: Known) -> tuple[object, ...]:
    """Structure, estimated names and values: all that its outputs depend on."""
    return known.structure, known.names, *known.values.items()


def critical(drive: PlannedDrive, question: Question, samples: int) -> float:
    """Deviance that has to be exceeded after a new recording of so many samples."""
    known = drive.known
    more = samples * len(known.noise)
    material = known.material_growth * (known.deviance + more)
    return max(question.critical, material, known.error_floor * (1.0 + more / known.samples))


def _refitted(drive: PlannedDrive, q: Question, torque: Array, truth: Array) -> float:
    """Sum of squares that remains when the rival is fitted to the recordings so far and the new one, simulated anew.

    It begins where the recordings so far have left it, and with the truth's values of the parameters that both have.
    Where friction sticks and slips, a motion may be far from linear in them.
    """
    shared = {name: q.values.get(name, value) for name, value in q.rival.values.items()}
    found, smooth = _descended(drive, q, torque, truth, drive.theta(q.rival))
    if smooth:
        return found
    return min(found, _descended(drive, q, torque, truth, drive.theta(replace(q.rival, values=shared)))[0])


def _descended(drive: PlannedDrive, q: Question, torque: Array, truth: Array, begin: Array) -> tuple[float, bool]:
    """Sum of squares that remains after Levenberg-Marquardt steps of the rival, and if they came to an end.

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
    low, high = space.box

    def at(theta: Array) -> tuple[float, Array, Array]:
        y, J = drive.outputs_and_jacobian(q.rival, theta, torque)
        e, d = y - truth, np.where(space.log, np.expm1(theta - known), theta - known)
        slope = np.where(space.log, 1.0 + d, 1.0)
        cost = float(q.deviance + 2.0 * d @ g0 + d @ H0 @ d + e @ e)
        finite = np.isfinite(cost) and np.isfinite(J).all()
        return (cost if finite else np.inf), np.outer(slope, slope) * H0 + J.T @ J, slope * (g0 + H0 @ d) + J.T @ e

    theta, damping, smooth = np.clip(begin, low, high), 0.0, False
    best, H, g = at(theta)
    for _ in range(POLICY.refits):
        if not np.isfinite(best):
            return 0.0, False
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
    return max(best + min(float(2.0 * d @ g + d @ H @ d), 0.0), 0.0), smooth


def power_so_far(drive: PlannedDrive, question: Question) -> float:
    """Power of the recordings so far to decide a question."""
    found = []
    for q in (truth_between(question, share_that_matters(question, part)) for part in _shares()):
        none, H, g = np.zeros((0, len(q.gradient))), np.array(q.rival.information), np.array(q.gradient)
        left = remaining(H, g, q.deviance, np.zeros(0), none, drive.steps_to_bounds(q.rival))
        found.append(power(left, q.parameters, critical(drive, q, 0)))
    return float(np.mean(found))


def mean_powers(drive: PlannedDrive, torque: Array, seed: int) -> list[float]:
    """Power of each question, averaged over draws of the parameters, positions in the gap at the begin, and truths.

    The truths of tied structures lie between both, evenly. In closed loop `torque` is the feed-forward, and each draw
    is recorded with the torque of its own reaction.
    """
    command = command_of(drive, torque)
    draws = drive.draws(POLICY.draws, np.random.default_rng([seed, 4]))
    shares = np.random.default_rng([seed, 5]).permutation(_shares()).reshape(len(POLICY.gaps), POLICY.draws)
    found = []
    for gap, within in zip(POLICY.gaps, shares.tolist(), strict=True):
        scored = []
        for k, share in enumerate(within):
            drawn = drive.with_values({n: float(v[k]) for n, v in draws.items()}, gap, share)
            scored.append(score(drawn, recorded_torque(drawn, command), refit=True))
        pairs = [(one.answers, share) for one, share in zip(scored, within, strict=True) if one is not None]
        kept = len(pairs) / len(scored)  # the others diverge
        asked = range(len(drive.known.questions) if pairs else 0)
        found.append([kept * _mean_power([(answers[k], share) for answers, share in pairs]) for k in asked])
    return [float(p) for p in np.sum([f or [0.0] * len(drive.known.questions) for f in found], axis=0) / len(found)]


def _mean_power(answers: Sequence[tuple[Answer, float]]) -> float:
    """Power of answers with truths at several parts of the way from where they matter.

    A rival that fits a truth fits those nearer to it as well. What remains counts as falling with the square of the
    share at least, as it does where all is linear: else a fit may have got stuck.
    """
    question = answers[0][0].question
    if question.kind != "tied":
        return float(np.mean([a.power for a, _ in answers]))
    nearest_last = sorted(((a, share_that_matters(question, part)) for a, part in answers), key=lambda pair: -pair[1])
    powers, (least, at) = [], nearest_last[0]
    for answer, share in nearest_last:
        if answer.noncentrality <= least.noncentrality * (share / at) ** 2:
            least, at = answer, share
        powers.append(replace(least, noncentrality=least.noncentrality * (share / at) ** 2).power)
    return float(np.mean(powers))


def _shares() -> Array:
    """Parts of the way to the truth, evenly, as many as truths that powers are averaged over."""
    count = POLICY.draws * len(POLICY.gaps)
    return np.asarray((np.arange(count) + 0.5) / count)
