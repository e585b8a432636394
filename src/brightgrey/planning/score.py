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
from brightgrey.planning.rivals import refitted, refitted_from_torques, remaining, scales_with
from brightgrey.search.detectability import power
from brightgrey.search.undecided.question import Known, Question

__all__ = ["Answer", "Score", "mean_powers", "power_so_far", "score"]


@dataclass(frozen=True)
class _Policy:
    """Numbers of the score."""

    enough: float = 1.3  #: Multiple of the critical deviance beyond which more noncentrality is worth little.
    information_share: float = 0.02  #: Weight of the parameters' information: it decides among equals.
    draws: int = 4  #: Draws of the parameters that powers are averaged over,
    gaps: tuple[float, ...] = (0.0, -0.5, -1.0)  #: and positions in a gap at the begin, in widths.
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
    answers, scales = [], scales_with(drive, torque)
    for k, (q, truth) in enumerate(zip(drive.asked, drive.truths(drive.asked, torque), strict=True)):
        y, J = jacobians[_key(q.rival)]
        H, g = np.array(q.rival.information), np.array(q.gradient)
        found = remaining(H, g, q.deviance, y - truth, J, drive.steps_to_bounds(q.rival, scales))
        if refit:
            found = min(found, refitted(drive, q, torque, truth, scales)) if found > 0.0 else found
        answer = Answer(q, found, critical(drive, q, torque.size))
        if refit and answer.power >= POLICY.confusable:
            left = [refitted(drive, wide, torque, truth, scales) for wide in drive.against_largest[k]]
            answer = replace(answer, noncentrality=min([answer.noncentrality, *left]))
        if refit and answer.power >= POLICY.confusable:
            rivals = (q, *drive.against_largest[k])
            left = [refitted_from_torques(drive, rival, torque, truth, scales) for rival in rivals]
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


def power_so_far(drive: PlannedDrive, question: Question) -> float:
    """Power of the recordings so far to decide a question."""
    found = []
    for q in (truth_between(question, share_that_matters(question, part)) for part in _shares()):
        none, H, g = np.zeros((0, len(q.gradient))), np.array(q.rival.information), np.array(q.gradient)
        left = remaining(H, g, q.deviance, np.zeros(0), none, drive.steps_to_bounds(q.rival, drive.known.scales))
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
