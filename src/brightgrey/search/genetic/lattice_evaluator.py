"""Evaluation of individuals from the optima of neighbouring structures, as in the search of all structures."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from brightgrey.estimation.noise.autoregression import autoregression
from brightgrey.estimation.problem.segments import segment_lengths, split_segments
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.kit import Structure
from brightgrey.search.criteria import Criterion, Misfit
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.missed_optima import find_missed_optima
from brightgrey.search.fitting.structure_fit import Options, StructureFit, last_descent, ranges_within_decade
from brightgrey.search.genetic.evaluation import Evaluated, Job
from brightgrey.search.genetic.history import Evaluation, Run
from brightgrey.search.genetic.offspring import Offspring
from brightgrey.search.genetic.settings import HEURISTICS
from brightgrey.search.genetic.tree import tree_of, with_values
from brightgrey.search.lattice import contains
from brightgrey.search.task import FAST_LEVEL_ACCURACY, IdentificationTask

__all__ = ["LatticeEvaluator"]


@dataclass(frozen=True)
class _Bar:
    """Best value of the criterion after so many fits, and the least cost of any fit that contains a structure."""

    fits: int
    share: float
    best: float
    least: dict[Structure, float] = field(default_factory=dict)


class LatticeEvaluator:
    """Evaluator that fits each structure once, and again where the optimum of a neighbouring structure helps.

    From the first search for missed optima on, a structure that has lost by the criterion is not fitted again.

    Parameters
    ----------
    task : IdentificationTask
    structures : sequence of Structure
        Structures of the grammar without what it holds back: fits by multistart are made among them.
    executor : concurrent.futures.Executor
        Makes the fits.
    criterion : Criterion
    options : Options, optional
        Effort of each structure's fit.
    seed : int
    generations : int
        Number of the last generation, after which missed optima are looked for.
    holds_back : bool
        True if the grammar holds effects back, which individuals may have.

    Attributes
    ----------
    fits : FitTable
    improved : tuple of Structure
        Structures that the latest generation has improved or fitted beside its individuals.
    share : float
        Independent samples over all samples, by the residual of the best fit so far.
    """

    def __init__(
        self,
        task: IdentificationTask,
        structures: Sequence[Structure],
        executor: Executor,
        criterion: Criterion,
        *,
        options: Options | None = None,
        seed: int = 0,
        generations: int = 0,
        holds_back: bool = False,
    ) -> None:
        self.fits = FitTable(task, structures, options=options, seed=seed, should_refit=self.can_still_win)
        self.improved, self.share = tuple[Structure, ...](), 1.0
        self._executor, self._criterion = executor, criterion
        self._generations, self._holds_back = generations, holds_back
        self._weights = task.problem(structures[0]).weights
        self._error_floor = float(task.error_floor(self._weights, FAST_LEVEL_ACCURACY).sum())
        self._free: dict[Structure, int] = {}
        self._bar: _Bar | None = None
        self._searched_missed = False
        self._accurate = replace(task, settings=replace(task.settings, level="accurate"))
        self._assessed: dict[tuple[Structure, float], tuple[StructureFit, Misfit]] = {}

    def evaluate(self, generation: int, born: Sequence[Offspring]) -> list[Evaluation]:
        """Fit the structures of a generation."""
        results = self.identify([individual.tree.structure for individual in born])
        return [
            Evaluation.of(
                generation,
                number,
                individual,
                Job(individual.tree.structure, ()),
                result,
                self._criterion,
                repeated=repeated,
            )
            for number, (individual, (result, repeated)) in enumerate(zip(born, results, strict=True))
        ]

    def revise(self, evaluations: Sequence[Evaluation]) -> list[Evaluation]:
        """Restart the best structure, append what got better beside the individuals, and judge all by one noise model.

        The simulations of the restart and of the noise model serve all structures. They are counted with the last
        evaluation of the generation, so that the sum over all evaluations is what the search has simulated.
        """
        generation = evaluations[-1].generation
        spent = self.restart(Run(tuple(evaluations)).best.job.structure)
        if generation in self._restart_generations():
            spent += self.restart_leaders()
        *others, last = (*evaluations, *self._evaluations_beside(evaluations))
        spent += self.update_effective_samples()
        counted = replace(last, result=replace(last.result, spent=last.result.spent + spent))
        return [self._judged_again(evaluation) for evaluation in (*others, counted)]

    def has_lost(self, structure: Structure) -> bool:
        """True if a structure, fitted or not, cannot win any more."""
        return not self.can_still_win(structure)

    def identify(self, structures: Sequence[Structure]) -> list[tuple[Evaluated, bool]]:
        """Results in the order of `structures`; a structure that was fitted before is marked.

        If there is a new structure, optima with a hard limit are continued to submodels: the next generation is bred
        from the leading structures.
        """
        fits = self.fits
        unknown = [s for s in dict.fromkeys(structures) if s not in fits.done]
        counted = len(fits.spent)
        better = fits.add(unknown, self._executor) | fits.continue_to_submodels(self._executor) if unknown else set()
        self.improved = tuple(s for s in fits.done if s in better and s not in structures)
        spent = self._spent(counted)  # counted with the first of them: anchors serve them all
        out, first = [], set(unknown)
        for s in structures:
            out.append((self.result_of(s, spent if s in first else SimulationCount()), s not in first))
            spent = SimulationCount() if s in first else spent
            first.discard(s)
        return out

    @property
    def narrow(self) -> bool:
        """True if the ranges of all structures are narrow, as a user gives them."""
        task = self.fits.task
        return all(ranges_within_decade(task.space(s, nuisances=True)) for s in self.fits.structures)

    def can_still_win(self, structure: Structure, cost: float = 0.0) -> bool:
        """Return False if a structure cannot reach the best value of the criterion.

        Its cost is at least that of the best fit that contains it, and at least `cost`, the optimum that it is offered.
        All structures may win where no such bound holds. That is so if no fit contains the structure, if the criterion
        weighs several outputs, or if the user has bounded or fixed a parameter. Until missed optima have been looked
        for, it holds for none.
        """
        fits, task = self.fits, self.fits.task
        if not self._searched_missed or len(self._weights) > 1 or task.bounds or task.fixed:
            return True
        bar = self._bar
        if bar is None or (bar.fits, bar.share) != (len(fits.log), self.share):
            values = (self._value(f.cost, f.free) for f in fits.done.values() if not f.redundant_effects)
            bar = self._bar = _Bar(len(fits.log), self.share, max(values, default=-np.inf))
        if structure not in bar.least:
            around = (f.cost for t, f in fits.done.items() if contains(t, structure))
            bar.least[structure] = min(around, default=0.0)
        if structure not in self._free:
            self._free[structure] = len(task.space(structure, nuisances=True).names)
        least = bar.least[structure]
        return least == 0.0 or self._value(max(cost, least), self._free[structure]) >= bar.best

    def restart(self, structure: Structure) -> SimulationCount:
        """Fit a structure once by multistart, if that has not been done; returns what was simulated."""
        counted = len(self.fits.spent)
        if structure in self.fits.structures:
            self._note_improved(self.fits.restart(structure, self._executor))
        return self._spent(counted)

    def restart_leaders(self) -> SimulationCount:
        """Look for missed optima, above all those with a hard limit; returns what was simulated."""
        counted, before = len(self.fits.spent), dict(self.fits.done)
        self._searched_missed = True
        find_missed_optima(self.fits, self._executor)
        self._note_improved({s for s, fitted in self.fits.done.items() if fitted is not before.get(s)})
        return self._spent(counted)

    def update_effective_samples(self) -> SimulationCount:
        """Update `share` from the residual of the best fit, taken as noise; returns what was simulated."""
        task = self.fits.task
        best = min((f for f in self.fits.done.values() if not f.redundant_effects), key=lambda f: (f.cost, f.free))
        values = {name: np.array([value]) for name, value in best.values.items()}
        problem = task.problem(best.structure)
        residual = problem.residuals(values, task.settings)[:, 0]
        pieces = split_segments(residual, segment_lengths(task.recordings))
        independent = sum(autoregression(piece).effective_samples_variance(len(piece)) for piece in pieces)
        self.share = independent / len(residual)
        return problem.count(1)

    def result_of(self, structure: Structure, spent: SimulationCount | None = None) -> Evaluated:
        """Present result of a structure, with the simulations `spent` on it.

        The misfit is that without redundant effects.
        """
        own, spent = self.fits.done[structure], spent or SimulationCount()
        shown = own if own.equals is None else self.fits.done[own.equals]
        if (shown.structure, shown.cost) not in self._assessed:
            assessed = self._assess(shown)
            self._assessed[shown.structure, shown.cost] = assessed
            spent += assessed[0].spent
        accurate, misfit = self._assessed[shown.structure, shown.cost]
        best = own if own.redundant_effects else accurate
        values = tuple((name, float(best.values[name])) for name in structure.parameters)
        return Evaluated(values, replace(misfit, share=self.share), own.free, spent, own.redundant_effects)

    def _restart_generations(self) -> set[int]:
        """Generations after which missed optima are looked for: early ones, too, since they say which structures lose.

        Within narrow ranges little is missed, and the search is made after the last generation only. So it is where the
        grammar holds effects back: few of so many structures contain one another, and hardly any is known to lose.
        """
        last = self._generations
        if self.narrow or self._holds_back:
            return {last}
        return {last, *(max(1, last // part) for part in HEURISTICS.early_restarts)}

    def _evaluations_beside(self, evaluations: Sequence[Evaluation]) -> list[Evaluation]:
        """Evaluations of structures that got better or were never bred, numbered after the latest individuals."""
        latest, known = evaluations[-1], {e.job.structure: e.tree for e in evaluations}
        out = []
        for number, structure in enumerate(self.improved, latest.individual + 1):
            result = self.result_of(structure)
            values = dict(result.values)
            tree = with_values(known[structure], values) if structure in known else tree_of(structure, values)
            individual = Offspring(tree, (), "neighbours")
            job = Job(structure, ())
            out.append(Evaluation.of(latest.generation, number, individual, job, result, self._criterion))
        return out

    def _judged_again(self, evaluation: Evaluation) -> Evaluation:
        """The evaluation by the present share of independent samples."""
        result = evaluation.result
        misfit = replace(result.misfit, share=self.share)
        value = self._criterion.value(misfit, result.n_parameters)
        return replace(evaluation, result=replace(result, misfit=misfit), value=value)

    def _value(self, cost: float, free: int) -> float:
        """Criterion of a fit by its cost; differences within the simulation's own error hardly count."""
        task = self.fits.task
        samples = sum(r.samples for r in task.recordings)
        least = sum(r.samples * float(r.resolution[0] * self._weights[0]) ** 2 / 12.0 for r in task.recordings)
        misfit = Misfit((cost + self._error_floor,), (least,), samples, (1.0,), self.share)
        return self._criterion.value(misfit, free)

    def _note_improved(self, better: Collection[Structure]) -> None:
        self.improved = tuple(s for s in self.fits.done if s in better or s in self.improved)

    def _spent(self, counted: int) -> SimulationCount:
        """Simulations of fits after the first `counted` entries."""
        return sum(self.fits.spent[counted:], SimulationCount())

    def _assess(self, fitted: StructureFit) -> tuple[StructureFit, Misfit]:
        """A fit with its misfit, polished at level ``accurate`` where the search level's own error matters."""
        within_error = self._within_error(fitted)
        task = self._accurate if within_error else self.fits.task
        own = self._polished(fitted) if within_error else replace(fitted, spent=SimulationCount())
        spent = own.spent + task.problem(fitted.structure).count(1)
        return replace(own, spent=spent), task.misfit(own.structure, own.values)

    def _within_error(self, fitted: StructureFit) -> bool:
        """True if a fit's cost is no more than the error of the search's simulation."""
        task = self.fits.task
        weights = task.problem(fitted.structure).weights
        floor = float(task.error_floor(weights, FAST_LEVEL_ACCURACY).sum())
        return task.settings.level == "fast" and fitted.cost <= floor

    def _polished(self, fitted: StructureFit) -> StructureFit:
        """The fit at level ``accurate``.

        Errors of the simulation are not random. Another effect removes part of them, and a criterion that assumes
        random noise takes that for evidence.
        """
        space = self._accurate.space(fitted.structure, nuisances=True)
        start = np.array([fitted.values[name] for name in space.names])
        end = last_descent(self._accurate, fitted.structure, start)
        values = {**fitted.values, **dict(zip(space.names, end.values.tolist(), strict=True))}
        spent = self._accurate.problem(fitted.structure).count(end.simulations)
        return replace(fitted, values=values, cost=end.cost, spent=spent, information=None)
