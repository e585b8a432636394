"""Ranking of the structures that a search has fitted."""

from __future__ import annotations

from dataclasses import dataclass

from brightgrey.arrays import positive
from brightgrey.kit import Structure
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.criteria import Misfit, bic
from brightgrey.search.evidence import Evidence
from brightgrey.search.lattice import has, one_larger
from brightgrey.search.parallel import in_order
from brightgrey.search.task import IdentificationTask

__all__ = ["Ranked", "ranking_of"]


@dataclass(frozen=True)
class Ranked:
    """Structure in the ranking."""

    structure: Structure
    free: int  #: Number of estimated parameters.
    misfit: Misfit  #: At the level of the search.
    criterion: float  #: Bayesian information criterion of the deviance; less is better.
    equivalent: bool  #: Minimal, or minimal with one optional effect.
    status: str  #: See :class:`.Evidence`; empty if the search was stopped.


def ranking_of(search: BorderSearch, task: IdentificationTask, evidence: Evidence | None) -> tuple[Ranked, ...]:
    """Ranking of all structures that were fitted, with their misfits on all samples of the recordings.

    Parameters
    ----------
    search : BorderSearch
    task : IdentificationTask
        With all samples.
    evidence : Evidence or None
        None if the search was stopped.

    Returns
    -------
    tuple of Ranked
        The structure that is handed back, the minimal ones, then by the criterion.
    """
    fitted = search.fits.done
    minimal = [r.structure for r in evidence.minimal] if evidence else []
    front = dict.fromkeys((evidence.first.structure, *minimal) if evidence else ())
    optional = evidence.optional if evidence else ()
    beyond_doubt = {"steady", "rival"} if evidence and "steady" in evidence.status.values() else set[str]()
    samples = sum(r.y.size for r in search.task.recordings)
    known = evidence.refined if evidence else {}
    shown, calls = {}, []
    for s, f in fitted.items():
        own = s if s in known else f.equals or s  # the values of redundant effects would spoil the misfit
        refined = known.get(own)
        shown[s] = own, refined
        calls.append((task, own, dict(refined.values if refined else fitted[own].values)))
    # a search that was stopped has an executor that takes no more calls
    misfit = IdentificationTask.misfit  # not that of `task`: a store knows a call by its arguments
    found = in_order(search.executor, misfit, calls) if evidence else (misfit(*call) for call in calls)
    misfits = dict(zip(fitted, found, strict=True))
    ranked = []
    for s, f in fitted.items():
        own, refined = shown[s]
        value = bic(positive(refined.deviance if refined else f.cost), samples, f.free)
        one_more = any(one_larger(m, [s]) and any(has(s, o) and not has(m, o) for o in optional) for m in minimal)
        status = evidence.status.get(s, "") if evidence else ""
        alike = one_more or (s in front and status not in beyond_doubt)
        ranked.append(Ranked(s, f.free, misfits[s], value, alike, status))
    place = {s: i for i, s in enumerate(front)}
    ranked.sort(key=lambda r: (place.get(r.structure, len(place)), r.criterion, str(r.structure)))
    return tuple(ranked)
