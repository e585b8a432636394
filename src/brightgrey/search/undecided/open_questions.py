"""Open questions of a search: what the recordings left undecided, in numbers that a motion can be designed with.

A question sets a *truth* against a *rival*. The recordings so far enter by their whitened normal equations at the
rival, from which all that belongs to one recording only, as its initial state, is eliminated.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.estimation.problem.simulation_error import predict_many
from brightgrey.kit import Structure
from brightgrey.recordings import Signal
from brightgrey.search.detectability import Detectability, has
from brightgrey.search.fitting.refined_fit import accurate
from brightgrey.search.task import IdentificationTask
from brightgrey.search.undecided.question import UNDECIDED_SCHEMA, Known, OpenQuestions, OutputNoise, Question

__all__ = ["open_questions"]


@dataclass(frozen=True)
class _Policy:
    """Number of questions that are asked."""

    most_structures: int = 3  #: Minimal structures that are set against each other: the best ones.
    most_effects: int = 5  #: Effects beside the best structure; each costs simulations of every motion.


POLICY = _Policy()


def open_questions(
    detectability: Detectability, found: Sequence[Structure], optional: Sequence[str], undecided: Sequence[str]
) -> OpenQuestions:
    """Questions that the recordings leave open.

    Parameters
    ----------
    detectability : Detectability
    found : sequence of Structure
        Minimal structures, the best first.
    optional : sequence of str
        Effects that may be there beside them.
    undecided : sequence of str
        All effects that are *not decidable*.
    """
    d, task = detectability, detectability.refined.task
    best, leading = found[0], found[: POLICY.most_structures]
    asked = [_tied(d, a, b) for a in leading for b in leading if a != b]
    not_asked: dict[str, str] = {}
    for effect in optional:
        if sum(q.kind == "size" for q in asked) >= POLICY.most_effects:
            not_asked[effect] = "other effects come first"
        elif has(best, effect):
            continue
        elif d.with_effect(best, effect) is None:
            not_asked[effect] = "it cannot be added alone"
        elif not d.relevant_sizes(best, effect):
            not_asked[effect] = "it has no least size that matters"
        else:
            asked += _size_questions(d, best, effect)
    covered = {e for q in asked for e in q.effects}
    for effect in undecided:
        if effect not in covered:
            not_asked.setdefault(effect, "the doubt is not about its size; see the report")
    problem, refined = task.problem(best), d.refined.of(best)
    outputs = len(task.recordings[0].outputs)
    noise = zip(problem.weights.tolist(), d.refined.whitening.models[:outputs], strict=True)
    known = _eliminated(d, best, d.refined.jacobian(best)[0])[0]
    spaces = {s: task.space(s, nuisances=True) for s in (best, *map(Structure.parse, {q.truth for q in asked}), *found)}
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
        {
            name: (float(low), float(high))
            for s, space in spaces.items()
            for name, low, high in zip(space.names, space.low, space.high, strict=True)
            if name in s.parameters or name == FRICTION_WIDTH
        },
    )


def _tied(d: Detectability, truth: Structure, rival: Structure) -> Question:
    """Question between two minimal structures, each at its optimum."""
    change = d.refined.jacobian(rival)[0] - d.refined.jacobian(truth)[0]
    effects = [*dict.fromkeys(str(p) for s in (truth, rival) for p in s.placed)]
    differ = tuple(e for e in effects if has(truth, e) != has(rival, e))
    return _question_of(d, "tied", differ, truth, d.refined.of(truth).values, rival, change)


def _size_questions(d: Detectability, structure: Structure, effect: str) -> Iterator[Question]:
    """Questions between the absence of an effect beside a structure and its least sizes that matter."""
    big, task = d.with_effect(structure, effect), d.refined.task
    assert big is not None
    residual = d.refined.jacobian(structure)[0]
    problem = task.problem(big)
    start = {part.name: part.start for part in problem.nuisances}
    for size in d.relevant_sizes(structure, effect):
        values = {**start, **task.default_start(big), **d.refined.of(structure).values, **size}
        names = (*big.parameters, *start)
        moved = problem.residuals({n: np.array([values[n]]) for n in names}, accurate(task).settings)[:, 0]
        yield _question_of(d, "size", (effect,), big, values, structure, residual - moved)


def _question_of(
    d: Detectability,
    kind: str,
    effects: tuple[str, ...],
    truth: Structure,
    values: Mapping[str, float],
    rival: Structure,
    change: Array,
) -> Question:
    known, gradient, deviance = _eliminated(d, rival, change)
    # to be refuted, the rival has to exceed what all effects of the function set explain by chance
    more = max(d.circumstances.most_free - d.refined.of(rival).free, 1)
    own = {n: float(v) for n, v in values.items() if n in truth.parameters or n == FRICTION_WIDTH}
    return Question(effects, kind, str(truth), own, known, tuple(gradient.tolist()), deviance, more, d.chance(more))


def _eliminated(d: Detectability, rival: Structure, change: Array) -> tuple[Known, Array, float]:
    """Normal equations of the rival, gradient and sum of squares of a change, without what is each recording's own."""
    space = d.refined.task.space(rival, nuisances=True)
    J, c = d.refined.whitening.whiten(d.refined.jacobian(rival)[1]), d.refined.whitening.whiten(change)
    H, g, own = J.T @ J, J.T @ c, np.array([n in rival.parameters or n == FRICTION_WIDTH for n in space.names], bool)
    inverse = np.linalg.pinv(H[np.ix_(~own, ~own)], rcond=1e-12, hermitian=True)
    through = H[np.ix_(own, ~own)] @ inverse
    information = H[np.ix_(own, own)] - through @ H[np.ix_(~own, own)]
    values = d.refined.of(rival).values
    known = Known(
        str(rival),
        {n: float(v) for n, v in values.items() if n in rival.parameters or n == FRICTION_WIDTH},
        tuple(n for n, o in zip(space.names, own, strict=True) if o),
        tuple(map(tuple, information.tolist())),
    )
    return known, g[own] - through @ g[~own], float(max(c @ c - g[~own] @ inverse @ g[~own], 0.0))


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
