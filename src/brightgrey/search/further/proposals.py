"""Further effects: which of those that a grammar holds back are worth a fit, by scores at the fits so far.

A large function set is out of reach of one fit of everything. So a search begins with a small one. Where that leaves
model error, each further effect is simulated once, at the least size that matters, beside a structure that lacks it.
What its change shares with the residual, beyond what the structure's own parameters explain, is its score
(Rao 1948, doi:10.1017/S0305004100023987).

First-order changes say little of an effect that moves a resonance, as any spring does: the structure without it has
fitted another frequency. They say as little of a load that turns with the position many times. Such effects are fitted
beside the structure by multistart.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from brightgrey.arrays import Array, positive
from brightgrey.estimation.diagnostics.options import DIAGNOSTIC_DEFAULTS
from brightgrey.estimation.diagnostics.residual_tests import Candidate, detect_regressors
from brightgrey.estimation.noise.orthonormal_basis import beyond, orthonormal_basis
from brightgrey.estimation.optimisation.torque_regression import with_waves
from brightgrey.kit import Placed, Structure, function_set
from brightgrey.search.criteria import bic
from brightgrey.search.fitting.refined_fit import Refined, accurate, residual_and_jacobian
from brightgrey.search.fitting.structure_fit import Options, StructureFit, fit_multistart
from brightgrey.search.parallel import in_order, simultaneous
from brightgrey.search.policy import FURTHER
from brightgrey.search.task import IdentificationTask

__all__ = [
    "FURTHER_STARTS",
    "EffectChanges",
    "FurtherEffect",
    "added_with",
    "as_limiting_cases",
    "by_score",
    "changes_beside",
    "effects_by_multistart",
    "explains_more_in_place",
    "fit_below",
    "follows_further_effect",
    "further_effects",
    "is_bent",
    "is_spring",
    "joint_step",
    "least_rival_cost",
    "limiting_cases",
    "limiting_cases_within",
    "moved_effects",
]


FURTHER_STARTS = Options(fresh=2, patience=0)


@dataclass(frozen=True)
class EffectChanges:
    """A further effect beside a structure, with the changes of the residuals that it makes at several values."""

    placed: Placed
    added: tuple[Placed, ...]  #: It, and what it requires and the structure lacks.
    values: Mapping[str, Array]  #: Of their parameters by name, SI, shape (draws,).
    size: str  #: Its parameter at whose zero it vanishes.
    changes: Array  #: Shape (residuals, draws).
    either_sign: bool


@dataclass(frozen=True)
class FurtherEffect:
    """A further effect that may explain a part of a residual."""

    placed: Placed
    added: tuple[Placed, ...]  #: It, and what it requires and the structure lacks.
    #: Their parameters by name, SI, as far as a first step says, and all of the structure if it was fitted with them.
    start: Mapping[str, float]


def further_effects(
    task: IdentificationTask, fitted: StructureFit, more: Sequence[Placed], seed: int
) -> tuple[FurtherEffect, ...]:
    """Effects of `more` that share most with the residual of a fit, the largest score first.

    The residual is taken as it is. Beside a structure that misfits badly, its own misfit would pass for slow noise.

    Parameters
    ----------
    task : IdentificationTask
    fitted : StructureFit
        At its least sum of squared residuals.
    more : sequence of Placed
        Effects that it may lack.
    seed : int
        Of the values that are drawn for effects of several parameters.
    """
    task = accurate(task)
    residual, jacobian, inside = residual_and_jacobian(task, fitted.structure, fitted.values)
    basis = orthonormal_basis(jacobian[:, list(inside)])
    left = beyond(basis, residual)
    changes = changes_beside(task, fitted, residual, more, seed)
    scored = by_score([replace(c, changes=beyond(basis, c.changes)) for c in changes], left)
    return tuple(found for _, found in scored[: FURTHER.side_by_side])


def moved_effects(
    task: IdentificationTask, fitted: StructureFit | Refined, more: Sequence[Placed]
) -> tuple[FurtherEffect, ...]:
    """Dry friction of `more` that a structure has at another mass, each in the place of that one.

    The one that is there has taken the part of the other, and no first step leads from one to the other: a mass sticks.

    Parameters
    ----------
    task : IdentificationTask
    fitted : StructureFit or Refined
    more : sequence of Placed
        Effects that it may lack.
    """
    space, found = task.space(fitted.structure), list[FurtherEffect]()
    least = dict(zip(space.names, space.low.tolist(), strict=True))
    for placed in _possible(fitted, more):
        for own in (p for p in fitted.structure.placed if p.name == placed.name and p.effect.is_dry_friction):
            start = {placed.parameter(q.symbol): fitted.values[own.parameter(q.symbol)] for q in own.effect.parameters}
            sizes = [own.parameter(q.symbol) for q in own.effect.parameters if q.size]
            gone = {name: max(least[name], 0.0) for name in sizes if name in least}
            if len(gone) == len(sizes):  # what is fixed cannot vanish
                found.append(FurtherEffect(placed, added_with(placed, fitted.structure), {**start, **gone}))
    return tuple(found)


def limiting_cases(
    own: StructureFit | Refined, gone: Placed, allowed: Collection[Placed]
) -> dict[Placed, dict[str, float]]:
    """Effects of some that one comes to for some values, with the sizes that they take over from it, SI.

    Those that the structure has already grow by what is taken over.
    """
    of_gone, found = {q.symbol: own.values[gone.parameter(q.symbol)] for q in gone.effect.parameters}, {}
    for case in gone.effect.limiting_cases:
        placed = Placed(case.effect, gone.place)
        if placed in allowed:
            sizes = {placed.parameter(symbol): size for symbol, size in case.values(of_gone).items()}
            there = own.values if placed in own.structure.placed else dict.fromkeys(sizes, 0.0)
            found[placed] = {name: there[name] + size for name, size in sizes.items()}
    return found


def limiting_cases_within(some: Iterable[Placed]) -> set[str]:
    """Names of the effects that are limiting cases of some others."""
    return {case.effect for p in some for case in p.effect.limiting_cases}


def as_limiting_cases(
    own: StructureFit, larger: StructureFit, more: Sequence[Placed]
) -> list[tuple[Structure, dict[str, float]]]:
    """Structures with the limiting cases of what a larger one has beyond another in its place, with values, SI.

    A pendulum on a short way is a spring to the ground. A fit of that from elsewhere may not have seen it.

    Parameters
    ----------
    own : StructureFit
        Of the structure without.
    larger : StructureFit
    more : sequence of Placed
        Effects that `own` may lack.
    """
    found, there = list[tuple[Structure, dict[str, float]]](), own.structure.placed
    for gone in (p for p in larger.structure.placed if p not in there):
        cases = limiting_cases(larger, gone, (*there, *more))
        structure = Structure((*there, *(p for p in cases if p not in there)))
        if structure != own.structure and not function_set().broken_rule(structure):
            sizes = {name: size for taken in cases.values() for name, size in taken.items()}
            found.append((structure, {**larger.values, **sizes}))
    return found


def by_score(changes: Sequence[EffectChanges], left: Array) -> list[tuple[float, FurtherEffect]]:
    """Effects that share something with a residual, each with its score, the largest first.

    Parameters
    ----------
    changes : sequence of EffectChanges
        Beyond what the parameters of a structure explain.
    left : ndarray, shape (residuals,)
        The residual, beyond the same.
    """
    scored = [(scores, c) for c in changes if (scores := _scores(c, left)).max() > 0.0]
    scored.sort(key=lambda pair: -float(pair[0].max()))
    return [(float(scores.max()), _start(c, left, int(np.argmax(scores)))) for scores, c in scored]


def joint_step(changes: Sequence[EffectChanges], left: Array) -> tuple[Array, list[FurtherEffect]]:
    """Residual that several effects at once would leave, and these effects, the largest change first.

    Each has those of its values whose change shares most with the residual. The sizes leave the least sum of squares,
    and many of those that cannot be negative are zero then (Lawson and Hanson 1974, doi:10.1137/1.9781611971217).

    Parameters
    ----------
    changes : sequence of EffectChanges
        Beyond what the parameters of a structure explain. A size that has both signs counts as two.
    left : ndarray, shape (residuals,)
        The residual, beyond the same.
    """
    from scipy.optimize import nnls  # slow to import, and only a search needs it

    draws = [(c, int(np.argmax(_scores(c, left) * (c.either_sign | (left @ c.changes < 0.0))))) for c in changes]
    signed = [(c, draw, sign) for c, draw in draws for sign in (1.0, -1.0)[: 1 + c.either_sign]]
    columns = np.column_stack([np.zeros_like(left), *(sign * c.changes[:, draw] for c, draw, sign in signed)])
    length = np.linalg.norm(columns, axis=0)
    found, _ = nnls(columns / np.where(length > 0.0, length, 1.0), -left)
    taken = [i for i in np.argsort(-found, kind="stable") if found[i] > 0.0]
    effects = [(signed[i - 1], found[i] / length[i]) for i in taken]
    return (
        left + columns[:, taken] @ (found[taken] / length[taken]),
        [_of_size(c, draw, sign * float(size)) for (c, draw, sign), size in effects],
    )


def is_bent(placed: Placed) -> bool:
    """True if a torque is no straight line over the twist of a shaft or a position: descents end at local optima."""
    return placed.effect.detunes_resonances or placed.effect.may_be_unstable


def is_spring(placed: Placed) -> bool:
    """True if a torque depends on a position or is bent over a twist: it moves resonances, or makes a new one."""
    return is_bent(placed) or placed.effect.port_reads == "position"


def fit_below(
    task: IdentificationTask, structure: Structure, cost: float, seed: int, options: Options = FURTHER_STARTS
) -> StructureFit:
    """Fit by multistart of a structure that is of use only below a cost: elsewhere no descent is brought to its end."""
    return fit_multistart(task, structure, options, seed, cost_to_beat=cost)


def effects_by_multistart(
    task: IdentificationTask, fitted: StructureFit, some: Sequence[Placed], seed: int, workers: Executor
) -> tuple[FurtherEffect, ...]:
    """Effects that explain a notable part, each fitted by multistart; the best by BIC first."""
    tried = _possible(fitted, some)
    enough = (1.0 - FURTHER.notable_gain) * fitted.cost
    fits = in_order(workers, fit_below, [(task, _with(fitted, p), enough, seed) for p in tried])
    notable = [(p, f) for p, f in zip(tried, fits, strict=True) if f.cost <= enough < np.inf]
    samples = sum(r.y.size for r in task.recordings)
    notable.sort(key=lambda pair: bic(positive(pair[1].cost), samples, pair[1].free))
    return tuple(FurtherEffect(p, added_with(p, fitted.structure), f.values) for p, f in notable)


def least_rival_cost(found: Sequence[Placed], done: Mapping[Structure, StructureFit]) -> float:
    """Least cost of all fits of structures with an effect that one of `found` excludes; infinite without any.

    Where a hardening spring and a gap compete for a shaft, the gap has every other effect beside it, and so the
    benefit of doubt.
    """
    excluded = [f.cost for s, f in done.items() if any(e.excludes(p) for e in found for p in s.placed)]
    return min(excluded, default=float("inf"))


def follows_further_effect(task: IdentificationTask, fitted: StructureFit, more: Sequence[Placed], seed: int) -> bool:
    """True if the residual of a fit follows a further effect by more than noise of its colour explains.

    This asks whether there is anything to offer, where the residual of the best structure is all that speaks of noise.
    """
    task = accurate(task)
    residual, jacobian, inside = residual_and_jacobian(task, fitted.structure, fitted.values)
    candidates = [
        Candidate(partial(np.reshape, change, (-1, 1)), str(c.placed))
        for c in changes_beside(task, fitted, residual, more, seed)
        for change in c.changes.T
        if change.any()
    ]
    lengths = task.problem(fitted.structure).segment_lengths
    level = DIAGNOSTIC_DEFAULTS.symptom_level
    found = detect_regressors(residual, jacobian[:, list(inside)], lengths, candidates, level) if candidates else []
    return any(f.share >= FURTHER.notable_gain for f in found)


def explains_more_in_place(
    task: IdentificationTask, fitted: StructureFit, more: Sequence[Placed], seed: int, workers: Executor
) -> bool:
    """True if an effect that detunes resonances explains more in the place of one that it excludes, by multistart."""
    enough = (1.0 - FURTHER.notable_gain) * fitted.cost
    calls = []
    for placed in (p for p in more if p.effect.detunes_resonances):
        others = tuple(p for p in fitted.structure.placed if not placed.excludes(p))
        if len(others) < len(fitted.structure.placed):
            calls.append((task, Structure((*others, placed)), enough, seed))
    return any(instead.cost <= enough for instead in in_order(workers, fit_below, calls))


def changes_beside(
    task: IdentificationTask, fitted: StructureFit | Refined, residual: Array, more: Sequence[Placed], seed: int
) -> list[EffectChanges]:
    """Changes of the weighted `residual` of a fit by the effects of `more` that it lacks and may have, each alone."""
    return simultaneous([partial(_changes, task, fitted, residual, p, seed) for p in _possible(fitted, more)])


def added_with(placed: Placed, structure: Structure) -> tuple[Placed, ...]:
    """An effect, after what it requires and a structure lacks."""
    required = (Placed(name, placed.place) for name in placed.effect.requires)
    return (*(p for p in required if p not in structure.placed), placed)


def _with(fitted: StructureFit | Refined, placed: Placed) -> Structure:
    return Structure((*fitted.structure.placed, *added_with(placed, fitted.structure)))


def _possible(fitted: StructureFit | Refined, more: Sequence[Placed]) -> list[Placed]:
    """The effects of `more` that a structure lacks and may have."""
    kit = function_set()
    return [p for p in more if p not in fitted.structure.placed and not kit.broken_rule(_with(fitted, p))]


def _changes(
    task: IdentificationTask, fitted: StructureFit | Refined, residual: Array, placed: Placed, seed: int
) -> EffectChanges:
    """Changes of the residuals by an effect of the size that matters."""
    problem, space = task.problem_and_space(_with(fitted, placed))
    base = {**dict(zip(space.names, space.start.tolist(), strict=True)), **space.fixed, **fitted.values}
    size = placed.relevant_size(task.scales, fitted.values)
    (vanishing,) = (q for q in placed.effect.parameters if q.size)
    name, added = placed.parameter(vanishing.symbol), added_with(placed, fitted.structure)
    names = [p.parameter(q.symbol) for p in added for q in p.effect.parameters]
    others = [n for n in names if n in space.names and n != name]
    count = 1 + (FURTHER.draws if others else 0)
    values = {n: np.full(count, size.get(n, value)) for n, value in base.items()}
    drawn = space.sample(count, np.random.default_rng(seed))
    if placed.effect.search.wave:  # many periods are met by half of the draws, few by the other
        half = (1 + count) // 2
        drawn[:, half:] = with_waves(problem, space, task.settings, drawn[:, half:])
    for n in others:
        values[n][1:] = drawn[space.names.index(n), 1:]
    moved = problem.residuals(values, task.settings)
    return EffectChanges(
        placed,
        added,
        {n: values[n] for n in names},
        name,
        np.asarray(moved - residual[:, None]),
        (task.bounds.get(name) or vanishing.bounds(task.scales))[0] < 0.0,
    )


def _start(candidate: EffectChanges, left: Array, draw: int) -> FurtherEffect:
    """The effect with the values of a draw: of the size that a first-order step gives, or of the size that matters.

    A first-order step may have the wrong sign where the structure without the effect has fitted something else.
    """
    change = candidate.changes[:, draw]
    step = -float(left @ change) / float(change @ change)
    return _of_size(candidate, draw, step if candidate.either_sign or step > 0.0 else 1.0)


def _of_size(candidate: EffectChanges, draw: int, step: float) -> FurtherEffect:
    """The effect with the values of a draw, and so many times its size that matters."""
    start = {name: float(values[draw]) for name, values in candidate.values.items()}
    start[candidate.size] *= step
    return FurtherEffect(candidate.placed, candidate.added, start)


def _scores(candidate: EffectChanges, left: Array) -> Array:
    """Decrease of the sum of squares by a step along each change, shape (draws,)."""
    along = left @ candidate.changes
    length = np.square(candidate.changes).sum(axis=0)
    return np.asarray(np.divide(np.square(along), length, out=np.zeros_like(length), where=length > 0.0))
