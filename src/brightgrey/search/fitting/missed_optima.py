"""Restarts: optima that descents from neighbours have missed are looked for by multistart.

A structure may have missed its optimum because all its neighbours had. If the best residual is neither white nor within
the trusted accuracy, the leading structures without a hard limit are restarted first, since that costs little. Then the
largest structures with a hard limit are, fewest masses first, and then the leading ones. That ends when it has cost
more than half of all effort before without a gain.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from brightgrey.estimation.noise.error_floor import TRUSTED_ACCURACY
from brightgrey.estimation.noise.residual_analysis import is_white
from brightgrey.estimation.problem.segments import segment_lengths
from brightgrey.kit import Placed, Structure
from brightgrey.search.criteria import bic
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.lattice import complexity, mass_chain_of, one_smaller
from brightgrey.search.policy import BUDGET, REFIT

__all__ = ["find_missed_optima", "is_explained"]

_Seeking = Callable[[Structure], None]


def find_missed_optima(fits: FitTable, workers: Executor, seeking: _Seeking | None = None) -> None:
    """Fit structures from everywhere until the best residual is white, or that seems to be in vain.

    Those that lead without laws of two ports come first. Then comes the largest structure with such laws of every
    number of masses, fewest first. It is fitted before or not, and the next one begins where it has ended. Where that
    brings something, and the law takes off a good part of what is left without it, more is looked for. The last are
    those with such laws that lead. They have no more effects than they need.

    Parameters
    ----------
    fits : FitTable
        Better ones are kept there, and those of the largest structures.
    workers : concurrent.futures.Executor
    seeking : callable, optional
        Called with every structure before it is searched for.
    """
    if not fits.done:
        return
    seeking = seeking or (lambda structure: None)
    better = _seek_smooth(fits, workers, seeking)
    tops = _tops(fits.structures)
    for number, top in enumerate(tops):
        if is_explained(fits):
            break
        seeking(top)
        fresh = [s for s in (*_without_gaps(fits, top), top) if s not in fits.done]
        if fresh:
            better |= fits.add(fresh, workers)
        found = fits.restart_many([top], 1, workers)
        if found and _tells(fits, top) and not is_explained(fits):
            fits.restart_many([top], 2, workers)
        if found:
            larger = [t for t in tops[number + 1 :] if t in fits.done]
            better |= {top, *fits.refit_supermodels(larger, [top], workers)}
    fits.propagate(better, workers)
    _seek_gaps(fits, workers, seeking)


def _seek_smooth(fits: FitTable, workers: Executor, seeking: _Seeking) -> set[Structure]:
    """Fit leading structures without laws of two ports from everywhere, until some rounds have brought nothing.

    Returns those that are better but do not lead, whose relatives have not been fitted once more for it.
    """
    idle, better = 0, set[Structure]()
    for _ in range(BUDGET.max_rounds):
        leaders = _leaders(fits, idle, gaps=False)
        if not leaders or idle == BUDGET.fruitless_rounds or is_explained(fits):
            break
        least = fits.best().cost
        better |= _anew(fits, leaders, workers, seeking)
        idle += 1
        if fits.best().cost < REFIT.improved * least:
            fits.propagate(better, workers)
            idle, better = 0, set()
    return better


def _seek_gaps(fits: FitTable, workers: Executor, seeking: _Seeking) -> None:
    """Fit leading structures with laws of two ports from everywhere, until that has taken long and brought little.

    Not where such laws tell nothing.
    """
    idle, since = 0, fits.simulated_samples()
    for _ in range(BUDGET.max_rounds):
        tells = any(_tells(fits, top) for top in _tops(fits.done))
        leaders = _leaders(fits, idle, gaps=True)
        if (
            not (tells and leaders)
            or is_explained(fits)
            or fits.simulated_samples() - since > BUDGET.fruitless_share * since
        ):
            break
        least = fits.best().cost
        fits.propagate(_anew(fits, leaders, workers, seeking), workers)
        idle += 1
        if fits.best().cost < BUDGET.round_gain * least:
            idle, since = 0, fits.simulated_samples()


def _anew(fits: FitTable, leaders: Sequence[Structure], workers: Executor, seeking: _Seeking) -> set[Structure]:
    """Fit `leaders` from everywhere; returns those that got better."""
    for s in leaders:
        seeking(s)
    return fits.restart_many(leaders, 1, workers)


def _leaders(fits: FitTable, place: int, *, gaps: bool) -> list[Structure]:
    """Leading structures for each number of masses, or those `place` ranks below; with a hard limit if `gaps`.

    Structures with redundant effects and those far behind come last, if they lack one effect of the leader.
    """
    near, doubt = fits.cutoff_cost(), fits.error_floor_cost(fits.best())
    n = sum(r.y.size for r in fits.task.recordings)
    ranked = dict[Placed, list[Structure]]()
    behind = dict[Placed, list[Structure]]()
    offered = set(fits.structures)  # multistarts of larger ones take minutes each
    for fitted in sorted(fits.done.values(), key=lambda f: bic(f.cost + doubt, n, f.free)):
        s = fitted.structure
        if s not in offered:
            continue
        if s.has_hard_limit == gaps and not fitted.redundant_effects and fitted.cost < near:
            ranked.setdefault(mass_chain_of(s), []).append(s)
        elif s.has_hard_limit == gaps:
            behind.setdefault(mass_chain_of(s), []).append(s)
    first = list(ranked.items())[: BUDGET.leading_mass_chains]
    groups = ([*group, *one_smaller(group[0], behind.get(ladder, ()))] for ladder, group in first)
    return [group[place % len(group)] for group in groups]


def _tells(fits: FitTable, top: Structure) -> bool:
    """Return True if a hard limit takes off a good part of the cost, with as many masses."""
    without = (f.cost for s, f in fits.done.items() if mass_chain_of(s) == mass_chain_of(top) and not s.has_hard_limit)
    return fits.done[top].cost < REFIT.clear_gain * min(without, default=np.inf)


def _without_gaps(fits: FitTable, top: Structure) -> list[Structure]:
    """The largest structure without laws of two ports that has as many masses as `top`: what that is compared with."""
    smooth = (s for s in fits.structures if mass_chain_of(s) == mass_chain_of(top) and not s.has_hard_limit)
    return sorted(smooth, key=complexity)[-1:]


def is_explained(fits: FitTable, fitted: StructureFit | None = None) -> bool:
    """Return True if the residual of a fit, the best by default, is white or no larger than known errors.

    These are the error to which sensors are trusted, and the difference between the levels of the simulation. The level
    of a search may be three times as far off as sensors are, but seldom is.
    """
    best, task = fitted or fits.best(), fits.task
    problem = task.problem(best.structure)
    values = {name: np.array([value]) for name, value in best.values.items()}
    residual = problem.residuals(values, task.settings)[:, 0]
    fits.spent.append(problem.count(1))
    if best.cost <= fits.error_floor_cost(best):
        accurate = problem.residuals(values, replace(task.settings, level="accurate"))[:, 0]
        fits.spent.append(problem.count(1))
        off, trusted = residual - accurate, fits.error_floor_cost(best, TRUSTED_ACCURACY)
        if best.cost <= off @ off + trusted and accurate @ accurate <= fits.error_floor_cost(best):
            return True
    return is_white(residual, segment_lengths(problem.recordings))


def _tops(structures: Iterable[Structure]) -> list[Structure]:
    """Of every ladder with laws of two ports the largest structure that has them, fewest masses first."""
    tops: dict[Placed, Structure] = {}
    for s in sorted((s for s in structures if s.has_hard_limit), key=complexity):
        tops[mass_chain_of(s)] = s
    return sorted(tops.values(), key=complexity)
