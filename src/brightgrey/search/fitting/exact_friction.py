"""Exact friction in a search: asked of what leads, and taken for all structures where it explains more than any width.

A smooth reversal creeps under a load that friction would hold. Where the drive rests, no width makes up for that, and
masses take the part of what is left. The simulation is less accurate with a sharp reversal than with an exact one, too.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from brightgrey.estimation.optimisation.least_squares import fit_many
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.numerics.distributions import chi2
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.refined_fit import refine, whitening_by
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.policy import REFIT, SELECTION
from brightgrey.search.task import IdentificationTask

__all__ = ["refit_all", "reverses_at_once"]


def reverses_at_once(task: IdentificationTask, fitted: StructureFit, growth: float) -> bool:
    """Return True if exact friction explains a notable part of what a fit with a width leaves, by more than chance.

    It is asked of the plain and of the whitened cost. The noise is that which exact friction leaves: beside a width the
    residual holds what no width explains.

    Parameters
    ----------
    task : IdentificationTask
    fitted : StructureFit
        Without a width that is estimated the answer is no.
    growth : float
        Growth of a cost, as a part of it, that is notable.
    """
    structure, at_once = fitted.structure, replace(task, exact_friction=True)
    if FRICTION_WIDTH not in task.space(structure, nuisances=True).names:
        return False
    problem, space = at_once.problem_and_space(structure)
    start = np.array([fitted.values[name] for name in space.names])
    limit, tolerance = REFIT.iterations, REFIT.tolerance
    beaten = fitted.cost / (1.0 + growth)
    (end,) = fit_many(
        problem, space, task.settings, start[:, None], limit=limit, tolerance=tolerance, cost_to_beat=beaten
    )
    if not end.cost < beaten:
        return False
    values = space.by_name(end.values)
    whitening = whitening_by(at_once, structure, values)
    exact = refine(at_once, structure, values, whitening, np.inf, growth)
    smooth = refine(task, structure, fitted.values, whitening, np.inf, growth)
    chance = float(chi2.isf(SELECTION.false_alarm_level, 1))
    return exact.deviance + max(chance, growth * exact.deviance) < smooth.deviance


def refit_all(fits: FitTable, workers: Executor) -> None:
    """Fit all structures of a table from their values, for a task that has changed."""
    known = {**fits.anchors, **fits.done}
    again = fits.tried([(s, f.values) for s, f in known.items()], workers)
    found = {f.structure: f for f in again}
    fits.done, fits.anchors = ({s: found[s] for s in before} for before in (fits.done, fits.anchors))
    fits.agreeing.clear()
    fits.propagate(fits.done, workers)
