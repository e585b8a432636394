"""One structure at a time: from everywhere, from the optima of relatives, or from where a larger one did better."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.least_squares import Optimum, fit_many, polish
from brightgrey.estimation.optimisation.multistart import growing_horizons, multistart
from brightgrey.estimation.optimisation.options import MULTISTART_DEFAULTS
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.kit import Structure
from brightgrey.search.fitting.warm_start import handed_down, information
from brightgrey.search.lattice import added_effects, mass_chain_of
from brightgrey.search.policy import REFIT
from brightgrey.search.task import FAST_LEVEL_ACCURACY, IdentificationTask

__all__ = [
    "Options",
    "StructureFit",
    "best_parents",
    "best_starts",
    "continue_from_supermodel",
    "fit_from_neighbours",
    "fit_multistart",
    "last_descent",
    "not_worse_than_submodels",
    "ranges_within_decade",
    "refit_from_supermodel",
]


@dataclass(frozen=True)
class Options:
    """Effort of the fit of one structure."""

    parents: int = 2  #: Simpler structures whose optima are looked at, beside those of the hubs.
    starts: int = 2  #: Descents: from the best of these optima.
    #: Starts of a field and fields without improvement, in the search for a hub.
    fresh: int = 8
    patience: int = 1
    fresh_hard_limit: int | None = None  #: Starts of a field with a hard limit, which cost more; as many by default.
    #: Starts of a field where all ranges of positive parameters are within a decade, as those that a user gives.
    narrow: int = 8
    drawn: int = 15  #: Values of the further effect that are tried at each of these optima.
    rounds: int = 25  #: Of each descent.
    tolerance: float = 1e-3  #: Relative to the cost.


@dataclass(frozen=True)
class StructureFit:
    """One structure with its best parameters so far."""

    structure: Structure
    #: SI, those that were estimated first, with unknown parts of initial states; then the fixed ones.
    values: Mapping[str, float]
    cost: float  #: Weighted sum of squared residuals at the level of the search.
    free: int  #: Number of estimated parameters.
    #: Redundant effects: without them the structure fits better, and their values are meaningless.
    redundant_effects: tuple[str, ...] = ()
    batches: int = 0  #: Batches of simulations.
    spent: SimulationCount = field(default_factory=SimulationCount)  #: What the latest fit has simulated.
    #: J' J by the estimated values, SI, shape (free, free).
    information: Array | None = field(default=None, compare=False)
    #: The structure without these effects, whose fit this one is; None if there are none.
    equals: Structure | None = None
    agreeing: int = 0  #: Independent starts of a multistart that have ended there.


def best_parents(parents: Sequence[StructureFit], options: Options) -> list[StructureFit]:
    """Those of `parents` that are looked at."""
    return sorted(parents, key=lambda p: p.cost)[: options.parents]


def refit_from_supermodel(
    task: IdentificationTask,
    own: StructureFit,
    larger: Sequence[StructureFit],
    options: Options,
    anyway: bool = False,
    growing: bool = False,
) -> tuple[StructureFit | None, SimulationCount]:
    """Descend once more from where `larger` structures did better; None if it is no better there, but for `anyway`.

    And what that took. A structure that may be unstable descends on `growing` beginnings, too, if asked for.
    """
    problem, space = task.problem_and_space(own.structure)
    values = _given(space, own.structure, larger)
    if not values:
        return None, SimulationCount()
    values += [grown for known in values for grown in _grown(task, space, own.structure, known)]
    begins = np.array([[known[name] for name in space.names] for known in values]).T
    begins = np.clip(begins, space.low[:, None], space.high[:, None])
    cost = problem.costs(space.named(begins), task.settings)
    if not (anyway or cost.min() < REFIT.improved * own.cost):
        return None, problem.count(cost.size)
    joined = any(f.structure.masses > own.structure.masses for f in larger)
    chosen = begins[:, _best_chains(space, own.structure, begins, cost, options.starts if joined else 1)]
    starts, spent, batches = chosen, SimulationCount(), own.batches
    if growing and own.structure.may_be_unstable:
        grown, spent, more = _grown_beginnings(task, problem, space, chosen, options)
        starts, batches = np.hstack([chosen, grown]), batches + more
    ends = fit_many(
        problem, space, task.settings, starts, limit=options.rounds, tolerance=options.tolerance, cost_to_beat=own.cost
    )
    end = min(ends, key=lambda e: e.cost)
    spent += problem.count(cost.size + sum(e.simulations for e in ends))
    return _fitted(own.structure, space, end, batches + 1 + end.evaluations, spent), spent


def _grown_beginnings(
    task: IdentificationTask, problem: SimulationErrorProblem, space: ParameterSpace, starts: Array, options: Options
) -> tuple[Array, SimulationCount, int]:
    """Starts, shape (P, S), after descents on growing beginnings; what these took, and in how many batches.

    Over many periods of a load of the position the least change of its place or another parameter makes another motion
    in the end, and the valley of the cost is narrow.
    """
    spent, batches = SimulationCount(), 0
    for share in growing_horizons(MULTISTART_DEFAULTS.first_share):
        part, first = problem.truncated(share), share == MULTISTART_DEFAULTS.first_share
        limit = options.rounds if first else MULTISTART_DEFAULTS.stage_rounds
        ends = fit_many(part, space, task.settings, starts, limit=limit, tolerance=options.tolerance)
        starts = np.stack([e.values for e in ends], axis=1)
        spent += part.count(sum(e.simulations for e in ends))
        batches += max(e.evaluations for e in ends)
    return starts, spent, batches


def continue_from_supermodel(
    task: IdentificationTask, own: StructureFit, larger: StructureFit, options: Options
) -> tuple[StructureFit | None, SimulationCount]:
    """Descend from where a `larger` structure did better, on growing beginnings of the recordings.

    With limits the least change of a parameter makes another motion in the end. So the optimum of a structure that
    could do without an effect may not be seen from that of one that has it. On a beginning it is. None if it does not
    keep up with the larger one there, which then needs what it has, or if it is no better in the end. Beside it, what
    that took.
    """
    problem, space = task.problem_and_space(own.structure)
    values = _given(space, own.structure, [larger])
    if not values:
        return None, SimulationCount()
    whole = task.problem(larger.structure)
    named = {name: np.array([value]) for name, value in larger.values.items()}
    begins = np.array([[known[name] for name in space.names] for known in values]).T
    begins = np.clip(begins, space.low[:, None], space.high[:, None])
    doubt = float(task.error_floor(problem.weights, FAST_LEVEL_ACCURACY).sum())
    spent, batches = SimulationCount(), own.batches
    for share in (*growing_horizons(MULTISTART_DEFAULTS.first_share), 1.0):
        part = problem.truncated(share)
        limit = options.rounds if share in (MULTISTART_DEFAULTS.first_share, 1.0) else MULTISTART_DEFAULTS.stage_rounds
        ends = fit_many(part, space, task.settings, begins, limit=limit, tolerance=options.tolerance)
        end = min(ends, key=lambda e: e.cost)
        begins = end.values[:, None]
        spent += part.count(sum(e.simulations for e in ends))
        batches += 1 + max(e.evaluations for e in ends)
        if share == 1.0:
            break
        ahead = whole.truncated(share)
        rival = float(ahead.costs(named, task.settings)[0])
        spent += ahead.count(1)
        if end.cost + share * doubt > REFIT.keeps_up * (rival + share * doubt):
            return None, spent
    if not end.cost < own.cost:
        return None, spent
    return _fitted(own.structure, space, end, batches, spent), spent


def _best_chains(space: ParameterSpace, structure: Structure, begins: Array, cost: Array, count: int) -> list[int]:
    """Numbers of the best starts, of which no two have the same masses and shafts.

    A shaft that is wrongly rigid may cost less at first than a resonance that is a little off.
    """
    chain = mass_chain_of(structure)
    own = {chain.parameter(q.symbol) for q in chain.effect.parameters}
    rows = [i for i, name in enumerate(space.names) if name in own]
    best: dict[bytes, int] = {}
    for k in np.argsort(cost, kind="stable").tolist():
        best.setdefault(begins[rows, k].tobytes(), k)
    return list(best.values())[:count]


def _given(space: ParameterSpace, structure: Structure, known: Sequence[StructureFit]) -> list[Mapping[str, float]]:
    """Values of other fits that have all masses; an effect that one of them lacks begins where it vanishes."""
    handed = (v for f in known for v in handed_down(f.values, f.information, f.structure, structure, space))
    vanishing = _vanishing(space, structure)
    return [v for h in handed if set(space.names) <= set(v := {**vanishing, **h})]


def _grown(
    task: IdentificationTask, space: ParameterSpace, structure: Structure, values: Mapping[str, float]
) -> list[Mapping[str, float]]:
    """The same values with each effect that has all but vanished at the least size that matters.

    A size on a logarithmic scale does not grow from there by itself: its derivative has vanished, too.
    """
    lowest = dict(zip(space.names, space.low.tolist(), strict=True))
    grown: list[Mapping[str, float]] = []
    for placed in structure.beside:
        size = next((placed.parameter(q.symbol) for q in placed.effect.parameters if q.size and q.scale == "log"), None)
        if size in lowest and values[size] <= REFIT.vanished * lowest[size]:
            relevant = placed.relevant_size(task.scales, values)
            grown += [{**values, size: relevant[size]}] if size in relevant else []
    return grown


def _vanishing(space: ParameterSpace, structure: Structure) -> dict[str, float]:
    """Values at which the effects beside the masses do next to nothing, and nuisances as declared."""
    declared = {p.parameter(q.symbol): (p, q) for p in structure.placed for q in p.effect.parameters}
    values = {}
    for name, low, start in zip(space.names, space.low, space.start, strict=True):
        placed, parameter = declared.get(name, (None, None))
        if placed is not None and placed.effect.masses:
            continue
        least = parameter is not None and parameter.size
        values[name] = float((low if parameter and parameter.scale == "log" else 0.0) if least else start)
    return values


def _fitted(
    structure: Structure, space: ParameterSpace, end: Optimum, batches: int, spent: SimulationCount
) -> StructureFit:
    """Fit that has come to its `end`."""
    values = dict(zip(space.names, end.values.tolist(), strict=True)) | dict(space.fixed)
    cost = end.cost if np.isfinite(end.cost) else np.inf
    known = information(end.curvature, space.scale_derivative(end.values))
    return StructureFit(structure, values, cost, len(space.names), (), batches, spent, known)


def not_worse_than_submodels(own: StructureFit, within: Sequence[StructureFit]) -> StructureFit:
    """`own`, or what the best structure `within` it has if that is better: it could do without the effect."""
    best = min(within, key=lambda f: f.cost, default=own)
    if own.cost <= best.cost:
        return own
    redundant = (*best.redundant_effects, *added_effects(own.structure, best.structure))
    values, equals = {**own.values, **best.values}, best.equals or best.structure
    return replace(own, values=values, cost=best.cost, redundant_effects=redundant, information=None, equals=equals)


def ranges_within_decade(space: ParameterSpace) -> bool:
    """Return True if all ranges of positive parameters are within a decade, as a user gives them."""
    own = space.log & ~space.not_sampled
    return bool(own.any() and np.all(space.high[own] <= REFIT.narrow_range * space.low[own]))


def fit_multistart(
    task: IdentificationTask,
    structure: Structure,
    options: Options,
    seed: int,
    known: Sequence[StructureFit] | None = None,
    enough: float = np.inf,
    cost_to_beat: float = np.inf,
) -> StructureFit:
    """Fit a structure of which nothing is known, or nothing but doubtful optima of its own or larger ones.

    Starts begin there, in place of the declared values. A white residual is enough only up to the cost that another
    structure leaves. Descents that would not get below `cost_to_beat` are given up: an optimum above it is of no use.
    """
    problem, space = task.problem_and_space(structure)
    starts = options.narrow if ranges_within_decade(space) else options.fresh
    starts = options.fresh_hard_limit or starts if structure.has_hard_limit else starts
    given = None if known is None else _given(space, structure, known)
    found = multistart(
        problem,
        space,
        task.settings,
        given,
        starts=starts,
        patience=options.patience,
        seed=seed,
        enough=enough,
        cost_to_beat=cost_to_beat,
    )
    end = min(found.optima, key=lambda e: e.cost)
    fitted = _fitted(structure, space, end, found.evaluations, found.simulations)
    return replace(fitted, agreeing=found.agreeing)


def fit_from_neighbours(
    task: IdentificationTask,
    structure: Structure,
    parents: Sequence[StructureFit],
    others: Sequence[StructureFit],
    options: Options,
    seed: Sequence[int],
) -> StructureFit:
    """Fit one structure, begun where its best `parents` and `others`, hubs and larger ones, have ended."""
    problem, space = task.problem_and_space(structure)
    rng = np.random.default_rng(list(seed))
    best = best_parents(parents, options)
    # What laws of two ports add was never sought in hubs, and the structure without them has begun there, too.
    origins = best if best and structure.has_hard_limit else [*best, *others]
    drawn = np.array_split(space.sample(options.drawn * len(origins), rng), len(origins), axis=1)
    tried = [_extended(space, f, part) for f, part in zip(origins, drawn, strict=True)]
    chosen, count = best_starts(task, problem, space, tried, options.starts)
    ends = fit_many(
        problem,
        space,
        task.settings,
        chosen,
        limit=options.rounds,
        tolerance=options.tolerance,
        cost_to_beat=best[0].cost if best else np.inf,
    )
    end = min(ends, key=lambda e: e.cost)
    batches = 2 + max(e.evaluations for e in ends)
    spent = problem.count(count + sum(e.simulations for e in ends))
    return not_worse_than_submodels(_fitted(structure, space, end, batches, spent), best)


def _extended(space: ParameterSpace, parent: StructureFit, drawn: Array) -> Array:
    """Starts at another optimum, shape (P, K), SI.

    What the other structure lacks is drawn, and what is drawn with it; the first has it as declared.
    """
    candidates = np.concatenate([space.start[:, None], drawn], axis=1)
    own = [i for i, name in enumerate(space.names) if name in parent.values]
    kept = np.array(candidates)
    kept[own] = np.array([parent.values[space.names[i]] for i in own])[:, None]
    tried = [kept]
    for rows in (block.rows for block in space.blocks):
        if any(i not in own for i in rows) and any(i in own for i in rows):
            anew = np.array(kept)
            anew[list(rows)] = candidates[list(rows)]
            tried.append(anew)
    if len(own) == len(space.names):
        tried = [kept[:, :1]]
    return np.asarray(np.clip(np.concatenate(tried, axis=1), space.low[:, None], space.high[:, None]))


def best_starts(
    task: IdentificationTask, problem: SimulationErrorProblem, space: ParameterSpace, tried: Sequence[Array], count: int
) -> tuple[Array, int]:
    """Best of the starts at each optimum, of `count` optima, shape (P, count), best first; and how many were tried.

    The first start at each says what the others have to be better than, and most are given up early. What diverges is
    taken only if it is the first one and nothing else is better.
    """
    firsts = np.stack([begins[:, 0] for begins in tried], axis=1)
    cost = problem.costs(space.named(firsts), task.settings, np.full(len(tried), np.inf))
    enough = np.sort(cost)[:count][-1]
    others = np.concatenate([begins[:, 1:] for begins in tried], axis=1)
    origin = np.repeat(np.arange(len(tried)), [begins.shape[1] - 1 for begins in tried])
    found = np.full(len(origin), np.inf)
    if len(origin):
        found = problem.costs(space.named(others), task.settings, np.minimum(cost[origin], enough))
    best = []
    for k in range(len(tried)):
        own = np.flatnonzero(origin == k)
        least = own[np.argmin(found[own])] if len(own) else None
        better = least is not None and found[least] < cost[k]
        best.append((found[least], others[:, least]) if better else (cost[k], firsts[:, k]))
    best.sort(key=lambda b: b[0])
    return np.stack([values for _, values in best[:count]], axis=1), firsts.shape[1] + others.shape[1]


def last_descent(task: IdentificationTask, structure: Structure, begin: Array) -> Optimum:
    """Descend from `begin`, shape (P,), SI, to convergence at level ``accurate``."""
    problem, space = task.problem_and_space(structure)
    return polish(problem, space, replace(task.settings, level="accurate"), begin, tolerance=REFIT.polish_tolerance)
