"""Individuals identified where their relatives' identifications have ended, as in the search of all structures."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from brightgrey.estimation.noise.autoregression import autoregression
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.kit import Structure
from brightgrey.search.criteria import Criterion, Misfit
from brightgrey.search.fits import Fits
from brightgrey.search.fitting import Fitted, is_narrow
from brightgrey.search.genetic.evaluation import Evaluated
from brightgrey.search.judging import last_descent
from brightgrey.search.lattice import contains
from brightgrey.search.missed import seek_missed
from brightgrey.search.task import FAST_LEVEL_ACCURACY, IdentificationTask

__all__ = ["LatticeEvaluator"]


@dataclass(frozen=True)
class _Bar:
    """What a structure is measured by after so many fits, and if that share of the samples is independent.

    `best` is the best value of the criterion; `least` the least cost of what contains a structure, as far as asked.
    """

    fits: int
    share: float
    best: float
    least: dict[Structure, float] = field(default_factory=dict)


class LatticeEvaluator:
    """Has structures identified, each one once, and once more where a relative's optimum helps.

    What has lost by the criterion is not handed its relatives' optima any more, from the first search for missed optima
    on: `fits` are told so.

    Attributes
    ----------
    fits : Fits
    better : tuple of Structure
        Of earlier generations, which the latest one has improved; and what was identified beside its individuals.
    share : float
        Of the samples, how many are independent by the residuals of the best fit so far.
    """

    def __init__(self, fits: Fits, executor: Executor, judge: Criterion) -> None:
        self.fits, self.better, self.share = fits, tuple[Structure, ...](), 1.0
        self._executor, self._judge, task = executor, judge, fits.task
        self._weights = task.problem(fits.structures[0]).weights
        self._doubt = float(task.error_floor(self._weights, FAST_LEVEL_ACCURACY).sum())
        self._free: dict[Structure, int] = {}
        self._bar: _Bar | None = None
        fits.worthwhile, self._sought = self.can_still_win, False
        self._accurate = replace(task, settings=replace(task.settings, level="accurate"))
        self._seen: dict[tuple[Structure, float], tuple[Fitted, Misfit]] = {}

    def identify(self, structures: Sequence[Structure]) -> list[tuple[Evaluated, bool]]:
        """Results in the order of `structures`, each with whether it had been there before.

        Where some are new, optima with laws of two ports are handed down: what leads by then is bred next.
        """
        fits = self.fits
        fresh = [s for s in dict.fromkeys(structures) if s not in fits.done]
        counted = len(fits.spent)
        better = fits.add(fresh, self._executor) | fits.follow(self._executor) if fresh else set()
        self.better = tuple(s for s in fits.done if s in better and s not in structures)
        spent = self._spent(counted)  # by the first of them: hubs serve them all
        out, first = [], set(fresh)
        for s in structures:
            out.append((self.evaluated(s, spent if s in first else SimulationCount()), s not in first))
            spent = SimulationCount() if s in first else spent
            first.discard(s)
        return out

    @property
    def narrow(self) -> bool:
        """Whether all ranges are, as those that a user gives."""
        task = self.fits.task
        return all(is_narrow(task.space(s, initial=True)) for s in self.fits.structures)

    def can_still_win(self, structure: Structure, cost: float = 0.0) -> bool:
        """Whether a structure could be as good as the best one, by the criterion, if it left `cost`, or what others do.

        It leaves no less than the best fit that contains it: what has more parameters than that is worth has lost,
        fitted or not. Where no fit contains it, several outputs are weighed against each other, what a user has bounded
        or fixed cannot fade away, or the first search for missed optima has not begun, all may win.
        """
        fits, task = self.fits, self.fits.task
        if not self._sought or len(self._weights) > 1 or task.bounds or task.fixed:
            return True
        bar = self._bar
        if bar is None or (bar.fits, bar.share) != (len(fits.log), self.share):
            values = (self._value(f.cost, f.free) for f in fits.done.values() if not f.idle)
            bar = self._bar = _Bar(len(fits.log), self.share, max(values, default=-np.inf))
        if structure not in bar.least:
            around = (f.cost for t, f in fits.done.items() if contains(t, structure))
            bar.least[structure] = min(around, default=0.0)
        if structure not in self._free:
            self._free[structure] = len(task.space(structure, initial=True).names)
        least = bar.least[structure]
        return least == 0.0 or self._value(max(cost, least), self._free[structure]) >= bar.best

    def eliminated(self) -> set[Structure]:
        """Structures that have lost, fitted or not."""
        return {s for s in self.fits.structures if not self.can_still_win(s)}

    def seek(self, structure: Structure) -> SimulationCount:
        """Identify a structure once more, from everywhere, if that has not been done; returns what was simulated."""
        counted = len(self.fits.spent)
        self._improved(self.fits.seek(structure, self._executor))
        return self._spent(counted)

    def seek_missed(self) -> SimulationCount:
        """Look for optima that have been missed, those with gaps above all; returns what was simulated."""
        counted, before = len(self.fits.spent), dict(self.fits.done)
        self._sought = True
        seek_missed(self.fits, self._executor)
        self._improved({s for s, fitted in self.fits.done.items() if fitted is not before.get(s)})
        return self._spent(counted)

    def _value(self, cost: float, free: int) -> float:
        """Criterion of a fit by its cost; differences within the simulation's own error hardly count."""
        task = self.fits.task
        samples = sum(r.samples for r in task.recordings)
        least = sum(r.samples * float(r.resolution[0] * self._weights[0]) ** 2 / 12.0 for r in task.recordings)
        return self._judge.value(Misfit((cost + self._doubt,), (least,), samples, (1.0,), self.share), free)

    def _improved(self, better: Collection[Structure]) -> None:
        self.better = tuple(s for s in self.fits.done if s in better or s in self.better)

    def update_effective_samples(self) -> SimulationCount:
        """Find `share` anew: what the best fit does not explain counts as noise; returns what was simulated."""
        task = self.fits.task
        best = min((f for f in self.fits.done.values() if not f.idle), key=lambda f: (f.cost, f.free))
        values = {name: np.array([value]) for name, value in best.values.items()}
        problem = task.problem(best.structure)
        residual = problem.residuals(values, task.settings)[:, 0]
        lengths = [r.samples for r in task.recordings for _ in r.outputs]
        pieces = np.split(residual, np.cumsum(lengths)[:-1])
        self.share = sum(autoregression(piece).effective_samples_variance(len(piece)) for piece in pieces) / len(
            residual
        )
        return problem.spent(1)

    def _spent(self, counted: int) -> SimulationCount:
        """What was spent on fits after the first `counted` entries."""
        return sum(self.fits.spent[counted:], SimulationCount())

    def evaluated(self, structure: Structure, spent: SimulationCount | None = None) -> Evaluated:
        """What is known of `structure` now, with what was `spent` on it; a misfit without what only made it worse."""
        own, spent = self.fits.done[structure], spent or SimulationCount()
        shown = own if not own.idle else next(f for f in self.fits.done.values() if not f.idle and f.cost == own.cost)
        if (shown.structure, shown.cost) not in self._seen:
            looked = self._looked(shown)
            self._seen[shown.structure, shown.cost] = looked
            spent += looked[0].spent
        seen, misfit = self._seen[shown.structure, shown.cost]
        best = own if own.idle else seen
        values = tuple((name, float(best.values[name])) for name in structure.parameters)
        return Evaluated(values, replace(misfit, share=self.share), own.free, spent, own.idle)

    def _looked(self, fitted: Fitted) -> tuple[Fitted, Misfit]:
        """A fit as it is judged, with what that takes, and its misfit; at level ``accurate`` where that matters."""
        doubtful = self._doubtful(fitted)
        task = self._accurate if doubtful else self.fits.task
        seen = self._sharpened(fitted) if doubtful else replace(fitted, spent=SimulationCount())
        spent = seen.spent + task.problem(fitted.structure).spent(1)
        return replace(seen, spent=spent), self._misfit(task, seen)

    def _doubtful(self, fitted: Fitted) -> bool:
        """Whether a fit is no worse than what the simulation of the search may be off by."""
        task = self.fits.task
        weights = task.problem(fitted.structure).weights
        return task.settings.level == "fast" and fitted.cost <= float(
            task.error_floor(weights, FAST_LEVEL_ACCURACY).sum()
        )

    def _sharpened(self, fitted: Fitted) -> Fitted:
        """The same at level ``accurate``.

        What the simulation makes wrong is no chance: another effect takes part of it off, and a criterion that expects
        chance takes that for evidence.
        """
        space = self._accurate.space(fitted.structure, initial=True)
        begin = np.array([fitted.values[name] for name in space.names])
        end = last_descent(self._accurate, fitted.structure, begin)
        values = {**fitted.values, **dict(zip(space.names, end.values.tolist(), strict=True))}
        spent = self._accurate.problem(fitted.structure).spent(end.simulations)
        return replace(fitted, values=values, cost=end.cost, spent=spent, information=None)

    def _misfit(self, task: IdentificationTask, fitted: Fitted) -> Misfit:
        space = task.space(fitted.structure, initial=True)
        names = (*fitted.structure.parameters, *(n for n in space.names if n not in fitted.structure.parameters))
        (misfit,) = task.misfits(fitted.structure, {name: np.array([fitted.values[name]]) for name in names})
        return misfit
