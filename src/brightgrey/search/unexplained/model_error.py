"""Model error: patterns in a residual that stationary noise does not make, and that a model could explain.

A residual that is not white may be nothing but coloured noise of a sensor. Then statistics hold, and further effects
are not called for. Where the residual follows a motion, a torque pattern or a resonance beyond its own colour, the
structures offered lack something.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.diagnostics.outcome import FitContext
from brightgrey.estimation.diagnostics.symptoms import Symptom, residual_symptoms
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian
from brightgrey.estimation.problem.segments import split_recordings
from brightgrey.estimation.uncertainty.estimates import estimates_of
from brightgrey.kit import Placed, Structure
from brightgrey.recordings import Recording
from brightgrey.search.fitting.refined_fit import accurate, residual_and_jacobian
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.policy import FURTHER, SELECTION
from brightgrey.search.task import IdentificationTask

__all__ = ["calls_for_mass", "gains_steadily", "optimum_of", "signs_of_model_error"]


def gains_steadily(own: Array, smaller: Array, recordings: Sequence[Recording]) -> bool:
    """True if the residual of a smaller structure is larger in most parts of the recordings.

    Parameters
    ----------
    own, smaller : ndarray, shape (residuals,)
        Residuals of a structure and of the smaller one, whitened or not.
    recordings : sequence of Recording
        Those that the residuals are of. The squares of all outputs of one count together.
    """
    squares = [
        np.concatenate([np.square(part).sum(axis=0) for _, part in split_recordings(residual, recordings)])
        for residual in (own, smaller)
    ]
    mine, other = (np.array([p.sum() for p in np.array_split(s, SELECTION.blocks)]) for s in squares)
    return int(np.sum(other > mine)) >= SELECTION.steady_blocks


def optimum_of(task: IdentificationTask, fitted: StructureFit) -> OptimumWithJacobian:
    """A fit of the table with its residual and Jacobian."""
    residual, jacobian, _ = residual_and_jacobian(task, fitted.structure, fitted.values)
    values = np.array([fitted.values[name] for name in task.space(fitted.structure, nuisances=True).names])
    return OptimumWithJacobian(values, float(residual @ residual), True, 0, 0, residual, jacobian)


def signs_of_model_error(
    task: IdentificationTask,
    structure: Structure,
    optimum: OptimumWithJacobian,
    floor_cost: float,
    decided: Collection[Placed] = (),
) -> tuple[str, ...]:
    """Signs that the residual of a fit holds something that the structure does not explain, one sentence each.

    Parameters
    ----------
    task : IdentificationTask
    structure : Structure
    optimum : OptimumWithJacobian
    floor_cost : float
        Sum of squares that the errors of simulation and sensor may leave: below it there is nothing to see.
    decided : collection of Placed
        Effects that a verdict is given on: what one of them may explain is no sign.
    """
    if optimum.cost <= floor_cost:
        return ()
    found = [s for s in _symptoms(task, structure, optimum) if s.unmodelled]
    return tuple(s.observation for s in found if not any(p in decided for p in s.suggested))


def calls_for_mass(task: IdentificationTask, fitted: StructureFit) -> bool:
    """True if a good part of what a fit leaves follows the response of a resonance to the input."""
    found = _symptoms(task, fitted.structure, optimum_of(task, fitted))
    return any(s.share >= FURTHER.rescued_share and any(p.effect.masses for p in s.suggested) for s in found)


def _symptoms(task: IdentificationTask, structure: Structure, optimum: OptimumWithJacobian) -> tuple[Symptom, ...]:
    """Symptoms of the residual of a fit."""
    problem, space = task.problem_and_space(structure)
    settings = accurate(task).settings
    context = FitContext(problem, space, settings, optimum, estimates_of(problem, space, settings, optimum))
    return residual_symptoms(context, task.scales)
