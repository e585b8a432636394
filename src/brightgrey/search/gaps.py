"""Gaps, which are nowhere near the optima without them: sought from everywhere where they may explain what is left.

A gap that is passed often makes another motion. Where the best residual is neither white in the end nor as small as
what simulation and sensor are trusted in, gaps are sought with all other effects beside them and few masses first, then
in the structures that lead, again and again until that has been in vain for more than half of all effort before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from brightgrey.estimation.explore import is_white
from brightgrey.kit import Placed, Structure
from brightgrey.search.fits import TELLING, Fits
from brightgrey.search.fitting import IMPROVED, Fitted, two_ports
from brightgrey.search.identification import ACCURACY
from brightgrey.search.lattice import ladder_of, size

__all__ = ["seek_gaps"]

_LADDERS, _MOST_ROUNDS = 2, 12  # whose leading structures are searched from everywhere, and how often
_VAIN = 0.6  # of all samples simulated before: what is spent on that without improvement


def seek_gaps(fits: Fits, workers: Executor, seeking: Callable[[Structure], None] | None = None) -> None:
    """Look for what laws of two ports explain from everywhere, until the best residual is white.

    In the largest structure of every number of masses, the fewest first: the next one begins where it has ended. Where
    that brings something, and the law takes off a good part of what is left without it, more is looked for. Then in
    the structures that lead; they have no more effects than they need.

    Parameters
    ----------
    fits : Fits
        Of all structures that count; better ones are kept there.
    workers : concurrent.futures.Executor
    seeking : callable, optional
        Called with every structure before it is searched for.
    """
    seeking = seeking or (lambda structure: None)
    better: set[Structure] = set()
    tops = _tops(fits.done)
    for number, top in enumerate(tops):
        if _explained(fits):
            break
        seeking(top)
        found = fits.anew([top], 1, workers)
        if found and _tells(fits, top) and not _explained(fits):
            fits.anew([top], 2, workers)
        if found:
            better |= {top, *fits.up(tops[number + 1 :], [top], workers)}
    fits.spread(better, workers)
    _seek_leaders(fits, workers, seeking)


def _seek_leaders(fits: Fits, workers: Executor, seeking: Callable[[Structure], None]) -> None:
    """Fit leading structures from everywhere, until that has been in vain for more than half of all effort before."""
    idle, since = 0, fits.effort()
    for _ in range(_MOST_ROUNDS):
        leaders = _leaders(fits, idle)
        if not leaders or fits.effort() - since > _VAIN * since:
            break
        for s in leaders:
            seeking(s)
        least = fits.leader().cost
        fits.spread(fits.anew(leaders, 1, workers), workers)
        idle += 1
        if fits.leader().cost < IMPROVED * least:
            idle, since = 0, fits.effort()


def _leaders(fits: Fits, place: int) -> list[Structure]:
    """Structures with laws of two ports that lead among those with as many masses, or come at the `place` after.

    They have no more effects than they need, which makes the search from everywhere easier. None if such laws tell
    nothing, or nothing is left to be explained; and none that is far behind.
    """
    if not any(_tells(fits, top) for top in _tops(fits.done)) or _explained(fits):
        return []
    near, doubt = fits.near(), fits.doubt(fits.leader())
    n = sum(r.y.size for r in fits.task.recordings)

    def information(f: Fitted) -> float:
        """Bayesian information criterion, as if residuals were white (Schwarz 1978)."""
        return n * float(np.log(f.cost + doubt)) + f.free * float(np.log(n))

    ranked = dict[Placed, list[Structure]]()
    for fitted in sorted(fits.done.values(), key=information):
        if two_ports(fitted.structure) and not fitted.idle and fitted.cost < near:
            ranked.setdefault(ladder_of(fitted.structure), []).append(fitted.structure)
    return [best[min(place, len(best) - 1)] for best in list(ranked.values())[:_LADDERS]]


def _tells(fits: Fits, top: Structure) -> bool:
    """Whether laws of two ports take off a good part of what is left without them, with as many masses."""
    without = (f.cost for s, f in fits.done.items() if ladder_of(s) == ladder_of(top) and not two_ports(s))
    return fits.done[top].cost < TELLING * min(without, default=np.inf)


def _explained(fits: Fits) -> bool:
    """Whether the residual of the best fit is white, or no larger than what sensor and this simulation are off by."""
    best, task = fits.leader(), fits.task
    problem = task.problem(best.structure)
    values = {name: np.array([value]) for name, value in best.values.items()}
    residual = problem.residuals(values, task.settings)[:, 0]
    fits.spent.append(problem.spent(1))
    if best.cost <= fits.doubt(best):  # the level of the search may be that far off, but seldom is
        accurate = problem.residuals(values, replace(task.settings, level="accurate"))[:, 0]
        fits.spent.append(problem.spent(1))
        off, trusted = residual - accurate, float(task.doubt(problem.weights, ACCURACY).sum())
        if best.cost <= off @ off + trusted and accurate @ accurate <= fits.doubt(best):
            return True
    return is_white(problem, residual)


def _tops(structures: Iterable[Structure]) -> list[Structure]:
    """Of every ladder with laws of two ports the largest structure that has them, fewest masses first."""
    tops: dict[Placed, Structure] = {}
    for s in sorted(filter(two_ports, structures), key=size):
        tops[ladder_of(s)] = s
    return sorted(tops.values(), key=size)
