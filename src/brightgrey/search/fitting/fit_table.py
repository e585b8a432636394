"""Table of the best fit of each structure; every fit starts at the optima of neighbouring structures.

Upwards, a structure starts at the optima of its submodels, with the added effect's parameters sampled. No structure
ends worse than a submodel, since it could do without the effect. Downwards, the optimum of a supermodel is projected
onto its submodels. Some optima show only with all friction in the model, or with everything that delays the torque.
They are found in *anchors*, two structures for each number of masses.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np

from brightgrey.arrays import positive
from brightgrey.estimation.optimisation.least_squares import SAME_OPTIMUM_RTOL
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.kit import Structure
from brightgrey.search.fitting.anchors import default_anchors
from brightgrey.search.fitting.structure_fit import (
    Options,
    StructureFit,
    best_parents,
    continue_from_supermodel,
    fit_from_neighbours,
    fit_multistart,
    not_worse_than_submodels,
    refit_from_supermodel,
)
from brightgrey.search.lattice import complexity, contains, mass_chain_of, maximal_submodels, minimal_supermodels
from brightgrey.search.parallel import in_dependency_order, in_order
from brightgrey.search.policy import REFIT
from brightgrey.search.task import FAST_LEVEL_ACCURACY, IdentificationTask

__all__ = ["FitTable"]

_Item = tuple[bool, Structure]
"""A structure; True marks an anchor, which is fitted by multistart."""


class FitTable:
    """Best fit of each structure of a set, made when it is asked for.

    Attributes
    ----------
    task : IdentificationTask
    structures : tuple of Structure
        Structures that may be asked for, fitted or not.
    done : dict of Structure to StructureFit
        In the order in which they were fitted for the first time.
    anchors : dict of Structure to StructureFit
    log : list of (bool, StructureFit)
        All fits in their order, refits included; True marks those of anchors.
    spent : list of SimulationCount
        Simulations of the fits, and of offers that were not followed.

    Parameters
    ----------
    options : Options, optional
    seed : int
    should_refit : callable, optional
        ``should_refit(structure, cost)``: False if a structure is not worth another fit from a neighbour's optimum
        that leaves at least that cost; all are by default.
    """

    def __init__(
        self,
        task: IdentificationTask,
        structures: Sequence[Structure],
        *,
        options: Options | None = None,
        seed: int = 0,
        should_refit: Callable[[Structure, float], bool] = lambda structure, cost: True,
        anchors: Sequence[Structure] | None = None,
    ) -> None:
        self.task, self.done, self.anchors = task, dict[Structure, StructureFit](), dict[Structure, StructureFit]()
        self.log: list[tuple[bool, StructureFit]] = []
        self.spent: list[SimulationCount] = []
        self._should_refit = should_refit
        self._how, self._seed = options or Options(), seed
        self.structures = tuple(structures)
        self._order = {s: i for i, s in enumerate(structures)}
        self._first = default_anchors(structures) if anchors is None else list(anchors)
        self.agreeing: dict[Structure, int] = {}  # independent starts that have ended at the best optimum
        self._sought = set[Structure]()
        self._fields = 0  # calls of `restart_many`, each with starts of its own
        self._followed: set[tuple[Structure, Structure, float]] = set()
        self._offered: set[tuple[Structure, Structure, float]] = set()

    def add(
        self, structures: Sequence[Structure], workers: Executor, progress: Callable[[StructureFit], None] | None = None
    ) -> set[Structure]:
        """Fit those of `structures` that are new; then refit their neighbours where that helps.

        Returns
        -------
        set of Structure
            Structures that were fitted before and now have a better fit.
        """
        before = tuple(self.done)
        rising = sorted((s for s in structures if s not in self.done), key=complexity)
        self._new(rising, workers, progress)
        return self._settled(before, rising, workers) & set(before)

    def fit_from(self, structure: Structure, values: Mapping[str, float], workers: Executor) -> StructureFit:
        """Fit a structure that is new from values of its parameters, SI."""
        (self.done[structure],) = self.tried([(structure, values)], workers)
        return self.done[structure]

    def forget(self, structure: Structure) -> None:
        """Take a structure out of the table."""
        del self.done[structure]
        self.agreeing.pop(structure, None)

    def tried(
        self, starts: Sequence[tuple[Structure, Mapping[str, float]]], workers: Executor, *, growing: bool = False
    ) -> list[StructureFit]:
        """Fits of structures from values of their parameters, SI, that are not taken into the table."""
        begun = []
        for structure, values in starts:
            space = self.task.space(structure, nuisances=True)
            own = {**dict(zip(space.names, space.start.tolist(), strict=True)), **space.fixed, **values}
            begun.append(StructureFit(structure, own, np.inf, len(space.names)))
        calls = [(self.task, start, [start], self._how, True, growing) for start in begun]
        ends = in_order(workers, refit_from_supermodel, calls)
        fits = [start if end is None else end for start, (end, _) in zip(begun, ends, strict=True)]
        for fitted in fits:
            self._noted(False, fitted)
        return fits

    def restart(self, structure: Structure, workers: Executor) -> set[Structure]:
        """Fit a structure by multistart, once, refit its submodels from its optimum, and then its other neighbours.

        A submodel may have its own optimum nearby, although it is worse there at first.

        Returns
        -------
        set of Structure
            Structures that now have a better fit.
        """
        if structure in self._sought:
            return set()
        self._sought.add(structure)
        (fitted,) = in_order(workers, fit_multistart, [(self.task, structure, self._how, self._seed)])
        better = {structure} if self._taken(structure, fitted) else set()
        leader = self.done[structure]
        if not leader.redundant_effects:
            within = maximal_submodels(structure, self.done)
            worse = [t for t in within if leader.cost < REFIT.improved * self.done[t].cost]
            calls = [(self.task, self.done[t], [leader], self._how, True) for t in worse]
            found = zip(worse, in_order(workers, refit_from_supermodel, calls), strict=True)
            better.update([t for t, result in found if self._handed(t, *result)])
        before = [s for s in self.done if s not in better]
        return self._settled(before, sorted(better, key=complexity), workers) | better if better else better

    def restart_many(
        self, structures: Sequence[Structure], patience: int, workers: Executor, fields: int = 1
    ) -> set[Structure]:
        """Fit structures by multistart, with their own optimum and those of much better fits among the starts.

        Returns
        -------
        set of Structure
            Structures that got clearly better.
        """
        how = replace(self._how, patience=patience, fresh=self._how.fresh // fields)
        enough = (1.0 + SAME_OPTIMUM_RTOL) * self.best().cost
        calls = []
        for number in range(fields):
            self._fields += 1
            for f in (self.done[s] for s in structures):
                begins = [f, *self._ahead(f)] if number == 0 else []  # they lead to one end in every field
                calls.append((self.task, f.structure, how, self._seed + self._fields, begins, enough, f.cost))
        found = in_order(workers, fit_multistart, calls)
        return {new.structure for new in found if self._much_better(self.done[new.structure], new)}

    def refit_supermodels(
        self, before: Sequence[Structure], rising: Sequence[Structure], workers: Executor
    ) -> list[Structure]:
        """Refit structures that are worse than a new fit of a submodel; returns those that got better."""
        better = []
        larger = [s for s in before if any(contains(s, t) for t in rising)]
        within = {s: maximal_submodels(s, self.done) for s in larger}

        def call(s: Structure) -> tuple[Any, ...] | None:
            limit = REFIT.improved * self.done[s].cost
            offers = self._fresh(s, [t for t in within[s] if self.done[t].cost < limit])
            if not offers:
                return None
            parents = best_parents([self.done[t] for t in offers], self._how)
            return fit_from_neighbours, self.task, s, parents, [], self._how, (self._seed, self._number(s))

        def take(s: Structure, fitted: StructureFit | None) -> None:
            if fitted is not None and self._taken(s, fitted):
                better.append(s)

        larger.sort(key=complexity)
        chosen = set(larger)
        in_dependency_order(workers, larger, lambda s: [t for t in within[s] if t in chosen], call, take)
        return better

    def propagate(self, better: Collection[Structure], workers: Executor) -> None:
        """Refit neighbours of `better` fits where that helps, and continue hard-limit optima to submodels."""
        if better:
            everything = tuple(self.done)
            self._settled(everything, sorted(better, key=complexity), workers)
            self.continue_to_submodels(workers)

    def continue_to_submodels(self, workers: Executor) -> set[Structure]:
        """Continue each optimum with a hard limit to its submodels once; returns the structures that got better."""
        better = self._follow(workers)
        return {*better, *self._settled(tuple(self.done), better, workers)}

    def best(self) -> StructureFit:
        """Best fit without redundant effects."""
        return min((f for f in self.done.values() if not f.redundant_effects), key=lambda f: (f.cost, f.free))

    def cutoff_cost(self) -> float:
        """Cost above which a structure is far behind the best one."""
        best = self.best()
        return REFIT.cutoff * (best.cost + self.error_floor_cost(best))

    def error_floor_cost(self, fitted: StructureFit, accuracy: float = FAST_LEVEL_ACCURACY) -> float:
        """Cost of errors of an accuracy, by default that of the simulation at the level of the search."""
        return float(self.task.error_floor(self.task.problem(fitted.structure).weights, accuracy).sum())

    def fit_percent(self, fitted: StructureFit) -> float:
        """NRMSE fit in percent over all outputs, each weighted as in the cost."""
        weights = self.task.problem(fitted.structure).weights
        motion = sum(float(np.sum((weights * r.y.std(axis=1)) ** 2)) * r.samples for r in self.task.recordings)
        return 100.0 * (1.0 - float(np.sqrt(fitted.cost / positive(motion))))

    def simulated_samples(self) -> int:
        """Number of samples that have been simulated."""
        return sum(spent.samples for spent in self.spent)

    def _ahead(self, fitted: StructureFit) -> list[StructureFit]:
        """Fits that are much better: of the smallest supermodels, and of all with a hard limit if it has one, too."""
        around = [self._behind(t) for t in minimal_supermodels(fitted.structure, self.done)]
        leaders = [f for s, f in self.done.items() if fitted.structure.has_hard_limit and s.has_hard_limit]
        best = [min(some, key=lambda f: f.cost, default=fitted) for some in (around, leaders)]
        return list({f.structure: f for f in best if f.cost < REFIT.clear_gain * fitted.cost}.values())

    def _behind(self, s: Structure) -> StructureFit:
        """Fit of a structure, or of the one without its redundant effects, whose optimum it has."""
        fitted = self.done[s]
        return fitted if fitted.equals is None else self.done.get(fitted.equals, fitted)

    def _much_better(self, known: StructureFit, new: StructureFit) -> bool:
        """Keep a further fit if it is clearly better; returns True if it is."""
        if better := new.cost < REFIT.improved * known.cost:
            self._taken(known.structure, new)
        else:
            self._noted(False, new)
        if new.cost < known.cost / (1.0 + SAME_OPTIMUM_RTOL):
            self.agreeing[known.structure] = new.agreeing
        elif new.cost <= known.cost * (1.0 + SAME_OPTIMUM_RTOL):
            self.agreeing[known.structure] = self.agreeing.get(known.structure, 0) + new.agreeing
        return better

    def _settled(self, before: Sequence[Structure], latest: Sequence[Structure], workers: Executor) -> set[Structure]:
        """Refit neighbours of the `latest` fits where that helps; returns those that got better."""
        hopeful = [s for s in before if self._should_refit(s, 0.0)]
        better = {*self.refit_supermodels(hopeful, latest, workers), *self._down(workers)}
        for s in sorted(self.done, key=complexity):
            within = [self.done[t] for t in maximal_submodels(s, self.done)]
            self.done[s] = not_worse_than_submodels(self.done[s], within)
        return better

    def _new(
        self, rising: Sequence[Structure], workers: Executor, progress: Callable[[StructureFit], None] | None
    ) -> None:
        """Fit structures for the first time, with the anchors that they need."""
        known = [*self.done, *rising]
        near = {s: [h for h in self._first if mass_chain_of(h) == mass_chain_of(s)] for s in rising}
        hubs = [h for h in self._first if h not in self.anchors and any(h in n for n in near.values())]
        hubs.sort(key=lambda h: -h.masses)  # begun last, one of those that take longest would leave workers idle
        within = {s: maximal_submodels(s, known) for s in rising}
        around = {s: minimal_supermodels(s, self.done) for s in rising}

        def needs(item: _Item) -> list[_Item]:
            """Anchors with as many masses, and submodels."""
            hub, s = item
            wanted = [] if hub else [(True, h) for h in near[s]] + [(False, t) for t in within[s]]
            return [w for w in wanted if w in position]

        def call(item: _Item) -> tuple[Any, ...]:
            hub, s = item
            if hub:
                return fit_multistart, self.task, s, self._how, self._seed
            parents = best_parents([self.done[t] for t in within[s]], self._how)
            others = [self.anchors[h] for h in near[s]] + best_parents([self.done[t] for t in around[s]], self._how)
            return fit_from_neighbours, self.task, s, parents, others, self._how, (self._seed, self._number(s))

        def take(item: _Item, fitted: StructureFit) -> None:
            hub, s = item
            self._noted(hub, fitted)
            if hub:
                self.anchors[s] = fitted
                return
            self.done[s] = fitted
            if progress is not None:
                progress(fitted)

        items = [(True, h) for h in hubs] + [(False, s) for s in rising]
        position = set(items)
        in_dependency_order(workers, items, needs, call, take)

    def _down(self, workers: Executor) -> list[Structure]:
        """Refit submodels from the optima of their supermodels, the largest first; returns those that got better.

        Without a hard limit a descent is cheap. It is made even from a bad start if the supermodel comes near the best
        fit. Others may take an effect's part. Several masses left of more begin badly: the least gain tells.
        """
        near = self.cutoff_cost() if self.done else np.inf

        def call(s: Structure, around: Sequence[Structure]) -> tuple[Any, ...] | None:
            own = self.done[s]
            better = [t for t in around if self.done[t].cost < own.cost and self._should_refit(s, self.done[t].cost)]
            offers = [self._behind(t) for t in self._fresh(s, better)]
            gain = REFIT.improved if any(f.structure.masses > s.masses > 1 for f in offers) else REFIT.clear_gain
            telling = min((f.cost for f in offers), default=np.inf) < min(gain * own.cost, near)
            anyway = telling and not s.has_hard_limit
            return (refit_from_supermodel, self.task, own, offers, self._how, anyway) if offers else None

        return self._falling(list(self.done), call, workers)

    def _follow(self, workers: Executor) -> list[Structure]:
        """Continue optima with a hard limit to submodels, the largest first; returns those that got better.

        Supermodels far behind the best fit are left out: their submodels are no better.
        """
        near = self.cutoff_cost()

        def call(s: Structure, around: Sequence[Structure]) -> tuple[Any, ...] | None:
            own = self.done[s]
            whole = [self.done[t] for t in around if not self.done[t].redundant_effects]
            larger = min(whole, key=lambda f: f.cost, default=own)
            telling = larger.cost < min(REFIT.clear_gain * own.cost, near) and self._should_refit(s, larger.cost)
            trail = s, larger.structure, larger.cost
            if not telling or trail in self._followed:
                return None
            self._followed.add(trail)
            return continue_from_supermodel, self.task, own, larger, self._how

        return self._falling([s for s in self.done if s.has_hard_limit], call, workers)

    def _falling(
        self,
        structures: Sequence[Structure],
        call: Callable[[Structure, Sequence[Structure]], tuple[Any, ...] | None],
        workers: Executor,
    ) -> list[Structure]:
        """Make calls of structures with their smallest supermodels, largest first; returns those that got better."""
        better = []
        around = {s: minimal_supermodels(s, self.done) for s in sorted(structures, key=complexity, reverse=True)}

        def take(s: Structure, result: tuple[StructureFit | None, SimulationCount] | None) -> None:
            if result is not None and self._handed(s, *result):
                better.append(s)

        in_dependency_order(workers, list(around), around.__getitem__, lambda s: call(s, around[s]), take)
        return better

    def _fresh(self, s: Structure, relatives: Sequence[Structure]) -> list[Structure]:
        """Neighbours whose present optimum has not been offered to `s` yet."""
        offers = {t: (s, t, self.done[t].cost) for t in relatives}
        fresh = [t for t, offer in offers.items() if offer not in self._offered]
        self._offered.update(offers.values())
        return fresh

    def _handed(self, s: Structure, fitted: StructureFit | None, spent: SimulationCount) -> bool:
        """Keep a refit from a supermodel if it is better; returns True if it is."""
        if fitted is None:
            self.spent.append(spent)
            return False
        return self._taken(s, fitted)

    def _number(self, s: Structure) -> int:
        """Number of a structure, for the seed of its draws."""
        return self._order[s] if s in self._order else zlib.crc32(str(s).encode())

    def _noted(self, hub: bool, fitted: StructureFit) -> None:
        self.log.append((hub, fitted))
        self.spent.append(fitted.spent)

    def _taken(self, s: Structure, fitted: StructureFit) -> bool:
        """Keep a further fit if it is better; returns True if it is."""
        self._noted(False, fitted)
        known = self.done[s]
        if not fitted.cost < known.cost:
            return False
        if fitted.cost < known.cost / (1.0 + SAME_OPTIMUM_RTOL):
            self.agreeing.pop(s, None)  # they have ended elsewhere
        self.done[s] = fitted
        return True
