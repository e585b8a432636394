"""Rivals: structures with effects that the lattice lacks, which explain as well as a minimal one.

Friction at one mass may pass for friction at another, a pendulum for gravity, a hardening spring for a gap. So each
effect of a minimal structure is exchanged for others. A rival loses what it does not need, and is exchanged in turn.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import comb

from brightgrey.arrays import positive
from brightgrey.kit import Placed, Structure
from brightgrey.search.border import Refutation
from brightgrey.search.criteria import bic
from brightgrey.search.detectability import Detectability
from brightgrey.search.fitting.refined_fit import Refined
from brightgrey.search.lattice import contains
from brightgrey.search.policy import BORDER, FURTHER
from brightgrey.search.undecided.exchange import Exchange, refutes

__all__ = ["containing_none", "rival_to_offer", "rivals_among", "rivals_beyond"]


def rivals_beyond(
    detectability: Detectability,
    found: Sequence[Structure],
    effects: Sequence[Placed],
    seed: int,
    refuted: Sequence[Refutation] = (),
    *,
    with_model_error: bool,
    known: Sequence[Refined] = (),
    within: Structure | None = None,
) -> list[Refined]:
    """Refined fits with other effects in the place of some that are adequate as those of the lattice are.

    Parameters
    ----------
    detectability : Detectability
        Of the round.
    found : sequence of Structure
        The minimal ones, the best first.
    effects : sequence of Placed
        Those that the lattice lacks, which may take the place of others.
    seed : int
        Of the starts of their parameters.
    refuted : sequence of Refutation, optional
        Those that only just fail to explain are tried with a further effect.
    with_model_error : bool
        The residual holds more than noise: what takes the place of the last mass or a gap was tried before more masses
        were gone into, and several effects together follow anything.
    known : sequence of Refined
        Rivals of a smaller lattice, which may be rivals of this one, too.
    within : Structure, optional
        What explains better than the structures within it does not count.
    """
    exchange = Exchange(detectability, tuple(effects), seed, list(found), within)
    rivals = exchange.still_rivals(known)
    lattice = detectability.circumstances.lattice
    near = [lattice.structure(r.mask) for r in refuted if r.excess <= BORDER.sure * r.threshold]
    most = FURTHER.most_rivals + len(rivals)
    queue = [*(detectability.refined.of(s) for s in found), *rivals]
    thorough = not with_model_error
    while queue and len(rivals) < most:
        own = queue.pop(0)
        more = exchange.of(own)
        if thorough:
            more += exchange.of_several(own) + exchange.of_hard(own) + exchange.of_refuted(own, near)
        thorough = False  # beside the best one only
        rivals += more
        queue += more
    return rivals


def rivals_among(
    detectability: Detectability,
    known: Sequence[tuple[Structure, Mapping[str, float]]],
    within: Structure | None = None,
) -> list[Refined]:
    """Those of known structures beyond the lattice that are still adequate.

    Parameters
    ----------
    detectability : Detectability
        Of the round.
    known : sequence of (Structure, mapping of str to float)
        With the values, SI, from which they are fitted.
    within : Structure, optional
        As in :func:`rivals_beyond`.
    """
    exchange = Exchange(detectability, (), 0, [], within)
    return [end for end in exchange.ends(known) if exchange.is_adequate(end)]


def containing_none(rivals: Sequence[Refined], found: Sequence[Structure]) -> tuple[Refined, ...]:
    """Rivals that contain neither one of some structures nor another rival."""
    structures = [*found, *(r.structure for r in rivals)]
    return tuple(r for r in rivals if not any(contains(r.structure, s) for s in structures if s != r.structure))


def rival_to_offer(
    detectability: Detectability, found: Sequence[Structure], rivals: Sequence[Refined], among: int, masses: int
) -> Refined | None:
    """The best rival that refutes the minimal structures; else the simplest one with fewer masses, if there is any.

    Parameters
    ----------
    detectability : Detectability
        Of the round.
    found : sequence of Structure
        The minimal ones.
    rivals : sequence of Refined
    among : int
        Number of effects that were tried: the best choice of some of them gains more by chance.
    masses : int
        Least number of masses of the structures that the rivals are as good as.
    """
    own = min(detectability.refined.of_all(found), key=lambda r: r.deviance)
    atoms = detectability.circumstances.lattice.atoms
    beyond = {r.structure: r.structure.beside.difference(atoms) for r in rivals}
    refuting = [r for r in rivals if refutes(detectability, r, own, comb(among, len(beyond[r.structure])))]
    if refuting:
        return min(refuting, key=lambda r: r.deviance)
    fewer = [r for r in rivals if r.structure.masses < masses]
    samples = detectability.refined.whitening.samples
    return min(fewer, key=lambda r: (r.structure.masses, bic(positive(r.deviance), samples, r.free)), default=None)
