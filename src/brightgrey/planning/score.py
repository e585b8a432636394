"""Power of a motion to decide open questions, and its information on the parameters.

Between a truth and a rival a likelihood ratio test decides. Its noncentrality is the whitened sum of squares that
remains between both when the rival is fitted to the truth, to the recordings so far and to the new motion jointly: the
T-criterion of Atkinson and Fedorov (1975, doi:10.1093/biomet/62.1.57), here for dynamic models with coloured noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from brightgrey.arrays import Array
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
    refits: int = 6  #: Gauss-Newton steps of a rival that is refitted.
    draws: int = 4  #: Draws of the parameters that powers are averaged over,
    gaps: tuple[float, ...] = (0.0, -0.5, -1.0)  #: and positions in a gap at the begin, in widths.
    negligible: float = 0.01  #: Relative decrease that is not worth another step.
    confusable: float = 0.2  #: Power from which an effect is also told from the other open ones.


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


def remaining(information: Array, gradient: Array, deviance: float, change: Array, jacobian: Array) -> float:
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
    """
    H, g = information + jacobian.T @ jacobian, gradient + jacobian.T @ change
    return max(float(deviance + change @ change - g @ _least_norm(H, g)), 0.0)


def _least_norm(H: Array, g: Array) -> Array:
    """Least-norm solution of H x = g in units of the diagonal."""
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    return np.asarray(np.linalg.pinv(H / np.outer(scale, scale), rcond=1e-12, hermitian=True) @ (g / scale) / scale)


def score(drive: PlannedDrive, torque: Array, *, refit: bool = False, confounders: bool = False) -> Score | None:
    """Score of a torque, shape (samples,); None if a simulation diverges.

    With `refit` the rivals descend to their optima; else they are taken as linear in their parameters. With
    `confounders` an absent effect also has to be told from the other open ones, which may do the same.
    """
    if not np.isfinite(torque).all():
        return None
    jacobians: dict[str, tuple[Array, Array]] = {}
    for known in (drive.known.model, *(q.rival for q in drive.known.questions)):
        if known.structure not in jacobians:
            jacobians[known.structure] = drive.outputs_and_jacobian(known, drive.theta(known), torque)
    if not all(np.isfinite(part).all() for pair in jacobians.values() for part in pair):
        return None
    answers = []
    for q in drive.known.questions:
        truth = drive.truth(q.truth, q.values, torque)
        y, J = jacobians[q.rival.structure]
        found = remaining(np.array(q.rival.information), np.array(q.gradient), q.deviance, y - truth, J)
        if refit:
            found = min(found, _refitted(drive, q, torque, truth)) if found > 0.0 else found
        answer = Answer(q, found, critical(drive, q, torque.size))
        if confounders and answer.power >= POLICY.confusable:
            answer = replace(answer, noncentrality=min(found, _confounded(drive, q, torque, truth)))
        answers.append(answer)
    old, J = np.array(drive.known.model.information), jacobians[drive.known.model.structure][1]
    new = old + J.T @ J
    scale = np.sqrt(np.maximum(np.diag(old), 1e-300))
    grown = [float(np.linalg.slogdet(H / np.outer(scale, scale) + 1e-12 * np.eye(len(H)))[1]) for H in (old, new)]
    return Score(tuple(answers), new, (grown[1] - grown[0]) / max(len(old), 1))


def critical(drive: PlannedDrive, question: Question, samples: int) -> float:
    """Deviance that has to be exceeded after a new recording of so many samples."""
    known = drive.known
    more = samples * len(known.noise)
    material = known.material_growth * (known.deviance + more)
    return max(question.critical, material, known.error_floor * (1.0 + more / known.samples))


def _refitted(drive: PlannedDrive, q: Question, torque: Array, truth: Array) -> float:
    """Sum of squares that remains when the rival is fitted by damped Gauss-Newton steps, its outputs simulated anew."""
    begin = drive.theta(q.rival)
    H0, g0, low, high = np.array(q.rival.information), np.array(q.gradient), *drive.space(q.rival).box
    theta, best = begin, np.inf
    for _ in range(POLICY.refits):
        y, J = drive.outputs_and_jacobian(q.rival, theta, torque)
        e, d = y - truth, theta - begin
        cost = q.deviance + 2.0 * d @ g0 + d @ H0 @ d + e @ e
        if not np.isfinite(cost) or cost > best * (1.0 - POLICY.negligible):
            best = min(best, float(cost)) if np.isfinite(cost) else best
            break
        best = float(cost)
        step = _least_norm(H0 + J.T @ J, g0 + H0 @ d + J.T @ e)
        theta = np.clip(theta - step, low, high)
    return max(best, 0.0)


def _confounded(drive: PlannedDrive, q: Question, torque: Array, truth: Array) -> float:
    """Sum of squares that remains when another open effect takes the part of the one that is asked for."""
    rivals = (_with_effect_of(q, other) for other in drive.known.questions if q.kind == other.kind == "size")
    return min((_refitted(drive, rival, torque, truth) for rival in rivals if rival is not None), default=np.inf)


def _with_effect_of(q: Question, other: Question) -> Question | None:
    """Question whose rival has the effect of another one; None if it is the same, or more than an effect beside it.

    The recordings so far count as saying nothing of that effect.
    """
    base = q.rival
    beside = all(np.isclose(other.values.get(name, np.nan), value, atol=0.0) for name, value in base.values.items())
    if set(other.effects) & set(q.effects) or other.rival.structure != base.structure or not beside:
        return None
    more = tuple(name for name in other.values if name not in base.values)
    wide = np.zeros((len(base.names) + len(more),) * 2)
    wide[: len(base.names), : len(base.names)] = base.information
    known = Known(other.truth, other.values, (*base.names, *more), tuple(map(tuple, wide.tolist())))
    return replace(q, rival=known, gradient=(*q.gradient, *[0.0] * len(more)))


def power_so_far(drive: PlannedDrive, question: Question) -> float:
    """Power of the recordings so far to decide a question."""
    none = np.zeros((0, len(question.gradient)))
    H, g = np.array(question.rival.information), np.array(question.gradient)
    left = remaining(H, g, question.deviance, none[:, :0].sum(axis=1), none)
    return power(left, question.parameters, critical(drive, question, 0))


def mean_powers(drive: PlannedDrive, torque: Array, seed: int) -> list[float]:
    """Power of each question, averaged over draws of the parameters and positions in the gap at the begin.

    In closed loop `torque` is the feed-forward, and each draw is recorded with the torque of its own reaction.
    """
    command = command_of(drive, torque)
    draws = drive.draws(POLICY.draws, np.random.default_rng([seed, 4]))
    found = []
    for k in range(POLICY.draws):
        for gap in POLICY.gaps:
            drawn = drive.with_values({n: float(v[k]) for n, v in draws.items()}, gap)
            one = score(drawn, recorded_torque(drawn, command), refit=True, confounders=True)
            found.append([a.power for a in one.answers] if one else [0.0] * len(drive.known.questions))
    return [float(p) for p in np.mean(found, axis=0)]
