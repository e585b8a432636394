"""Cross-validation: a part of the recordings is predicted by a model that was fitted to the rest.

Where the residual is noise, the deviance decides best. Where it holds model error, whitening passes over slow errors
that spoil a simulation. Predictions tell of an effect that fits better whether it follows such an error: of another
recording, and of the other half of the same ones.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.noise.residual_analysis import nrmse_fit_percent
from brightgrey.estimation.optimisation.least_squares import polish
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.kit import Placed, Structure
from brightgrey.search.detectability import Detectability
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.refined_fit import Refined, accurate, refine
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.parallel import in_order
from brightgrey.search.policy import SELECTION
from brightgrey.search.task import IdentificationTask

__all__ = ["LeftOut", "extended_unless_contradicted", "missed", "predict_halves", "predict_left_out"]


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


@dataclass(frozen=True)
class _Rows:
    """The residuals that a fit counts, in the place of whitening."""

    counted: Array  #: True for each residual that counts.
    floor_deviance: float = 0.0

    def whiten(self, residuals: Array) -> Array:
        """Those residuals that count, or rows of their Jacobian."""
        return np.asarray(residuals[self.counted])


def predict_halves(task: IdentificationTask, structure: Structure, values: Mapping[str, float]) -> tuple[float, ...]:
    """NRMSE fit in percent of each recording, whose halves are predicted by models of the other halves of all.

    All recordings are simulated from their beginning, and the fits from `values`, SI, count one half of the residuals.
    So the state in the middle is that of the model, and nuisances belong to whole recordings.
    """
    problem, settings = task.problem(structure), accurate(task).settings
    early = [np.arange(r.samples) < r.samples // 2 for r in task.recordings]
    first = np.concatenate([np.tile(half, len(r.outputs)) for half, r in zip(early, task.recordings, strict=True)])
    apart = np.empty(first.size)
    for counted in (first, ~first):
        end = refine(task, structure, values, _Rows(counted), np.inf)
        named = {name: np.array([value]) for name, value in end.values.items()}
        apart[~counted] = problem.residuals(named, settings)[~counted, 0]
    parts = np.split(apart, np.cumsum([r.y.size for r in task.recordings])[:-1])
    motions = [(problem.weights[:, None] * (r.y - r.y.mean(axis=1, keepdims=True))).ravel() for r in task.recordings]
    return tuple(nrmse_fit_percent(float(e @ e), float(m @ m)) for e, m in zip(parts, motions, strict=True))


def missed(left_out: Sequence[float]) -> float:
    """Part of the motion that predictions with such fits miss: squares of percent, summed over the recordings.

    A recording that hardly moves is missed as a whole at most: its fit may be far below zero.
    """
    return float(sum(min(100.0 - fit, 100.0) ** 2 for fit in left_out))


@dataclass(frozen=True)
class LeftOut:
    """Predictions of the recordings of a search, kept by structure; empty ones for fewer than three recordings."""

    fits: FitTable
    executor: Executor
    predict: Callable[[IdentificationTask, Structure, Mapping[str, float]], tuple[float, ...]] = predict_left_out
    _known: dict[Structure, tuple[StructureFit | Refined, tuple[float, ...]]] = field(default_factory=dict)

    @property
    def task(self) -> IdentificationTask:
        """The task of the search; it changes where friction becomes exact."""
        return self.fits.task

    def of(self, fitted: Sequence[StructureFit | Refined]) -> list[tuple[float, ...]]:
        """NRMSE fit in percent of each recording by models that have not seen what they predict, for each fit."""
        if len(self.task.recordings) < SELECTION.least_recordings:
            return [()] * len(fitted)
        new = [f for f in fitted if f.structure not in self._known or self._known[f.structure][0] is not f]
        found = in_order(self.executor, self.predict, [(self.task, f.structure, f.values) for f in new])
        self._known.update((f.structure, (f, percent)) for f, percent in zip(new, found, strict=True))
        return [self._known[f.structure][1] for f in fitted]


def extended_unless_contradicted(
    detectability: Detectability,
    predictions: LeftOut,
    first: Structure,
    optional: Collection[str],
    is_known: Callable[[Structure], bool],
    is_beyond_chance: Callable[[StructureFit, StructureFit, int], bool],
) -> Structure:
    """A structure with those optional effects that fit notably better, if predictions do not contradict, one by one.

    An effect is added where the fit misses a notable part less, by more than chance explains, and predictions do not
    miss as much more than the best so far. Each recording is predicted by the others, and each half of all by the
    other. Masses and gaps are not added: a mass may follow any error of the model, and a gap takes a search of its own.

    Parameters
    ----------
    detectability : Detectability
        Of the last round. Its residual holds model error; otherwise the structure stays as it is.
    predictions : LeftOut
        Of recordings by the others.
    first : Structure
        The first of the minimal structures, without effects that help in some parts of the recordings only.
    optional : collection of str
        Effects that may be added.
    is_known : callable
        True for a structure of which every parameter is known. Then the larger one has to be known as well.
    is_beyond_chance : callable
        True if a fit with further effects explains more than chance does, given the fit without and the fit with them,
        and how many were tried.
    """
    growth, fits = detectability.circumstances.material_growth, detectability.refined.fits
    if not detectability.circumstances.model_error or len(predictions.task.recordings) < SELECTION.least_recordings:
        return first
    effects = [e for e in optional if not (Placed.parse(e).effect.masses or Placed.parse(e).effect.has_hard_limit)]
    halves = LeftOut(fits, predictions.executor, predict_halves)

    def all_missed(fitted: Sequence[StructureFit]) -> list[float]:
        return [missed(w) + missed(h) for w, h in zip(predictions.of(fitted), halves.of(fitted), strict=True)]

    known, own = is_known(first), fits.done[first]
    (least,) = all_missed([own])
    while True:
        more = [e for e in effects if detectability.can_be_added(own.structure, e)]
        larger = [detectability.with_effect(own.structure, e) for e in more]
        near = [
            f
            for f in _fits_of_larger(fits, own, larger, predictions.executor)
            if (1.0 + growth) * f.cost < own.cost and is_beyond_chance(own, f, len(larger))
        ]
        enough = (1.0 + growth) * least
        better = [(after, f) for after, f in zip(all_missed(near), near, strict=True) if after <= enough]
        for missing, f in sorted(better, key=lambda pair: pair[0]):
            fits.done.setdefault(f.structure, f)
            if is_known(f.structure) or not known:
                own, least = f, min(least, missing)
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
