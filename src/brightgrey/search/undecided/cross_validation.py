"""Leave-one-out cross-validation: each recording is predicted by a model that was fitted to the others.

Where the residual is noise, the deviance decides best. Where it holds model error, whitening passes over slow errors
that spoil a simulation. The prediction of another recording shows them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from brightgrey.estimation.optimisation.least_squares import polish
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.kit import Placed, Structure
from brightgrey.search.detectability import Detectability
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.refined_fit import Refined
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.parallel import in_order
from brightgrey.search.policy import SELECTION
from brightgrey.search.task import IdentificationTask

__all__ = ["LeftOutRecordings", "extended_by_prediction", "missed", "predict_left_out"]


def predict_left_out(task: IdentificationTask, structure: Structure, values: Mapping[str, float]) -> tuple[float, ...]:
    """NRMSE fit in percent of each recording by a model that is fitted to the others, from `values`, SI."""
    fits = []
    for k, recording in enumerate(task.recordings):
        others = replace(task, recordings=(*task.recordings[:k], *task.recordings[k + 1 :]))
        problem, space = others.problem_and_space(structure)
        start = [values.get(n, v) for n, v in zip(space.names, space.start, strict=True)]
        end = polish(problem, space, others.settings, np.clip(start, space.low, space.high), tolerance=1e-4)
        found = dict(zip(space.names, end.values.tolist(), strict=True)) | dict(space.fixed)
        own = {n: v for n, v in found.items() if n in structure.parameters or n == FRICTION_WIDTH}
        fits.append(replace(task, recordings=(recording,)).misfit(structure, own).fit_percent)
    return tuple(fits)


def missed(left_out: Sequence[float]) -> float:
    """Part of the motion that predictions with such fits miss: squares of percent, summed over the recordings.

    A recording that hardly moves is missed as a whole at most: its fit may be far below zero.
    """
    return float(sum(min(100.0 - fit, 100.0) ** 2 for fit in left_out))


@dataclass(frozen=True)
class LeftOutRecordings:
    """Predictions of the recordings of a search, kept by structure; empty ones for fewer than three recordings."""

    fits: FitTable
    executor: Executor
    _known: dict[Structure, tuple[StructureFit | Refined, tuple[float, ...]]] = field(default_factory=dict)

    @property
    def task(self) -> IdentificationTask:
        """The task of the search; it changes where friction becomes exact."""
        return self.fits.task

    def of(self, fitted: Sequence[StructureFit | Refined]) -> list[tuple[float, ...]]:
        """NRMSE fit in percent of each recording by a model of the others, for each fit."""
        if len(self.task.recordings) < SELECTION.least_recordings:
            return [()] * len(fitted)
        new = [f for f in fitted if f.structure not in self._known or self._known[f.structure][0] is not f]
        found = in_order(self.executor, predict_left_out, [(self.task, f.structure, f.values) for f in new])
        self._known.update((f.structure, (f, percent)) for f, percent in zip(new, found, strict=True))
        return [self._known[f.structure][1] for f in fitted]


def extended_by_prediction(
    detectability: Detectability,
    predictions: LeftOutRecordings,
    first: Structure,
    optional: Collection[str],
    is_known: Callable[[Structure], bool],
) -> Structure:
    """A structure with those optional effects by which the recordings predict each other notably better, one by one.

    An effect is added where the fit and the predictions both miss a notable part less, and no recording misses as much
    more than it did without any of them. Masses and gaps are not added: a mass may follow any error of the model, and a
    gap takes a search of its own.

    Parameters
    ----------
    detectability : Detectability
        Of the last round. Its residual holds model error; otherwise the structure stays as it is.
    predictions : LeftOutRecordings
    first : Structure
        The first of the minimal structures, without effects that help in some parts of the recordings only.
    optional : collection of str
        Effects that may be added.
    is_known : callable
        True for a structure of which every parameter is known. Then the larger one has to be known as well.
    """
    growth, fits = detectability.circumstances.material_growth, detectability.refined.fits
    if not detectability.circumstances.model_error or len(predictions.task.recordings) < SELECTION.least_recordings:
        return first
    effects = [e for e in optional if not (Placed.parse(e).effect.masses or Placed.parse(e).effect.has_hard_limit)]
    known, own = is_known(first), fits.done[first]
    (at_first,) = predictions.of([own])
    while True:
        more = [e for e in effects if detectability.can_be_added(own.structure, e)]
        larger = [detectability.with_effect(own.structure, e) for e in more]
        near = [
            f for f in _fits_of_larger(fits, own, larger, predictions.executor) if (1.0 + growth) * f.cost < own.cost
        ]
        before, *found = predictions.of([own, *near])
        notable = growth * missed(before)
        better = [
            (missed(after), f)
            for f, after in zip(near, found, strict=True)
            if missed(after) + notable < missed(before)
            and all(missed([new]) <= missed([old]) + notable for new, old in zip(after, at_first, strict=True))
        ]
        for _, f in sorted(better, key=lambda pair: pair[0]):
            fits.done.setdefault(f.structure, f)
            if is_known(f.structure) or not known:
                own = f
                break
        else:
            return own.structure


def _fits_of_larger(
    fits: FitTable, own: StructureFit, larger: Sequence[Structure], workers: Executor
) -> list[StructureFit]:
    """Fits of larger structures: those of the table, and of others from the values of a smaller one."""
    tried = fits.tried([(s, own.values) for s in larger if s not in fits.done], workers)
    known = {f.structure: f for f in tried}
    return [known.get(s) or fits.done[s] for s in larger]
