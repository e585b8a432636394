"""Search for the border: fits are made where the decision rests on them, until nothing is wanted.

A few large structures are fitted by multistart. The simplest adequate one is shrunk, one atom at a time. Then the
largest structures that contain no adequate one are fitted. A refutation rests on an optimum that may have been missed.
So the effort goes there in the end: multistart until independent starts agree.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from brightgrey.arrays import positive
from brightgrey.errors import SettingsError
from brightgrey.kit import Structure
from brightgrey.search.adequacy import Deviance, Round
from brightgrey.search.border import Border, Refutation, assess, joint, shrunk
from brightgrey.search.criteria import bic
from brightgrey.search.fitting.anchors import hard_limits, largest_by_masses, linear_beside_masses, mass_masks
from brightgrey.search.fitting.exact_friction import simplifies
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.missed_optima import find_missed_optima
from brightgrey.search.fitting.refined_fit import RefinedFits
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.further.offers import OfferingSearch, effective_samples_of
from brightgrey.search.policy import BORDER, REFIT, BorderPolicy
from brightgrey.search.unexplained.doubtful import doubts_about
from brightgrey.search.unexplained.model_error import calls_for_mass

__all__ = ["BorderRefit", "BorderSearch"]


@dataclass
class BorderSearch(OfferingSearch):
    """A search in progress."""

    policy: BorderPolicy = BORDER

    def __post_init__(self) -> None:
        super().__post_init__()
        self.refined = RefinedFits(self.task, self.fits, self.executor)
        self.tops: set[Structure] = set()
        self.gone_into: set[Structure] = set()  # simplest ones, and those with one mass more
        self.flipped: set[int] = set()
        self.thorough = False
        self.most_fits = self.policy.max_fits
        self.border: Border | None = None

    def run(self, *, everything: bool = False) -> Border:
        """Border of all structures; with `everything`, all of them are fitted first.

        Raises
        ------
        SettingsError
            If no structure could be simulated.
        """
        if everything:
            self.fit_everything()
        elif self.offer_to_fewest_masses():
            return self.settled()
        else:
            self.fit_largest()
        if not np.isfinite(self.fits.best().cost):
            raise SettingsError("no structure gave a finite simulation; check units, bounds and --input-gain")
        while self.offer_further(self.fits.best().structure.masses - 1):
            pass  # before more masses are gone into, or anything is decided
        if not (everything or self.offered):  # where no further effect takes their part, gaps and masses are gone into
            self.thorough = True
            self.restarts = {s: n for s, n in self.restarts.items() if not s.has_hard_limit}
            self.find_best_patiently()
        return self.settled()

    def settled(self) -> Border:
        """Border of the lattice when nothing is left to offer."""
        while True:
            border = self.in_rounds()
            is_simpler = partial(simplifies, self.refined, self.lattice, self.simplest(border), self.round.by_chance)
            if not (self.changes_task(is_simpler) or self.goes_further(border)):
                return border

    def goes_further(self, border: Border) -> bool:
        """Fit, or offer, what the border calls for; returns False if that is nothing.

        Where effects were offered and nothing explains the recordings, a doubtful mass calls for no other.
        """
        found = [self.lattice.structure(m) for m in border.minimal]
        masses = min(s.masses for s in found)
        if self.offered and self.has_model_error():
            found.sort(key=self.simplest(border).__ne__)  # that one first
            doubts = doubts_about(self.refined, self.lattice, border, found)
            if doubts.model.masses < doubts.found[0].masses:
                return self.offer_further(masses)
        return (
            self.improves_simplest(border)
            or self.offer_further(masses)
            or self.offer_mass_left_out()
            or self.offer_mass(masses)
        )

    def fit_largest(self) -> None:
        """Fit the structures with most effects, until nothing is left to explain or to try."""
        self.fit(self.anchors)
        self.changes_task()
        self.fit_hard_limits()
        self.find_best()

    def in_rounds(self) -> Border:
        """Border of the lattice, in rounds with a noise model each, until no status changes."""
        reference, last = self.fits.best().structure, None
        if self.refined.task is not self.task:  # friction has become exact, or samples were added
            self.refined = RefinedFits(self.task, self.fits, self.executor)
        for _ in range(self.policy.rounds):
            self.refined.begin_round(reference, model_error=self.has_model_error())
            border = self.decide()
            statuses = {m: m in border.adequate for m in self.deviances()}
            if last is not None:
                self.flipped = {m for m, adequate in last.items() if statuses.get(m, adequate) != adequate}
            simplest = self.simplest(border)
            if simplest == reference:  # the next round would be this one again
                self.flipped = set()
                break
            if last is not None and not self.flipped:
                break
            reference, last = simplest, statuses
        return border

    def simplest(self, border: Border) -> Structure:
        """The minimal structure with fewest parameters."""
        table = self.deviances()
        return self.lattice.structure(min(border.minimal, key=lambda m: (table[m].free, border.excess[m])))

    def fit_everything(self) -> None:
        """Fit all structures, and look for missed optima among them."""
        structures = [self.lattice.structure(m) for m in self.lattice.masks()]
        self.fits = FitTable(self.task, structures, seed=self.seed)
        self.refined = RefinedFits(self.task, self.fits, self.executor)

        def tell(fitted: StructureFit) -> None:
            self.progress("structures", len(self.fits.done), fitted.structure)

        self.fits.add(structures, self.executor, tell)
        find_missed_optima(self.fits, self.executor, lambda s: self.progress("missed optima", len(self.fits.done), s))

    def fit_hard_limits(self) -> None:
        """Fit the largest structures with hard limits, fewest masses first.

        The least of them is fitted by multistart, after the one with linear effects alone. Dry friction and a limit
        make the cost rugged together. Beside linear effects a multistart finds the limit more often, in a third of the
        time, and the others begin there.
        """
        for masses, top in zip(mass_masks(self.lattice), largest_by_masses(self.lattice), strict=True):
            if top.has_hard_limit and top not in self.fits.done:
                first = not any(s.has_hard_limit for s in self.fits.done)
                self.tops.add(top)
                mask = self.lattice.within(linear_beside_masses(self.lattice) | hard_limits(self.lattice) | masses)
                linear = self.lattice.structure(mask)
                for structure in dict.fromkeys((linear, top)) if first and not self.is_explained() else (top,):
                    self.fit([structure])
                    if first and not self.is_explained():
                        self.restart_at(structure, patiently=structure == linear)

    def restart_at(self, structure: Structure, *, patiently: bool = False) -> bool:
        """Fit a structure by multistart, and its neighbours anew where that helps; returns True if it got better."""
        self.restarts[structure] = self.restarts.get(structure, 0) + 1
        if patiently or (self.thorough and structure.has_hard_limit):
            better = self.fits.restart_many([structure], self.policy.patience, self.executor)
        else:
            better = self.fits.restart_many([structure], 0, self.executor, fields=self.policy.fields)
        self.fits.propagate(better, self.executor)
        self.progress("restarts", len(self.fits.done), structure)
        return bool(better)

    def find_best(self) -> None:
        """Restart what leads until the best residual is white, starts agree, or their share is used up."""
        while not self.is_explained():
            wanted = [s for s in self.leaders() if self.lacks_agreement(s)]
            if not wanted:
                break
            self.restart_at(wanted[0])
            self.changes_task()

    def find_best_patiently(self) -> None:
        """Restart what leads, and what is beside it, by a patient multistart each, until the best residual is white."""
        tried = set[Structure]()
        while not self.is_explained():
            wanted = [s for s in self.beside_leaders() if s not in tried]
            if not wanted:
                break
            tried.add(wanted[0])
            self.restart_at(wanted[0], patiently=True)
            self.changes_task()

    def beside_leaders(self) -> list[Structure]:
        """Structures that lead, each before the largest with one mass more, which is seldom found from below.

        With a hard limit the largest with fewer masses come first: a further mass must not win by effort.
        """
        found = []
        for leader in self.leaders():
            hard = leader.has_hard_limit
            largest = {s.masses: s for s in (self.tops if hard else self.anchors)} | {leader.masses: leader}
            masses = range(1 if hard else leader.masses, leader.masses + 2)
            found += [largest[n] for n in masses if n in largest]
        return found

    def improves_simplest(self, border: Border) -> bool:
        """Restart the simplest minimal structure, and it with one mass more, where the best fit has model error.

        With few effects a multistart reaches optima that the largest structures miss. Where further effects have been
        offered, a mass is tried if the residual calls for it. Returns True if the table has changed.
        """
        own, changed = self.simplest(border), False
        more = next((m for m in mass_masks(self.lattice) if self.lattice.structure(m).masses > own.masses), 0)
        larger = self.lattice.structure(self.lattice.within(self.lattice.mask(own) | more))
        wanted = (own, larger) if self.thorough else (larger,) if self.offered else ()
        for structure in (s for s in dict.fromkeys(wanted) if s not in self.gone_into):
            self.gone_into.add(structure)
            if self.has_model_error() and (self.thorough or calls_for_mass(self.task, self.fits.done[own])):
                changed |= structure not in self.fits.done
                self.fit([structure])
                changed |= self.restart_at(structure, patiently=True)
        return changed

    def lacks_agreement(self, structure: Structure, share: int | None = None) -> bool:
        """True if more independent starts are wanted at the optimum of a structure, and its share allows them."""
        hard = structure.has_hard_limit
        most = share or (self.policy.restarts_costly if hard else self.policy.restarts)
        agreed = self.fits.agreeing.get(structure, 0) >= self.policy.agreeing
        return self.restarts.get(structure, 0) < most and not agreed

    def leaders(self) -> list[Structure]:
        """Structures that lead by BIC: without a hard limit, and with one if that takes off a good part of the cost.

        Independent samples of noise count: masses explain much of coloured noise. Model error is no noise.
        """
        noise = None if self.has_model_error() else max(effective_samples_of(self.task, self.fits.best()), 2.0)
        n = noise or sum(r.y.size for r in self.task.recordings)
        best: dict[bool, StructureFit] = {}
        for f in sorted(self.fits.done.values(), key=lambda f: bic(positive(f.cost), n, f.free)):
            if not f.redundant_effects:
                best.setdefault(f.structure.has_hard_limit, f)
        without, limited = best.get(False), best.get(True)
        if without is None or limited is None:  # every structure may be required to have a gap
            return [f.structure for f in best.values()]
        if limited.cost >= REFIT.clear_gain * without.cost:
            return [without.structure]
        far = without.cost > self.fits.cutoff_cost()
        return [limited.structure] if far else [without.structure, limited.structure]

    def deviances(self) -> dict[int, Deviance]:
        """Table of the fits in this round."""
        refined = self.refined.all(self.round.threshold_of_one_test)
        table = {self.lattice.mask(s): Deviance(r.deviance, r.free, s.masses) for s, r in refined.items()}
        for s, f in self.fits.done.items():  # redundant effects add parameters and leave the deviance
            if f.equals is not None and s not in refined:
                table[self.lattice.mask(s)] = Deviance(refined[f.equals].deviance, f.free, s.masses)
        return table

    @property
    def round(self) -> Round:
        """Circumstances that all structures of this round share."""
        whitening = self.refined.whitening
        least, largest = self.lattice.structure(self.lattice.required), largest_by_masses(self.lattice)
        free = {s: len(self.task.space(s, nuisances=True).names) for s in (least, *largest)}
        floor = min(whitening.floor_deviance, float(whitening.samples))
        return Round(self.lattice, free[least], {s.masses: free[s] for s in largest}, floor, self.has_model_error())

    def decide(self) -> Border:
        """Fit what the decision rests on until nothing is wanted, or to the budget and until nothing can be removed."""
        while True:
            border = self.border = assess(self.deviances(), self.round)
            self.progress("border", len(self.fits.done), self.fits.best().structure)
            self.most_fits = self.policy.max_fits_with_model_error if self.has_model_error() else self.policy.max_fits
            spent = len(self.fits.done) > self.most_fits
            wanted = self.simpler(border) or ([] if spent else self.wanted(border))
            if wanted:
                self.fit(wanted)
                self.fits.continue_to_submodels(self.executor)
            elif (spent or not self.restart(border)) and not self.confirm(border):
                return border

    def wanted(self, border: Border) -> list[Structure]:
        """The largest structures that are undecided, or else those on which refutations are tried."""
        beside = [self.beside_refuted(r, border) for r in border.refuted]
        found = map(self.lattice.structure, border.undecided[: self.policy.side_by_side] or dict.fromkeys(beside))
        return [s for s in found if s not in self.fits.done]

    def simpler(self, border: Border) -> list[Structure]:
        """Structures that lack atoms of adequate ones: until they are fitted, none of these is minimal for sure."""
        done = {self.lattice.mask(s) for s in self.fits.done}
        found = joint(border, self.lattice, done) or shrunk(border, self.lattice, done)
        return [self.lattice.structure(m) for m in found]

    def beside_refuted(self, found: Refutation, border: Border) -> int:
        """The structure on which a refutation is tried: the part of the simplest adequate anchor within it.

        It has enough effects for an optimum that its own parts miss, and few enough parameters for a multistart.
        """
        tops = [self.lattice.mask(s) for s in self.fits.done if self.is_anchor(s)]
        tops = [m for m in tops if m in border.adequate] or [border.best]
        simplest = min(tops, key=lambda m: (self.lattice.structure(m).has_hard_limit, m.bit_count(), m))
        return self.lattice.within(found.mask & simplest)

    def is_anchor(self, structure: Structure) -> bool:
        """True for the structures that are fitted first."""
        return structure in self.anchors or structure in self.tops

    def restart(self, border: Border) -> bool:
        """Restart where refutations rest, the nearest first; returns False if nothing is left to do."""
        once = self.has_model_error()  # no optimum is the truth then, and one multistart has to do
        far = self.policy.far * max((r.threshold for r in border.refuted), default=0.0)
        nearest = sorted(border.refuted, key=lambda r: r.excess / r.threshold)
        for found in nearest:
            structure = self.lattice.structure(self.beside_refuted(found, border))
            is_far = found.excess > far
            most = 1 if is_far or once else None
            if not (is_far and structure.has_hard_limit) and self.lacks_agreement(structure, most):
                self.restart_at(structure)
                return True
        for found in nearest:
            if found.excess <= far:
                # further masses or a gap may have an optimum that the anchor has no place for
                beside = self.beside_refuted(found, border) | found.mask & hard_limits(self.lattice)
                for mask in (found.mask & ~hard_limits(self.lattice), *([beside] if self.thorough else [])):
                    structure = self.lattice.structure(self.lattice.within(mask))
                    if self.lacks_agreement(structure, 1):
                        self.fit([structure])
                        self.restart_at(structure)
                        return True
        return False

    def confirm(self, border: Border) -> bool:
        """Restart where no start has ended at the optimum on which a refutation rests; returns False if none is left.

        It does not depend on the budget of structures: it fits no others than those on which refutations rest.
        """
        for found in border.refuted:
            structure = self.lattice.structure(self.beside_refuted(found, border))
            if self.is_unconfirmed(found, border) and self.lacks_agreement(structure, self.policy.restarts_unconfirmed):
                self.fit([structure])
                self.restart_at(structure)
                return True
        return False

    def is_unconfirmed(self, found: Refutation, border: Border) -> bool:
        """True if no start has ended at the optimum on which a refutation rests, unless that is far above chance.

        With model error no optimum is the truth, and a refutation stands for a notable part of the residual.
        """
        if found.excess >= self.policy.sure * found.threshold or self.has_model_error():
            return False
        return not self.fits.agreeing.get(self.lattice.structure(self.beside_refuted(found, border)), 0)


@dataclass
class BorderRefit(BorderSearch):
    """Search that refits known structures, and fits others only where the decision rests on them.

    It shows what noise does to a decision. It does not show that a search may miss an optimum.
    """

    optima: Mapping[Structure, Mapping[str, float]] = field(default_factory=dict)  #: As found on a like recording, SI.

    def run(self, *, everything: bool = False) -> Border:
        """Border of all structures, from the known optima.

        Raises
        ------
        SettingsError
            If none of them could be simulated.
        """
        for structure, values in ((s, v) for s, v in self.optima.items() if self.is_in_lattice(s)):
            self.fits.fit_from(structure, values, self.executor)
            self.progress("fits", len(self.fits.done), self.fits.best().structure)
        if not np.isfinite(self.fits.best().cost):
            raise SettingsError("no known structure gave a finite simulation; check units, bounds and --input-gain")
        return self.in_rounds()

    def restart(self, border: Border) -> bool:
        """Return False: no multistart is made."""
        return False

    def confirm(self, border: Border) -> bool:
        """Return False: no multistart is made."""
        return False

    def is_unconfirmed(self, found: Refutation, border: Border) -> bool:
        """Return False: known optima count as confirmed."""
        return False

    def beyond_lattice(self) -> list[tuple[Structure, Mapping[str, float]]]:
        """Known structures with an effect that was not offered, with their values."""
        return [(s, v) for s, v in self.optima.items() if not self.is_in_lattice(s)]

    def is_in_lattice(self, structure: Structure) -> bool:
        """True if the lattice has a structure."""
        return self.lattice.structure(self.lattice.mask(structure)) == structure
