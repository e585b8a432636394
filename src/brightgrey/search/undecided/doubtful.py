"""Effects on which the search as a whole has a reservation, although every minimal structure has them.

Where nothing explains a recording, a rich structure follows its model error with effects that are not there. They help
in some parts of it only, and change from one recording to the next. So the model that is handed back lacks them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from brightgrey.kit import Structure
from brightgrey.search.border import Border
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.detectability import has
from brightgrey.search.policy import SELECTION
from brightgrey.search.verdicts import ReasonKind

__all__ = ["doubtful_effects", "without_unsteady"]


def doubtful_effects(
    search: BorderSearch, border: Border, best: Structure, *, unexplained: bool
) -> dict[str, ReasonKind]:
    """Effects whose refutation has not been confirmed, or that help in some parts of the recordings only.

    Parameters
    ----------
    search : BorderSearch
    border : Border
    best : Structure
        The first of the minimal structures.
    unexplained : bool
        The recordings hold something that no structure explains. Then it is asked where each effect helps.
    """
    unconfirmed = [r for r in border.refuted if search.is_unconfirmed(r, border)]
    found: dict[str, ReasonKind] = {e: "unconfirmed" for r in unconfirmed for e in search.lattice.lacking(r.mask)}
    return found | (dict.fromkeys(_unsteady(search, border, best), "unsteady gain") if unexplained else {})


def without_unsteady(search: BorderSearch, first: Structure, doubtful: Mapping[str, ReasonKind]) -> Structure:
    """A structure without the effects that help in some parts of the recordings only, the least helpful one first.

    All that are left out together help in some parts only, too.

    Parameters
    ----------
    search : BorderSearch
    first : Structure
    doubtful : mapping of str to str
        Reservations on effects.
    """
    lattice, refined, own = search.lattice, search.refined, first
    while True:
        mask = lattice.mask(own)
        bits = [
            bit
            for bit in lattice.bits(mask & ~lattice.required)
            if doubtful.get(str(lattice.atoms[bit.bit_length() - 1])) == "unsteady gain"
        ]
        smaller = refined.of_all([lattice.structure(lattice.without(mask, bit)) for bit in bits])
        unsteady = [r for r in smaller if _blocks_grown(search, first, r.structure) < SELECTION.steady_blocks]
        if not unsteady:
            return own
        own = min(unsteady, key=lambda r: r.deviance).structure


def _unsteady(search: BorderSearch, border: Border, best: Structure) -> list[str]:
    """Effects without which the residual does not grow in most parts of the recordings."""
    lattice, found = search.lattice, dict[str, None]()
    for r in border.refuted:
        if _blocks_grown(search, best, lattice.structure(r.witness)) < SELECTION.steady_blocks:
            bare = lattice.structure(r.mask)
            found |= dict.fromkeys(str(p) for p in lattice.atoms if has(best, str(p)) and not has(bare, str(p)))
    return list(found)


def _blocks_grown(search: BorderSearch, structure: Structure, smaller: Structure) -> int:
    """Number of blocks in time in which a smaller structure leaves more, whitened."""
    refined = search.refined
    own, other = (
        np.array([part @ part for part in np.array_split(whitened, SELECTION.blocks)])
        for whitened in (refined.whitening.whiten(refined.jacobian(s)[0]) for s in (structure, smaller))
    )
    return int(np.sum(other > own))
