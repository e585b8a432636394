"""Doubtful effects: where nothing explains a recording, a rich structure follows its model error with them.

They help in some parts of the recordings only, or nothing is known of their size: few residuals are independent then,
however many they are. So the model that is handed back lacks them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from brightgrey.effects import INERTIA, STIFFNESS
from brightgrey.estimation.uncertainty.estimates import estimates_of
from brightgrey.kit import Placed, Structure
from brightgrey.search.border import Border
from brightgrey.search.fitting.refined_fit import RefinedFits, accurate
from brightgrey.search.lattice import Lattice, has
from brightgrey.search.policy import SELECTION
from brightgrey.search.unexplained.model_error import gains_steadily
from brightgrey.search.verdicts import ReasonKind

__all__ = ["Doubts", "doubts_about"]


@dataclass(frozen=True)
class Doubts:
    """Reservations on the effects of minimal structures, and what follows for these."""

    found: tuple[Structure, ...]  #: Minimal structures, those first whose every effect helps in most parts.
    model: Structure  #: The first of them without effects that help in some parts only, or whose size is not known.
    reasons: Mapping[str, ReasonKind]  #: Reservations on effects.


def doubts_about(
    refined: RefinedFits,
    lattice: Lattice,
    border: Border,
    found: Sequence[Structure],
    known: Mapping[str, ReasonKind] = MappingProxyType({}),
) -> Doubts:
    """Reservations on the effects of minimal structures, and the structure that is free of them.

    Parameters
    ----------
    refined : RefinedFits
        Of the round. Its recordings hold something that no structure explains.
    lattice : Lattice
    border : Border
    found : sequence of Structure
        Minimal structures, the best first.
    known : mapping of str to str
        Other reservations on effects.
    """
    unsteady = {s: _unsteady(refined, lattice, border, s) for s in found}
    ordered = tuple(sorted(found, key=lambda s: bool(unsteady[s])))
    first = ordered[0]
    model, left_out = _without_doubtful(refined, lattice, first, unsteady[first])
    doubtful = [str(p) for p in lattice.atoms if has(first, str(p)) and not has(model, str(p))]
    if model == first:
        doubtful += unsteady[first]
    else:  # what is left need not help as it did beside the others
        smaller = _smaller_by_one(refined, lattice, model)
        doubtful += [e for e, s in smaller.items() if not _is_steady(refined, model, s)]
    return Doubts(ordered, model, {**known, **dict.fromkeys(doubtful, "unsteady gain"), **left_out})


def _unsteady(refined: RefinedFits, lattice: Lattice, border: Border, structure: Structure) -> list[str]:
    """Effects of a minimal structure without which the residual does not grow in most parts of the recordings."""
    found = dict[str, None]()
    for r in border.refuted:
        bare = lattice.structure(r.mask)
        gone = [str(p) for p in lattice.atoms if has(structure, str(p)) and not has(bare, str(p))]
        if gone and not _is_steady(refined, structure, lattice.structure(r.witness)):
            found |= dict.fromkeys(gone)
    return list(found)


def _without_doubtful(
    refined: RefinedFits, lattice: Lattice, first: Structure, unsteady: Collection[str]
) -> tuple[Structure, dict[str, ReasonKind]]:
    """A structure without doubtful effects, and those left out whose size is not known.

    Of the latter that with the smallest t-statistic goes first, and masses last: what it was confused with may be known
    without it. Of those that help in some parts of the recordings only the least helpful one does. All of them together
    help in some parts only, too. What does not help at all without those goes with them.
    """
    own, left_out = first, dict[str, ReasonKind]()
    while True:
        unknown = _unknown_sizes(refined, lattice, own)
        if unknown:
            least = min(unknown, key=lambda e: (Placed.parse(e).effect.masses > 0, unknown[e]))
            own = _smaller_by_one(refined, lattice, own)[least]
            left_out[least] = "unknown size"
            continue
        one_less = _smaller_by_one(refined, lattice, own)
        smaller = [s for e, s in one_less.items() if e in unsteady and not _is_steady(refined, first, s)]
        if own != first:
            smaller += [s for s in one_less.values() if refined.of(s).deviance <= refined.of(own).deviance]
        if not smaller:
            return own, left_out
        own = min(smaller, key=lambda s: refined.of(s).deviance)


def _unknown_sizes(refined: RefinedFits, lattice: Lattice, structure: Structure) -> dict[str, float]:
    """Effects that may be left out and of whose size nothing is known, with what is known of it in parts of its error.

    The 95 % interval of that holds zero. Nothing is known of a mass either whose inertia or spring constant is at a
    bound or has an interval wider than a factor of ten, of a gap like that, and of masses that swing too slowly. The
    damping of a shaft is seldom known, and is not asked for.
    """
    own, task = refined.of(structure), refined.task
    problem, space = task.problem_and_space(structure)
    known = estimates_of(problem, space, accurate(task).settings, refined.optimum(structure)).by_name
    given = {*task.fixed, *(n for n in own.at_bound if n in task.bounds)}
    found = dict[str, float]()
    for placed in (p for i, p in enumerate(lattice.atoms) if lattice.optional >> i & 1 and p in structure.placed):
        for q in placed.effect.parameters:
            of_all = [n for n in known if n.partition("#")[0] == placed.parameter(q.symbol) and n not in given]
            for low, high in (known[n].ci95 for n in of_all if q.size):
                if not (low > 0.0 or high < 0.0):
                    t = abs(low + high) / (high - low) if high > low else 0.0
                    found[str(placed)] = min(t, found.get(str(placed), t))
            firm = placed.effect.has_hard_limit or (placed.effect.masses and q.dimension in (INERTIA, STIFFNESS))
            for n in (n for n in of_all if firm):
                low, high = known[n].ci95
                if n in own.at_bound or not high <= SELECTION.wide_interval * low:
                    found[str(placed)] = 0.0
        if placed.effect.masses and own.swings_slowly(task):
            found[str(placed)] = 0.0
    return found


def _smaller_by_one(refined: RefinedFits, lattice: Lattice, own: Structure) -> dict[str, Structure]:
    """The largest structures that lack one effect of a structure, by that effect, refined."""
    mask = lattice.mask(own)
    atoms = {str(lattice.atoms[bit.bit_length() - 1]): bit for bit in lattice.bits(mask & ~lattice.required)}
    found = {e: lattice.structure(lattice.without(mask, bit)) for e, bit in atoms.items()}
    refined.of_all(list(found.values()))
    return found


def _is_steady(refined: RefinedFits, structure: Structure, smaller: Structure) -> bool:
    """True if a smaller structure leaves more in most parts of the recordings, whitened."""
    own, other = (refined.whitening.whiten(refined.jacobian(s)[0]) for s in (structure, smaller))
    return gains_steadily(own, other, refined.task.problem(structure).recordings)
