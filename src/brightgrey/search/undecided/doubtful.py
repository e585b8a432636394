"""Effects on which the search as a whole has a reservation, although every minimal structure has them."""

from __future__ import annotations

import numpy as np

from brightgrey.arrays import Array
from brightgrey.kit import Structure
from brightgrey.search.border import Border
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.detectability import has
from brightgrey.search.policy import SELECTION
from brightgrey.search.verdicts import ReasonKind

__all__ = ["doubtful_effects"]


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


def _unsteady(search: BorderSearch, border: Border, best: Structure) -> list[str]:
    """Effects without which the residual does not grow in most parts of the recordings."""
    lattice, refined = search.lattice, search.refined

    def blocks(structure: Structure) -> Array:
        residual = refined.whitening.whiten(refined.jacobian(structure)[0])
        return np.array([part @ part for part in np.array_split(residual, SELECTION.blocks)])

    own, found = blocks(best), dict[str, None]()
    for r in border.refuted:
        grown = int(np.sum(blocks(lattice.structure(r.witness)) > own))
        if grown < SELECTION.steady_blocks:
            bare = lattice.structure(r.mask)
            found |= dict.fromkeys(str(p) for p in lattice.atoms if has(best, str(p)) and not has(bare, str(p)))
    return list(found)
