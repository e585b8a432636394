"""Exact friction in a search: asked of what leads, and taken for all structures where it explains more than any width.

A smooth reversal creeps under a load that friction would hold. Where the drive rests, no width makes up for that, and
masses take the part of what is left. The simulation is less accurate with a sharp reversal than with an exact one, too.
So friction is also exact where a structure needs an effect beside a width, and does without it beside an exact sign.
The largest structures, which lead at first, may hide among their effects what the simplest one shows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from brightgrey.estimation.optimisation.least_squares import fit_many
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.kit import Structure
from brightgrey.search.adequacy import gained_by_chance
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.refined_fit import RefinedFits, refine, whitening_by
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.lattice import Lattice
from brightgrey.search.policy import REFIT
from brightgrey.search.task import IdentificationTask

__all__ = ["refit_all", "reverses_at_once", "simplifies"]


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
    values = _values_below(at_once, structure, fitted.values, fitted.cost / (1.0 + growth))
    if values is None:
        return False
    whitening = whitening_by(at_once, structure, values)
    exact = refine(at_once, structure, values, whitening, np.inf, growth)
    smooth = refine(task, structure, fitted.values, whitening, np.inf, growth)
    chance = gained_by_chance(1)
    return exact.deviance + max(chance, growth * exact.deviance) < smooth.deviance


def simplifies(refined: RefinedFits, lattice: Lattice, structure: Structure, by_chance: Callable[[int], float]) -> bool:
    """Return True if exact friction explains a notable part more, or as much without one of a structure's effects.

    Stribeck friction that fades within a small speed mends the reversal of a friction that has none. Without the effect
    exact friction has to explain more than a width does, by more than chance.

    Parameters
    ----------
    refined : RefinedFits
        Of the round.
    lattice : Lattice
    structure : Structure
        A minimal one.
    by_chance : callable
        Deviance that so many parameters gain by chance.
    """
    task, own = refined.task, refined.of(structure)
    if reverses_at_once(task, refined.fits.done[structure], refined.material_growth):
        return True
    at_once, mask = replace(task, exact_friction=True), lattice.mask(structure)
    for bit in lattice.bits(mask & ~lattice.required):
        smaller = lattice.structure(lattice.without(mask, bit))
        if FRICTION_WIDTH not in task.space(smaller, nuisances=True).names:
            continue
        values = _values_below(at_once, smaller, refined.of(smaller).values, REFIT.compared_below * own.cost)
        if values is not None:
            free = len(at_once.space(smaller, nuisances=True).names)
            smooth = refined.of(smaller).deviance - gained_by_chance(1)
            enough = min(own.deviance + by_chance(own.free - free), smooth)
            if refine(at_once, smaller, values, refined.whitening, enough).deviance <= enough:
                return True
    return False


def _values_below(
    task: IdentificationTask, structure: Structure, values: Mapping[str, float], cost: float
) -> Mapping[str, float] | None:
    """Values of a structure, SI, that a descent from others leads to; None unless it leaves less than a cost."""
    problem, space = task.problem_and_space(structure)
    start = np.array([values[name] for name in space.names])[:, None]
    limit, tolerance = REFIT.iterations, REFIT.tolerance
    (end,) = fit_many(problem, space, task.settings, start, limit=limit, tolerance=tolerance, cost_to_beat=cost)
    return space.by_name(end.values) if end.cost < cost else None


def refit_all(fits: FitTable, workers: Executor) -> None:
    """Fit all structures of a table from their values, for a task that has changed."""
    known = {**fits.anchors, **fits.done}
    again = fits.tried([(s, f.values) for s, f in known.items()], workers)
    found = {f.structure: f for f in again}
    fits.done, fits.anchors = ({s: found[s] for s in before} for before in (fits.done, fits.anchors))
    fits.agreeing.clear()
    fits.propagate(fits.done, workers)
