"""All structures of a grammar, simple to complex, each begun where those that it contains have ended.

A structure contains others: those with an effect or a mass less. Descending from their optima, with the further effect
drawn anew, costs little, and no structure ends worse than one it contains, since it could do without the effect. Then
the other way: an optimum that a larger structure has found without need for its further effect is handed down. Optima
that only show with all friction in the model, or with all that delays the torque, are found in *hubs*, two for each
number of masses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brightgrey.estimation.bounds import Search
from brightgrey.estimation.explore import explore
from brightgrey.estimation.leastsquares import descend_many
from brightgrey.estimation.problem import Problem
from brightgrey.kit import Placed, Structure
from brightgrey.search.identification import Identification
from brightgrey.search.lattice import effects_of, extensions, ladder_of, largest_within, size
from brightgrey.search.work import in_turn, pool

__all__ = ["Fitted", "Options", "fit_all", "fit_one"]

Array = NDArray[np.float64]
_Item = tuple[bool, Structure]  # whether it is a hub that is sought from everywhere
_IMPROVED = 0.999  # of the cost: what is worth another descent


@dataclass(frozen=True)
class Options:
    """How thoroughly each structure is searched.

    Attributes
    ----------
    parents : int
        Simpler structures whose optima are looked at, beside those of the hubs.
    starts : int
        Descents: from the best of these optima.
    fresh, patience : int
        Starts of a field and fields without improvement, in the search for a hub.
    drawn : int
        Values of the further effect that are tried at each of these optima.
    rounds : int
        Of each descent.
    tolerance : float
        Relative to the cost.
    """

    parents: int = 2
    starts: int = 2
    fresh: int = 8
    patience: int = 1
    drawn: int = 15
    rounds: int = 25
    tolerance: float = 1e-3


@dataclass(frozen=True)
class Fitted:
    """One structure with its best parameters so far.

    Attributes
    ----------
    structure : Structure
    values : mapping of str to float
        SI, fixed ones and unknown parts of initial states included.
    cost : float
        Weighted sum of squared residuals at the level of the search.
    free : int
        Number of estimated parameters.
    idle : tuple of str
        Effects that only made the fit worse than that of a structure without them: their values are meaningless.
    batches : int
        Batches of simulations.
    """

    structure: Structure
    values: Mapping[str, float]
    cost: float
    free: int
    idle: tuple[str, ...] = ()
    batches: int = 0


def fit_all(
    task: Identification,
    structures: Sequence[Structure],
    *,
    options: Options | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[Fitted], None] | None = None,
) -> dict[Structure, Fitted]:
    """Fit all `structures` at the level of ``task.settings``.

    Parameters
    ----------
    task : Identification
    structures : sequence of Structure
    options : Options, optional
    seed : int
    executor : concurrent.futures.Executor, optional
        Fits structures at a time that do not contain each other; the result does not depend on it. One thread by
        default.
    progress : callable, optional
        Called with every structure that has been fitted for the first time, in the order of the result.

    Returns
    -------
    dict of Structure to Fitted
        Simple ones first.
    """
    how = options or Options()
    order = {s: i for i, s in enumerate(structures)}
    rising = sorted(structures, key=size)
    first = _hubs(structures)
    hubs: dict[Structure, Fitted] = {}
    done: dict[Structure, Fitted] = {}
    near = {s: [h for h in first if ladder_of(h) == ladder_of(s)] for s in structures}
    within = {s: largest_within(s, structures) for s in structures}

    def needs(item: _Item) -> list[_Item]:
        """Hubs of its ladder, and what it contains."""
        hub, s = item
        return [] if hub else [(True, h) for h in near[s]] + [(False, t) for t in within[s]]

    def call(item: _Item) -> tuple[Any, ...]:
        hub, s = item
        if hub:
            return _from_everywhere, task, s, how, seed
        parents = _best([done[t] for t in within[s]], how)
        return fit_one, task, s, parents, [hubs[h] for h in near[s]], how, (seed, order[s])

    def take(item: _Item, fitted: Fitted) -> None:
        hub, s = item
        if hub:
            hubs[s] = fitted
            return
        done[s] = fitted
        if progress is not None:
            progress(fitted)

    def above(s: Structure) -> tuple[Any, ...] | None:
        larger = _better_above(done, s)
        return (_from_above, task, done[s], larger, how) if larger else None

    with pool(executor) as workers:
        in_turn(workers, [(True, h) for h in first] + [(False, s) for s in rising], needs, call, take)
        falling = sorted(structures, key=size, reverse=True)
        in_turn(workers, falling, lambda s: extensions(s, structures), above, done.__setitem__)
    for s in done:
        done[s] = _at_least_as_good(done[s], [done[t] for t in within[s]])
    return done


def _best(parents: Sequence[Fitted], options: Options) -> list[Fitted]:
    """Those of `parents` that are looked at."""
    return sorted(parents, key=lambda p: p.cost)[: options.parents]


def _better_above(done: Mapping[Structure, Fitted], structure: Structure) -> list[Fitted]:
    """Larger structures that did better, and not without what they have beyond this one."""
    return [done[s] for s in extensions(structure, done) if done[s].cost < done[structure].cost and not done[s].idle]


def _from_above(task: Identification, own: Fitted, larger: Sequence[Fitted], options: Options) -> Fitted:
    """Descend once more from where `larger` structures did better."""
    problem, space = task.problem(own.structure), task.space(own.structure, initial=True)
    values = [f.values for f in larger if set(space.names) <= set(f.values)]
    if not values:
        return own
    begins = np.array([[known[name] for name in space.names] for known in values]).T
    begins = np.clip(begins, space.low[:, None], space.high[:, None])
    cost = problem.costs(space.named(begins), task.settings)
    if not cost.min() < _IMPROVED * own.cost:
        return own
    begin = begins[:, [int(np.argmin(cost))]]
    (end,) = descend_many(
        problem, space, task.settings, begin, limit=options.rounds, tolerance=options.tolerance, rival=own.cost
    )
    named = dict(zip(space.names, end.values.tolist(), strict=True)) | dict(space.fixed)
    return Fitted(own.structure, named, end.cost, len(space.names), (), own.batches + 1 + end.evaluations)


def _at_least_as_good(own: Fitted, within: Sequence[Fitted]) -> Fitted:
    """`own`, or what the best structure `within` it has if that is better: it could do without the effect."""
    best = min(within, key=lambda f: f.cost, default=own)
    if own.cost <= best.cost:
        return own
    idle = (*best.idle, *effects_of(own.structure, best.structure))
    return replace(own, values={**own.values, **best.values}, cost=best.cost, idle=idle)


def _hubs(structures: Sequence[Structure]) -> list[Structure]:
    """For every ladder the structures that find what simpler ones cannot.

    One has the most laws of one port at most, and nothing else if possible: resonances show with the friction that
    hides them. The other has all effects but laws of two ports: resonances show with what delays the torque.
    """

    def laws(structure: Structure) -> list[int]:
        """Ports of the laws; 0 for effects without one."""
        return [p.effect.law.ports if p.effect.law else 0 for p in structure.beside]

    def friction(structure: Structure) -> tuple[int, int]:
        ports = laws(structure)
        return len(ports) - ports.count(1), -ports.count(1)

    def linear(structure: Structure) -> tuple[int, int]:
        ports = laws(structure)
        return sum(n > 1 for n in ports), -len(ports)

    ladders: dict[Placed, list[Structure]] = {}
    for s in structures:
        ladders.setdefault(ladder_of(s), []).append(s)
    return list(dict.fromkeys(min(group, key=rank) for group in ladders.values() for rank in (friction, linear)))


def _from_everywhere(task: Identification, structure: Structure, options: Options, seed: int) -> Fitted:
    """Fit a structure of which nothing is known."""
    problem, space = task.problem(structure), task.space(structure, initial=True)
    found = explore(problem, space, task.settings, [], starts=options.fresh, patience=options.patience, seed=seed)
    end = min(found.ends, key=lambda e: e.cost)
    named = dict(zip(space.names, end.values.tolist(), strict=True)) | dict(space.fixed)
    return Fitted(structure, named, end.cost, len(space.names), (), found.evaluations)


def fit_one(
    task: Identification,
    structure: Structure,
    parents: Sequence[Fitted],
    hubs: Sequence[Fitted],
    options: Options,
    seed: Sequence[int],
) -> Fitted:
    """Fit one structure, begun where its best `parents` and the `hubs` of its ladder have ended."""
    problem, space = task.problem(structure), task.space(structure, initial=True)
    rng = np.random.default_rng(list(seed))
    best = _best(parents, options)
    # What laws of two ports add was never sought in hubs, and the structure without them has begun there, too.
    origins = best if best and _two_ports(structure) else [*best, *hubs]
    drawn = np.array_split(space.candidates(options.drawn * len(origins), rng), len(origins), axis=1)
    begins = [_extended(task, problem, space, f, part) for f, part in zip(origins, drawn, strict=True)]
    begins.sort(key=lambda b: b[0])
    chosen = np.stack([values for _, values in begins[: options.starts]], axis=1)
    ends = descend_many(
        problem,
        space,
        task.settings,
        chosen,
        limit=options.rounds,
        tolerance=options.tolerance,
        rival=best[0].cost if best else np.inf,
    )
    end = min(ends, key=lambda e: e.cost)
    batches = len(begins) + max(e.evaluations for e in ends)
    named = dict(zip(space.names, end.values.tolist(), strict=True)) | dict(space.fixed)
    cost = end.cost if np.isfinite(end.cost) else np.inf
    return _at_least_as_good(Fitted(structure, named, cost, len(space.names), (), batches), best)


def _two_ports(structure: Structure) -> bool:
    """Whether it has a law of two ports, which takes several times as long to simulate."""
    return any(p.effect.law is not None and p.effect.law.ports > 1 for p in structure.placed)


def _extended(
    task: Identification, problem: Problem, space: Search, parent: Fitted, drawn: Array
) -> tuple[float, Array]:
    """Best of some starts at another optimum, with its cost: what that lacks is drawn, and what is drawn with it."""
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
    begins = np.clip(np.concatenate(tried, axis=1), space.low[:, None], space.high[:, None])
    cost = problem.costs(space.named(begins), task.settings)
    return float(cost.min()), np.asarray(begins[:, int(np.argmin(cost))])
