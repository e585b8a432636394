"""Open questions of a search: what the recordings left undecided, in numbers that a motion can be designed with.

A question sets a *truth* against a *rival*. The recordings so far enter by their whitened normal equations at the
rival, from which all that belongs to one recording only, as its initial state, is eliminated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Parameter
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.estimation.problem.simulation_error import predict_many
from brightgrey.kit import Placed, Structure
from brightgrey.recordings import Signal
from brightgrey.search.detectability import Detectability, relevant_sizes
from brightgrey.search.fitting.refined_fit import Refined, refine, residual_and_jacobian
from brightgrey.search.lattice import contains, has
from brightgrey.search.parallel import simultaneous
from brightgrey.search.task import IdentificationTask
from brightgrey.search.undecided.largest_rivals import LargestRivals
from brightgrey.search.undecided.past_recordings import eliminated, of_the_drive
from brightgrey.search.undecided.question import UNDECIDED_SCHEMA, Known, OpenQuestions, OutputNoise, Question

__all__ = ["open_questions"]


@dataclass(frozen=True)
class _Policy:
    """Questions that are asked."""

    most_structures: int = 3  #: Minimal structures that are set against each other: the best ones.
    most_effects: int = 5  #: Effects beside the best structure; each costs simulations of every motion.
    far: float = 4.0  #: Multiple of a size from which it is a truth of its own.


POLICY = _Policy()


def open_questions(
    detectability: Detectability, found: Sequence[Structure], optional: Sequence[str], undecided: Sequence[str]
) -> OpenQuestions:
    """Questions that the recordings leave open.

    Parameters
    ----------
    detectability : Detectability
    found : sequence of Structure
        The model that is handed back and minimal structures, the best first. No rival contains the truth.
    optional : sequence of str
        Effects that may be there beside them.
    undecided : sequence of str
        All effects that are *not decidable*.
    """
    d, task = detectability, detectability.refined.task
    best, pairs = found[0], permutations(found[: POLICY.most_structures], 2)
    tied = [(truth, rival) for truth, rival in pairs if not contains(rival, truth)]  # or nothing could refute the rival
    larger, not_asked = _effects_beside(d, best, optional)
    largest = LargestRivals(d)
    largest.fit([*tied, *((big, best) for big in larger.values())])
    asked = [_tied(largest, a, b) for a, b in tied]
    sizes = [partial(_size_questions, largest, best, big, effect) for effect, big in larger.items()]
    asked += [question for of_effect in simultaneous(sizes) for question in of_effect]
    covered = {e for q in asked for e in q.effects}
    for effect in undecided:
        if effect not in covered:
            not_asked.setdefault(effect, "the doubt is not about its size; see the report")
    problem, refined = task.problem(best), d.refined.of(best)
    outputs = len(task.recordings[0].outputs)
    noise = zip(problem.weights.tolist(), d.refined.whitening.models[:outputs], strict=True)
    known = _known_of(d, best, d.refined.jacobian(best)[0])[0]
    return OpenQuestions(
        UNDECIDED_SCHEMA,
        task.recordings[0].dt,
        problem.samples,
        refined.deviance,
        d.circumstances.material_growth,
        d.circumstances.error_floor,
        tuple(OutputNoise(weight, tuple(m.a), m.variance) for weight, m in noise),
        known,
        tuple(asked),
        not_asked,
        _reached(task, best, refined.values),
        task.scales,
        dict(task.bounds),
    )


def _effects_beside(
    d: Detectability, best: Structure, optional: Sequence[str]
) -> tuple[dict[str, Structure], dict[str, str]]:
    """Effects that may be there beside the best structure, with the structure that has them, and why others do not."""
    larger: dict[str, Structure] = {}
    not_asked: dict[str, str] = {}
    for effect in optional:
        if len(larger) >= POLICY.most_effects:
            not_asked[effect] = "other effects come first"
        elif has(best, effect):
            continue
        elif not d.can_be_added(best, effect):
            not_asked[effect] = "it cannot be added alone"
        elif not d.relevant_sizes(best, effect):
            not_asked[effect] = "it has no least size that matters"
        else:
            larger[effect] = d.with_effect(best, effect)
    return larger, not_asked


def _tied(largest: LargestRivals, truth: Structure, rival: Structure) -> Question:
    """Question between two minimal structures, each at its optimum."""
    refined = largest.detectability.refined
    change = refined.jacobian(rival)[0] - refined.jacobian(truth)[0]
    effects = [*dict.fromkeys(str(p) for s in (truth, rival) for p in s.placed)]
    differ = tuple(e for e in effects if has(truth, e) != has(rival, e))
    values = refined.of(truth).values
    question = _question_of(largest, "tied", differ, truth, values, rival, change)
    return replace(question, least_share=_least_share(refined.task, truth, values, rival))


def _least_share(task: IdentificationTask, truth: Structure, values: Mapping[str, float], rival: Structure) -> float:
    """Part of the effects that only the truth has at which each of them has the least size that matters.

    A lag counts from one sample on: a shorter one is never called needed.
    """
    shares = [0.0]
    for placed in truth.placed:
        if not has(rival, str(placed)) and not placed.effect.masses:
            for size in relevant_sizes(task, values, str(placed)):
                for name, parameter in _sizes_of(str(placed)).items():
                    least = max(abs(size.get(name, 0.0)), task.scales.interval if parameter.lag else 0.0)
                    shares.append(min(least / max(abs(values[name]), 1e-300), 1.0))
    return max(shares)


def _size_questions(largest: LargestRivals, structure: Structure, big: Structure, effect: str) -> list[Question]:
    """Questions between the absence of an effect beside a structure and its sizes that matter.

    These are the least ones and, where it is far larger, the largest that the recordings do not contradict. All else is
    fitted anew beside each: a truth that the recordings contradict would promise too much. Where Coulomb friction and
    gravity cancel, a truth has more of both.
    """
    d, found = largest.detectability, list[Question]()
    for size in d.relevant_sizes(structure, effect):
        held = _HeldSize(d, structure, big, size)
        for multiple, values in held.ends(effect):
            change = d.refined.jacobian(structure)[0] - residual_and_jacobian(held.task(multiple), big, values)[0]
            found.append(_question_of(largest, "size", (effect,), big, values, structure, change))
    return found


@dataclass(frozen=True)
class _HeldSize:
    """An effect that is held at multiples of a size beside a structure, with all else fitted anew."""

    detectability: Detectability
    structure: Structure
    big: Structure
    size: Mapping[str, float]

    def task(self, multiple: float) -> IdentificationTask:
        """The task with the effect's own parameters fixed."""
        task = self.detectability.refined.task
        own = {n: v for n, v in self.at(multiple).items() if n not in self.structure.parameters}
        return replace(task, fixed={**task.fixed, **own})

    def at(self, multiple: float) -> dict[str, float]:
        """Parameters of the effect, those that are its size multiplied."""
        sizes = {n for p in self.big.placed for n in _sizes_of(str(p))}
        return {n: multiple * v if n in sizes else v for n, v in self.size.items()}

    def fitted(self, multiple: float, values: Mapping[str, float]) -> Refined:
        """Fit of all else, from some values.

        Where the structure has no friction, the width of its reversal begins as in a search, smooth: from a bound no
        step leads inwards.
        """
        refined = self.detectability.refined
        own = refined.of(self.structure).values
        begin = {**refined.task.default_start(self.big), **own, **values}
        if FRICTION_WIDTH not in own:
            begin.pop(FRICTION_WIDTH, None)
        return refine(self.task(multiple), self.big, {**begin, **self.at(multiple)}, refined.whitening, np.inf)

    def ends(self, effect: str) -> list[tuple[float, Mapping[str, float]]]:
        """The size itself, and the largest multiple that the recordings do not contradict if it is far from that.

        The multiple is doubled from 1, within the bounds of the effect. Each comes with the fit of all else.
        """
        d, found = self.detectability, [(1.0, self.fitted(1.0, {}).values)]
        worst = d.refined.of(self.structure).deviance + d.circumstances.by_chance()
        task, sizes = d.refined.task, _sizes_of(effect)
        while sizes:
            multiple = 2.0 * found[-1][0]
            tried = self.at(multiple)
            bounds = {n: task.bounds.get(n) or q.bounds(task.scales) for n, q in sizes.items() if n in tried}
            if any(n in task.fixed or not low <= tried[n] <= high for n, (low, high) in bounds.items()):
                break
            fitted = self.fitted(multiple, found[-1][1])
            if fitted.deviance > worst:
                break
            found.append((multiple, fitted.values))
        return [found[0], found[-1]] if found[-1][0] >= POLICY.far else found[:1]


def _sizes_of(effect: str) -> dict[str, Parameter]:
    """Parameters that are the size of an effect, by name."""
    placed = Placed.parse(effect)
    return {placed.parameter(q.symbol): q for q in placed.effect.parameters if q.size}


def _question_of(
    largest: LargestRivals,
    kind: str,
    effects: tuple[str, ...],
    truth: Structure,
    values: Mapping[str, float],
    rival: Structure,
    change: Array,
) -> Question:
    d = largest.detectability
    known, gradient, deviance = _known_of(d, rival, change)
    # to be refuted, the rival has to exceed what the largest structure with as many masses explains by chance
    most = max(d.circumstances.most_free)
    free, masses = d.refined.of(rival).free, min(max(truth.masses, rival.masses), most)
    own = of_the_drive(truth, values)
    return Question(
        effects,
        kind,
        str(truth),
        own,
        known,
        tuple(gradient.tolist()),
        deviance,
        max(d.circumstances.most_free[masses] - free, 1),
        d.circumstances.chance_beyond(free, rival.masses, masses),
        largest=tuple(largest.of(truth, rival, change)),
    )


def _known_of(d: Detectability, rival: Structure, change: Array) -> tuple[Known, Array, float]:
    """Normal equations of the rival, and gradient and sum of squares of a change."""
    jacobian, values = d.refined.jacobian(rival)[1], d.refined.of(rival).values
    known, gradients, products = eliminated(d.refined, rival, values, jacobian, change[:, None])
    return known, gradients[0], max(float(products[0, 0]), 0.0)


def _reached(task: IdentificationTask, structure: Structure, values: Mapping[str, float]) -> dict[str, float]:
    """Largest torque, speed, acceleration and jerk, RMS torque, travel and duration of the recordings, SI.

    The motion is that of the simulated first mass: a measured one would have to be differentiated.
    """
    found: dict[str, float] = {}
    arrays = {n: np.array([v]) for n, v in values.items()}
    for r, state in zip(task.recordings, task.problem(structure).initial_states, strict=True):
        outputs = (Signal("q", "position", r.units.motion), Signal("v", "velocity", f"{r.units.motion}/s"))
        whole = replace(r, y=np.zeros((2, r.samples)), outputs=outputs, resolution=np.ones(2))
        q, v = predict_many(structure, arrays, whole, task.settings, initial_state=state)[:, :, 0]
        slope = np.abs(np.diff(r.u)).max(initial=0.0) / r.dt
        one = {
            "torque": np.abs(r.u).max(),
            "rms_torque": np.sqrt(np.mean(r.u**2)),
            "speed": np.abs(v).max(),
            "acceleration": np.abs(np.diff(v)).max(initial=0.0) / r.dt,
            "jerk": slope / task.scales.inertia,
            "travel": np.ptp(q),
            "duration": r.samples * r.dt,
        }
        found = {name: max(float(value), found.get(name, 0.0)) for name, value in one.items()}
    return found
