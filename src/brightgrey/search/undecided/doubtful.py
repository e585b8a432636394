"""Effects on which the search as a whole has a reservation, although every minimal structure has them.

Where nothing explains a recording, a rich structure follows its model error with effects that are not there. They help
in some parts of it only, or nothing is known of their size: few residuals are independent then, however many they are.
So the model that is handed back lacks them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.problem.segments import split_recordings
from brightgrey.estimation.uncertainty.estimates import estimates_of
from brightgrey.kit import Structure
from brightgrey.search.border import Border
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.detectability import has
from brightgrey.search.fitting.refined_fit import accurate
from brightgrey.search.policy import SELECTION
from brightgrey.search.verdicts import ReasonKind

__all__ = ["Doubts", "doubts_about"]


@dataclass(frozen=True)
class Doubts:
    """Reservations on the effects of a border, and what follows for its structures."""

    #: Minimal structures in their order; where nothing explains the recordings those first whose every effect helps in
    #: most parts of them.
    found: tuple[Structure, ...]
    model: Structure  #: The first of them without effects that help in some parts only, or whose size is not known.
    reasons: Mapping[str, ReasonKind]  #: Reservations on effects.


def doubts_about(search: BorderSearch, border: Border, found: Sequence[Structure], *, unexplained: bool) -> Doubts:
    """Reservations on the effects of a border, and the structure that is free of them.

    Parameters
    ----------
    search : BorderSearch
    border : Border
    found : sequence of Structure
        The minimal structures, the best first.
    unexplained : bool
        The recordings hold something that no structure explains. Then it is asked where each effect helps, and if its
        size is known.
    """
    unconfirmed = [r for r in border.refuted if search.is_unconfirmed(r, border)]
    reasons: dict[str, ReasonKind] = {e: "unconfirmed" for r in unconfirmed for e in search.lattice.lacking(r.mask)}
    if not unexplained:
        return Doubts(tuple(found), found[0], reasons)
    unsteady = {s: _unsteady(search, border, s) for s in found}
    ordered = tuple(sorted(found, key=lambda s: bool(unsteady[s])))
    first = ordered[0]
    model, left_out = _without_doubtful(search, first, unsteady[first])
    effects = list(map(str, search.lattice.atoms))
    doubtful = unsteady[first] + [e for e in effects if has(first, e) and not has(model, e)]
    if model != first:  # what is left need not help as it did beside the others
        smaller = _smaller_by_one(search, model, effects)
        doubtful += [e for e, s in smaller.items() if not _is_steady(search, model, s)]
    return Doubts(ordered, model, reasons | dict.fromkeys(doubtful, "unsteady gain") | left_out)


def _unsteady(search: BorderSearch, border: Border, structure: Structure) -> list[str]:
    """Effects of a minimal structure without which the residual does not grow in most parts of the recordings."""
    lattice, found = search.lattice, dict[str, None]()
    for r in border.refuted:
        bare = lattice.structure(r.mask)
        gone = [str(p) for p in lattice.atoms if has(structure, str(p)) and not has(bare, str(p))]
        if gone and not _is_steady(search, structure, lattice.structure(r.witness)):
            found |= dict.fromkeys(gone)
    return list(found)


def _without_doubtful(
    search: BorderSearch, first: Structure, unsteady: Collection[str]
) -> tuple[Structure, dict[str, ReasonKind]]:
    """A structure without doubtful effects, and those left out whose size is not known.

    Of the latter that with the smallest t-statistic goes first: what it was confused with may be known without it. Of
    those that help in some parts of the recordings only the least helpful one does. All of them together help in some
    parts only, too. What does not help at all without those goes with them.
    """
    own, left_out = first, dict[str, ReasonKind]()
    while True:
        least = min(_unknown_sizes(search, own).items(), key=lambda pair: pair[1], default=None)
        if least is not None:
            own = _smaller_by_one(search, own, [least[0]])[least[0]]
            left_out[least[0]] = "unknown size"
            continue
        smaller = [s for s in _smaller_by_one(search, own, unsteady).values() if not _is_steady(search, first, s)]
        if own != first:
            others = _smaller_by_one(search, own, list(map(str, search.lattice.atoms))).values()
            smaller += [s for s in others if search.refined.of(s).deviance <= search.refined.of(own).deviance]
        if not smaller:
            return own, left_out
        own = min(smaller, key=lambda s: search.refined.of(s).deviance)


def _unknown_sizes(search: BorderSearch, structure: Structure) -> dict[str, float]:
    """Effects that may be left out and whose size has a 95 % interval with zero, with the size in parts of that.

    Nothing is known of a mass or gap that has run to a bound, and of a mass that swings too slowly.
    """
    problem, space = search.task.problem_and_space(structure)
    best, lattice, found = search.refined.optimum(structure), search.lattice, dict[str, float]()
    known = estimates_of(problem, space, accurate(search.task).settings, best).by_name
    own, task = search.refined.of(structure), search.refined.task
    for placed in (p for i, p in enumerate(lattice.atoms) if lattice.optional >> i & 1 and p in structure.placed):
        if own.runaway(str(placed), task) or (placed.effect.masses and own.swings_slowly(task)):
            found[str(placed)] = 0.0
        for size in (known.get(placed.parameter(q.symbol)) for q in placed.effect.parameters if q.size):
            if size is not None and size.ci95[0] <= 0.0 <= size.ci95[1]:
                found[str(placed)] = abs(size.value) / max(size.ci95[1] - size.value, size.value - size.ci95[0])
    return found


def _smaller_by_one(search: BorderSearch, own: Structure, effects: Collection[str]) -> dict[str, Structure]:
    """The largest structures that lack one of some effects of a structure, by effect, refined."""
    lattice, mask = search.lattice, search.lattice.mask(own)
    atoms = {str(lattice.atoms[bit.bit_length() - 1]): bit for bit in lattice.bits(mask & ~lattice.required)}
    found = {e: lattice.structure(lattice.without(mask, bit)) for e, bit in atoms.items() if e in effects}
    search.refined.of_all(list(found.values()))
    return found


def _is_steady(search: BorderSearch, structure: Structure, smaller: Structure) -> bool:
    """True if a smaller structure leaves more in most parts of the recordings, whitened."""
    own, other = (
        np.array([part.sum() for part in np.array_split(_energy(search, s), SELECTION.blocks)])
        for s in (structure, smaller)
    )
    return int(np.sum(other > own)) >= SELECTION.steady_blocks


def _energy(search: BorderSearch, structure: Structure) -> Array:
    """Squares of the whitened residual, of all outputs together, of one recording after the other."""
    refined = search.refined
    whitened = refined.whitening.whiten(refined.jacobian(structure)[0])
    recordings = refined.task.problem(structure).recordings
    return np.concatenate([np.square(part).sum(axis=0) for _, part in split_recordings(whitened, recordings)])
