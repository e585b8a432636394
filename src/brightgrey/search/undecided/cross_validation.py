"""Cross-validation: a part of the recordings is predicted by a model that was fitted to the rest.

Where the residual is noise, the deviance decides best. Where it holds model error, whitening passes over slow errors
that spoil a simulation. Predictions show them: of another recording whether they follow the motion, and of the other
half of the same recordings whether they stay.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from brightgrey.estimation.optimisation.least_squares import polish
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.kit import Placed, Structure
from brightgrey.recordings import Recording
from brightgrey.recordings.policy import READING
from brightgrey.search.detectability import Detectability
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.refined_fit import Refined
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.parallel import in_order
from brightgrey.search.policy import SELECTION
from brightgrey.search.task import IdentificationTask

__all__ = [
    "Fold",
    "LeftOut",
    "each_half",
    "each_recording",
    "extended_by_prediction",
    "missed",
    "predict_left_out",
]

Fold = tuple[tuple[Recording, ...], tuple[Recording, ...]]
"""Recordings, or parts of them, that are fitted, and others that are predicted from them."""


def each_recording(recordings: Sequence[Recording]) -> list[Fold]:
    """Leave out each recording in turn."""
    return [((*recordings[:k], *recordings[k + 1 :]), (recording,)) for k, recording in enumerate(recordings)]


def each_half(recordings: Sequence[Recording]) -> list[Fold]:
    """Leave out the second half of every recording, then the first; nothing if a half is too short."""
    if any(r.samples < 2 * READING.min_samples for r in recordings):
        return []
    first, second = (tuple(_half(r, late) for r in recordings) for late in (False, True))
    return [(first, second), (second, first)]


def _half(recording: Recording, late: bool) -> Recording:
    middle = recording.samples // 2
    rows = slice(middle, None) if late else slice(middle)
    return replace(recording, t=recording.t[rows], u=recording.u[rows], y=recording.y[:, rows])


def predict_left_out(
    task: IdentificationTask, structure: Structure, values: Mapping[str, float], folds: Sequence[Fold]
) -> tuple[float, ...]:
    """NRMSE fit in percent of each part that is left out, by a model that is fitted to the rest from `values`, SI."""
    fits = []
    for known, left_out in folds:
        rest = replace(task, recordings=known)
        problem, space = rest.problem_and_space(structure)
        start = [values.get(n, v) for n, v in zip(space.names, space.start, strict=True)]
        end = polish(problem, space, rest.settings, np.clip(start, space.low, space.high), tolerance=1e-4)
        found = dict(zip(space.names, end.values.tolist(), strict=True)) | dict(space.fixed)
        own = {n: v for n, v in found.items() if n in structure.parameters or n == FRICTION_WIDTH}
        fits += [replace(task, recordings=(r,)).misfit(structure, own).fit_percent for r in left_out]
    return tuple(fits)


def missed(left_out: Sequence[float]) -> float:
    """Part of the motion that predictions with such fits miss: squares of percent, summed over the recordings.

    A recording that hardly moves is missed as a whole at most: its fit may be far below zero.
    """
    return float(sum(min(100.0 - fit, 100.0) ** 2 for fit in left_out))


@dataclass(frozen=True)
class LeftOut:
    """Predictions of what is left out, kept by structure; empty ones for fewer than three recordings."""

    fits: FitTable
    executor: Executor
    split: Callable[[Sequence[Recording]], list[Fold]] = each_recording
    _known: dict[Structure, tuple[StructureFit | Refined, tuple[float, ...]]] = field(default_factory=dict)

    @property
    def task(self) -> IdentificationTask:
        """The task of the search; it changes where friction becomes exact."""
        return self.fits.task

    def of(self, fitted: Sequence[StructureFit | Refined]) -> list[tuple[float, ...]]:
        """NRMSE fit in percent of each part that is left out, for each fit."""
        if len(self.task.recordings) < SELECTION.least_recordings:
            return [()] * len(fitted)
        new = [f for f in fitted if f.structure not in self._known or self._known[f.structure][0] is not f]
        folds = self.split(self.task.recordings)
        found = in_order(self.executor, predict_left_out, [(self.task, f.structure, f.values, folds) for f in new])
        self._known.update((f.structure, (f, percent)) for f, percent in zip(new, found, strict=True))
        return [self._known[f.structure][1] for f in fitted]


def extended_by_prediction(
    detectability: Detectability,
    predictions: LeftOut,
    first: Structure,
    optional: Collection[str],
    is_known: Callable[[Structure], bool],
) -> Structure:
    """A structure with those optional effects by which the recordings predict each other notably better, one by one.

    An effect is added where the fit and the predictions both miss a notable part less, and no recording misses as much
    more than it did without any of them. Recordings are predicted by the others, and by the other half of all. Masses
    and gaps are not added: a mass may follow any error of the model, and a gap takes a search of its own.

    Parameters
    ----------
    detectability : Detectability
        Of the last round. Its residual holds model error; otherwise the structure stays as it is.
    predictions : LeftOut
        Of each recording.
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
    halves = LeftOut(fits, predictions.executor, each_half)

    def missed_by_recording(fitted: Sequence[StructureFit]) -> list[list[float]]:
        predicted = zip(predictions.of(fitted), halves.of(fitted), strict=True)
        count = len(predictions.task.recordings)
        return [[missed([w, *h[k::count]]) for k, w in enumerate(whole)] for whole, h in predicted]

    known, own = is_known(first), fits.done[first]
    (at_first,) = missed_by_recording([own])
    while True:
        more = [e for e in effects if detectability.can_be_added(own.structure, e)]
        larger = [detectability.with_effect(own.structure, e) for e in more]
        near = [
            f for f in _fits_of_larger(fits, own, larger, predictions.executor) if (1.0 + growth) * f.cost < own.cost
        ]
        before, *found = missed_by_recording([own, *near])
        notable = growth * sum(before)
        better = [
            (sum(after), f)
            for f, after in zip(near, found, strict=True)
            if sum(after) + notable < sum(before)
            and all(new <= old + notable for new, old in zip(after, at_first, strict=True))
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
