"""State of a search: its task, its lattice and the table of fits, which begins anew where the task changes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from brightgrey.kit import Structure
from brightgrey.recordings import Recording
from brightgrey.search.adequacy import material_growth
from brightgrey.search.fitting.anchors import anchors
from brightgrey.search.fitting.enough_samples import with_enough_samples
from brightgrey.search.fitting.exact_friction import refit_all, reverses_at_once
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.missed_optima import is_explained
from brightgrey.search.fitting.refined_fit import effective_samples_of
from brightgrey.search.fitting.structure_fit import Options, StructureFit
from brightgrey.search.lattice import Lattice
from brightgrey.search.policy import FURTHER, REFIT, SELECTION
from brightgrey.search.task import IdentificationTask

__all__ = ["SearchState"]


@dataclass
class SearchState:
    """Task, lattice and table of fits of a search."""

    task: IdentificationTask
    lattice: Lattice
    executor: Executor
    seed: int = 0
    recordings: tuple[Recording, ...] = ()  #: With all samples, where the task may be given more of them.
    options: Options = field(default_factory=lambda: Options(patience=0, fresh_hard_limit=2))
    progress: Callable[[str, int, Structure], None] = field(default_factory=lambda: lambda stage, fits, best: None)

    def __post_init__(self) -> None:
        self.anchors = anchors(self.lattice)
        self.fits = FitTable(self.task, (), options=self.options, seed=self.seed, anchors=self.anchors)
        self.restarts: dict[Structure, int] = {}  # multistarts of each structure
        self._asked_cost = np.inf  # of the best fit that was asked for samples and exact friction

    def fit(self, structures: Sequence[Structure]) -> None:
        """Fit structures from their neighbours' optima, and their neighbours anew where that helps."""
        new = [s for s in structures if s not in self.fits.done]
        if new:
            self.fits.add(new, self.executor)
            self.progress("fits", len(self.fits.done), self.fits.best().structure)

    def changes_task(self, is_simpler: Callable[[], bool] = lambda: False) -> bool:
        """Take more samples, or exact friction, for all structures; returns False if neither is called for.

        Samples are called for by the error that the others make of the best fit. Exact friction is if the best fit
        explains more with it, or if a model `is_simpler`. Each best fit is asked once.
        """
        best, asked = self.fits.best(), self._asked_cost
        self._asked_cost = best.cost
        is_new, changed = best.cost < REFIT.improved * asked, False
        if is_new and (finer := self.with_enough_samples(best)) is not None:
            self.take_task(finer)
            best, changed = self.fits.best(), True
            self._asked_cost = best.cost
        notable = material_growth(model_error=True)  # what leads so early may have any model error
        if (is_new and reverses_at_once(self.task, best, notable)) or (not changed and is_simpler()):
            self.take_task(replace(self.task, exact_friction=True))
            changed = True
        return changed

    def with_enough_samples(self, best: StructureFit) -> IdentificationTask | None:
        """The task with more samples if the best fit shows that some are missing; None if not.

        A residual with few independent samples is model error, which is larger than the error of decimation.
        """
        if not (self.recordings and np.isfinite(best.cost)):
            return None
        independent = effective_samples_of(self.task, best)
        few = independent <= SELECTION.few_samples
        return None if few else with_enough_samples(self.task, self.recordings, best, independent)

    def take_task(self, task: IdentificationTask) -> None:
        """Fit all structures again for a task that has changed."""
        self.task = self.fits.task = task
        refit_all(self.fits, self.executor)
        self.restarts.clear()

    def is_explained(self, fitted: StructureFit | None = None) -> bool:
        """True if the residual of a fit, the best by default, is white or no larger than known errors."""
        return is_explained(self.fits, fitted)

    def fits_poorly(self) -> bool:
        """True if the best fit is poor, and its residual neither white nor within the accuracy of the simulation."""
        return self.fits.fit_percent(self.fits.best()) < FURTHER.poor_fit and not self.is_explained()
