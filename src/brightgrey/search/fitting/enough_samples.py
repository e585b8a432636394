"""Samples that a search leaves out: whether that shows in the residual of a fit, and how many it has to keep.

A recording is decimated before anything is fitted, by what a rigid drive would notice. A resonance may amplify the
error, and what is left by the best fit says how small it has to be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from brightgrey.arrays import Array, positive
from brightgrey.estimation.problem.decimation import decimated
from brightgrey.estimation.problem.segments import split_recordings
from brightgrey.recordings import Recording
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.task import IdentificationTask

__all__ = ["with_enough_samples"]


def with_enough_samples(
    task: IdentificationTask, whole: Sequence[Recording], fitted: StructureFit, independent: float
) -> IdentificationTask | None:
    """The task with as many samples as it takes that the others do not show; None if it has them.

    Of n independent residuals an autocorrelation of 1/sqrt(n) shows. So the error that decimation makes of the motion
    may have that part of the sum of squares which a fit leaves. None, too, where every second sample is not enough: a
    fit that sticks now and then is so sensitive that nothing helps.

    Parameters
    ----------
    task : IdentificationTask
        With every k-th sample.
    whole : sequence of Recording
        The same recordings with all samples.
    fitted : StructureFit
        The best one.
    independent : float
        Number of independent samples that its residuals are worth.
    """
    factor = (whole[0].samples - 1) // (task.recordings[0].samples - 1)
    exact = _errors(replace(task, recordings=tuple(whole)), fitted) if factor > 1 else ()
    for k in range(factor, 1, -1):
        coarse = task if k == factor else replace(task, recordings=tuple(decimated(r, k) for r in whole))
        shows = 0.0
        for r, of_all, own in zip(whole, exact, _errors(coarse, fitted), strict=True):
            error = own - decimated(replace(r, y=of_all), k).y
            scale = positive(np.square(own).sum(axis=1))
            shows = max(shows, float(np.max(np.square(error).sum(axis=1) / scale)))
        if shows <= 1.0 / np.sqrt(positive(independent)):
            return None if k == factor else coarse
    return replace(task, recordings=tuple(whole)) if factor == 2 else None


def _errors(task: IdentificationTask, fitted: StructureFit) -> list[Array]:
    """Residuals of a fit, in SI, shape (outputs, samples) for each recording."""
    problem, space = task.problem_and_space(fitted.structure)
    start = {**dict(zip(space.names, space.start.tolist(), strict=True)), **space.fixed, **fitted.values}
    residual = problem.residuals({name: np.array([value]) for name, value in start.items()}, task.settings)[:, 0]
    return [part / problem.weights[:, None] for _, part in split_recordings(residual, task.recordings)]
