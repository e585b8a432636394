"""Search that offers effects which a function set holds back, where those that it has leave model error.

The lattice grows by what explains a notable part of the residual.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from brightgrey.arrays import positive
from brightgrey.estimation.noise.error_floor import TRUSTED_ACCURACY
from brightgrey.kit import Placed, Structure
from brightgrey.numerics import distributions
from brightgrey.recordings import Recording
from brightgrey.search.adequacy import material_growth
from brightgrey.search.criteria import bic
from brightgrey.search.fitting.anchors import anchors
from brightgrey.search.fitting.enough_samples import with_enough_samples
from brightgrey.search.fitting.exact_friction import refit_all, reverses_at_once
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.missed_optima import is_explained
from brightgrey.search.fitting.refined_fit import accurate, whitening_by
from brightgrey.search.fitting.structure_fit import Options, StructureFit
from brightgrey.search.further.proposals import (
    FURTHER_STARTS,
    FurtherEffect,
    as_limiting_cases,
    effects_by_multistart,
    explains_more_in_place,
    fit_below,
    follows_further_effect,
    further_effects,
    is_bent,
    is_spring,
    least_rival_cost,
    moved_effects,
)
from brightgrey.search.lattice import Lattice
from brightgrey.search.policy import FURTHER, REFIT, SELECTION
from brightgrey.search.task import IdentificationTask
from brightgrey.search.unexplained.model_error import gains_steadily, optimum_of, signs_of_model_error

__all__ = ["OfferingSearch", "effective_samples_of"]


@dataclass
class OfferingSearch:
    """Task, lattice and table of fits of a search, and what it may be offered."""

    task: IdentificationTask
    lattice: Lattice
    executor: Executor
    seed: int = 0
    further: tuple[Placed, ...] = ()  #: Effects that are offered where those of the lattice leave model error.
    #: The lattice with some of these, and with so many masses at most.
    with_effects: Callable[[Sequence[Placed], int | None], Lattice] | None = None
    recordings: tuple[Recording, ...] = ()  #: With all samples, where the task may be given more of them.
    options: Options = field(default_factory=lambda: Options(patience=0, fresh_hard_limit=2))
    progress: Callable[[str, int, Structure], None] = field(default_factory=lambda: lambda stage, fits, best: None)

    def __post_init__(self) -> None:
        self.anchors = anchors(self.lattice)
        self.fits = FitTable(self.task, (), options=self.options, seed=self.seed, anchors=self.anchors)
        self.offered: tuple[Placed, ...] = ()
        self.restarts: dict[Structure, int] = {}  # multistarts of each structure
        self.least_cost = np.inf  # of all fits, those included that have been left out
        self._asked_cost = np.inf  # of the best fit that was asked for exact friction
        self._model_error: dict[tuple[Structure, float], bool] = {}
        #: Costs beside which no multistart with one more effect was notable, by masses, kind and lattice.
        self._in_vain: dict[tuple[int, bool, bool, tuple[Placed, ...]], float] = {}
        self._larger: dict[tuple[bool, Structure, float, tuple[Placed, ...]], StructureFit | None] = {}

    def offer_further(self, most_masses: int) -> bool:
        """Extend the lattice by effects that explain what it leaves; returns False if there is nothing to offer.

        They are tried beside the best structure with each number of masses, fewest first: an effect at a mass that is
        there is a simpler explanation than another mass. A best fit that is poor may have model error that passes for
        noise of its own colour. Then they have to explain more than such noise would by chance.
        """
        if self.with_effects is None or len(self.offered) >= FURTHER.most:
            return False
        sure = self.has_model_error()
        if not (sure or self.fits_poorly()):
            return False
        for masses in range(1, most_masses + 1):
            pairs = [(own, fit) for own in self.best_with(masses) if (fit := self.extended(own)) is not None]
            extended = [fit for own, fit in pairs if sure or self.is_beyond_chance(own, fit, len(self.more))]
            if extended:
                self.take_offer(min(extended, key=lambda f: f.cost))
                return True
        return False

    def offer_to_fewest_masses(self) -> bool:
        """Extend the lattice by effects that explain all beside the fewest masses; returns False without any.

        The residual is white with them; or the best anchor leaves more, which is not white, and has model error or is
        less likely by BIC with the independent samples beside them. Then no more than one further mass is gone into.
        None of them takes the place of a gap, which has not been fitted yet.
        """
        if self.with_effects is None:
            return False
        masses = self.anchors[0].masses
        self.fit([s for s in self.anchors if s.masses == masses])
        self.changes_task()
        if self.is_explained():
            return False
        extended = [fit for own in self.best_with(masses) if (fit := self.extended(own)) is not None]
        found = min(extended, key=lambda f: f.cost, default=None)
        taken = [p for p in self.more if found is not None and p in found.structure.placed]
        if found is None or any(p.excludes(q) for p in taken for q in self.lattice.atoms):
            return False
        if not self.is_explained(found):
            self.fit(self.anchors)
            best, n = self.fits.best(), max(effective_samples_of(self.task, found), 2.0)
            is_likelier = bic(positive(found.cost), n, found.free) < bic(positive(best.cost), n, best.free)
            if found.cost > best.cost or self.is_explained() or not (is_likelier or self.has_model_error()):
                return False
        self.take_offer(found)
        return True

    def take_offer(self, found: StructureFit) -> None:
        """Extend the lattice by the further effects of a fit, with one mass more at most."""
        self.offered += tuple(p for p in found.structure.placed if p in self.more)
        self.fits.done[found.structure] = found
        self.limit_masses(found.structure.masses + 1)
        self.fits.propagate({found.structure} & self.fits.done.keys(), self.executor)

    def offer_rival(self, structure: Structure, values: Mapping[str, float]) -> bool:
        """Extend the lattice by the effects of a structure beyond it; returns False if that is more than is offered."""
        found = tuple(p for p in structure.placed if p in self.more)
        if self.with_effects is None or not found or len(self.offered) + len(found) > FURTHER.most:
            return False
        self.offered += found
        self.fits.fit_from(structure, values, self.executor)
        self.limit_masses(structure.masses + 1)
        self.fits.propagate({structure} & self.fits.done.keys(), self.executor)
        return True

    def best_with(self, masses: int) -> list[StructureFit]:
        """Best fits with so many masses: without a hard limit, and with one where that tells."""
        best: dict[bool, StructureFit] = {}
        fitted = [f for s, f in self.fits.done.items() if s.masses == masses and not f.redundant_effects]
        for f in sorted(fitted, key=lambda f: f.cost):
            best.setdefault(f.structure.has_hard_limit, f)
        if len(best) > 1 and best[True].cost >= REFIT.clear_gain * best[False].cost:
            del best[True]
        return list(best.values())

    def offer_mass(self, masses: int) -> bool:
        """Offer one mass more if all that are offered with the further effects are called for."""
        return bool(self.offered) and masses >= self.most_masses and self.offer_one_mass()

    def offer_mass_left_out(self) -> bool:
        """Offer one mass more if structures that were left out, since they have more masses, explained notably more."""
        enough = self.fits.best().cost <= (1.0 + FURTHER.notable_gain) * self.least_cost
        return bool(self.offered) and not enough and self.offer_one_mass()

    def offer_one_mass(self) -> bool:
        """Take the lattice with one mass more; returns False if it has as many as there are."""
        before = self.most_masses
        self.limit_masses(before + 1)
        return self.most_masses > before

    @property
    def most_masses(self) -> int:
        """Masses of the largest structure."""
        return self.lattice.structure(self.lattice.everything).masses

    def limit_masses(self, most: int) -> None:
        """Take the lattice with the effects offered and so many masses at most, and fit its anchors.

        If the masses that are there and one more do not call for it, two more do not either.
        """
        assert self.with_effects is not None
        self.least_cost = min(self.least_cost, self.fits.best().cost)
        self.lattice = self.with_effects(self.offered, most)
        lattice = self.lattice
        for s in [s for s in self.fits.done if s.masses > most or lattice.structure(lattice.mask(s)) != s]:
            self.restarts.pop(s, None)
            self.fits.forget(s)  # too many masses, or an effect that is excluded now
        self.anchors = anchors(self.lattice)
        self.fit(self.anchors)

    def extended(self, own: StructureFit) -> StructureFit | None:
        """A fit with further effects that explain enough of what a structure leaves; None without any.

        Each explains a notable part of what those before it leave. Together they explain a third of what the best
        structure explains better, and more than all structures with an effect that they exclude.
        """
        best, reached = self.fits.best(), own
        for _ in range(min(FURTHER.at_once, FURTHER.most - len(self.offered))):
            if self.is_explained(reached):
                break
            larger = self.larger_than(reached)
            if larger is None and (reached is own or own.structure.masses == self.anchors[0].masses):
                larger = self.larger_than(reached, multistart=True)  # multistarts are cheap with the fewest masses only
            if larger is None:
                break
            reached = larger
        if reached is own:
            return None
        taken = [p for p in reached.structure.placed if p not in own.structure.placed]
        enough = own.cost - reached.cost >= FURTHER.rescued_share * (own.cost - best.cost)
        return reached if enough and reached.cost < least_rival_cost(taken, self.fits.done) else None

    def larger_than(self, own: StructureFit, *, multistart: bool = False) -> StructureFit | None:
        """A fit with one more effect, or one that only a multistart finds if asked for; each is made once."""
        known = multistart, own.structure, own.cost, self.lattice.atoms
        if known not in self._larger:
            self._larger[known] = self.by_multistart(own) if multistart else self.with_one_more(own)
        return self._larger[known]

    def with_one_more(self, own: StructureFit) -> StructureFit | None:
        """A fit with the further effect that explains most of what a structure leaves; None if none is notable.

        First-order scores choose which are fitted. Dry friction that stands at another mass is tried in its place. So
        are the limiting cases of what explains most, if they explain as much. Of those that explain alike the one with
        fewest parameters is taken. It is fitted by multistart if it is bent or stands beside the fewest masses.
        """
        found = further_effects(self.task, own, self.more, self.seed) + moved_effects(self.task, own, self.more)
        fits = self.steady(own, self.fits.tried([_with_effect(own, f) for f in found], self.executor))
        if fits:
            leader = min(fits, key=lambda f: f.cost)
            simpler = self.fits.tried(as_limiting_cases(own, leader, self.more), self.executor)
            as_good = [f for f in simpler if f.cost <= (1.0 + FURTHER.notable_gain) * leader.cost]
            fits += self.steady(own, as_good)
        parameters = {f.structure: len(f.structure.parameters) for f in fits}
        most = max((own.cost - f.cost for f in fits), default=0.0)
        alike = [f for f in fits if own.cost - f.cost >= FURTHER.alike * most]
        if not most >= FURTHER.notable_gain * own.cost:
            return None
        best = min(alike, key=lambda f: (parameters[f.structure], f.cost))
        fewest = best.structure.masses == self.anchors[0].masses  # multistarts are cheap, and less is no explanation
        if not (fewest or any(is_bent(p) for p in best.structure.placed if p not in own.structure.placed)):
            return best
        starts = self.options if fewest else FURTHER_STARTS
        anew = fit_below(self.task, best.structure, best.cost, self.seed, starts)
        return anew if anew.cost < best.cost and self.steady(own, [anew]) else best

    def by_multistart(self, own: StructureFit) -> StructureFit | None:
        """A fit with the best of some effects, each by multistart; None if none is notable.

        These are bent ones. Beside a load of the position they are springs of every kind: the load has taken their part
        with another period. It is not asked again beside a fit that is about as good, has as many masses, and had none.
        """
        structure = own.structure
        asked = structure.masses, structure.has_hard_limit, structure.may_be_unstable, self.lattice.atoms
        if abs(own.cost - self._in_vain.get(asked, np.inf)) <= FURTHER.notable_gain * own.cost:
            return None
        is_tried = is_spring if structure.may_be_unstable else is_bent
        some = [p for p in self.more if is_tried(p)]
        found = effects_by_multistart(self.task, own, some, self.seed, self.executor)
        for f in found:
            steady = self.steady(own, self.fits.tried([_with_effect(own, f)], self.executor))
            if steady:
                return steady[0]
        self._in_vain[asked] = own.cost
        return None

    def steady(self, own: StructureFit, larger: Sequence[StructureFit]) -> list[StructureFit]:
        """Those of some fits with further effects that help in most parts of the recordings, or explain all.

        A rich structure follows model error with effects that are not there, here and there.
        """
        return [f for f in larger if self.helps_steadily(own, f) or self.is_explained(f)]

    def helps_steadily(self, own: StructureFit, larger: StructureFit) -> bool:
        """True if a fit leaves notably less than a smaller one at level ``accurate``, in most parts of the time."""
        task = accurate(self.task)
        without, beside = (
            task.problem(f.structure).residuals({n: np.array([v]) for n, v in f.values.items()}, task.settings)[:, 0]
            for f in (own, larger)
        )
        notable = float(beside @ beside) <= (1.0 - FURTHER.notable_gain) * float(without @ without)
        return notable and gains_steadily(beside, without, self.task.recordings)

    def is_explained_better(self, own: StructureFit) -> bool:
        """True if a fit with one more effect explains what noise of the colour that it leaves would not by chance.

        Model error that is large and slow passes for noise of its own colour, with few independent samples. It does not
        beside the effect that explains it.
        """
        if effective_samples_of(self.task, own) > SELECTION.few_samples:
            return False
        fits = [self.larger_than(own, multistart=multistart) for multistart in (False, True)]
        found = [fit for fit in fits if fit is not None]
        return bool(found) and self.is_beyond_chance(own, min(found, key=lambda fit: fit.cost), len(self.more))

    def is_beyond_chance(self, own: StructureFit, larger: StructureFit, tried: int) -> bool:
        """True if a fit with further effects explains what noise of the colour that it leaves would not by chance.

        It is one of several that were `tried`.
        """
        left = effective_samples_of(self.task, larger) - larger.free
        more = max(larger.free - own.free, 1)
        ratio = (own.cost / positive(larger.cost) - 1.0) * left / more
        return left > 0.0 and float(distributions.f.sf(ratio, more, left)) <= SELECTION.false_alarm_level / tried

    def fits_poorly(self) -> bool:
        """True if the best fit is poor, and its residual neither white nor within the accuracy of the simulation."""
        return self.fits.fit_percent(self.fits.best()) < FURTHER.poor_fit and not self.is_explained()

    def fit(self, structures: Sequence[Structure]) -> None:
        """Fit structures from their neighbours' optima, and their neighbours anew where that helps."""
        new = [s for s in structures if s not in self.fits.done]
        if new:
            self.fits.add(new, self.executor)
            self.progress("fits", len(self.fits.done), self.fits.best().structure)

    def changes_task(self, is_simpler: Callable[[], bool] = lambda: False) -> bool:
        """Take more samples, or exact friction, for all structures; returns False if neither is called for.

        Samples are called for by the error that the others make of the best fit. Exact friction is if the best fit
        explains more with it, or if a model `is_simpler`. Each best fit is asked once.
        """
        best, asked = self.fits.best(), self._asked_cost
        self._asked_cost = best.cost
        is_new, changed = best.cost < REFIT.improved * asked, False
        if is_new and (finer := self.with_enough_samples(best)) is not None:
            self.take_task(finer)
            best, changed = self.fits.best(), True
            self._asked_cost = best.cost
        notable = material_growth(model_error=True)  # what leads so early may have any model error
        if (is_new and reverses_at_once(self.task, best, notable)) or (not changed and is_simpler()):
            self.take_task(replace(self.task, exact_friction=True))
            changed = True
        return changed

    def with_enough_samples(self, best: StructureFit) -> IdentificationTask | None:
        """The task with more samples if the best fit shows that some are missing; None if not.

        A residual with few independent samples is model error, which is larger than the error of decimation.
        """
        if not (self.recordings and np.isfinite(best.cost)):
            return None
        independent = effective_samples_of(self.task, best)
        few = independent <= SELECTION.few_samples
        return None if few else with_enough_samples(self.task, self.recordings, best, independent)

    def take_task(self, task: IdentificationTask) -> None:
        """Fit all structures again for a task that has changed."""
        self.task = self.fits.task = task
        refit_all(self.fits, self.executor)
        self.least_cost = np.inf  # that with a width, or with fewer samples, may have been less
        self.restarts.clear()
        self._larger.clear()
        self._in_vain.clear()

    def is_explained(self, fitted: StructureFit | None = None) -> bool:
        """True if the residual of a fit, the best by default, is white or no larger than known errors."""
        return is_explained(self.fits, fitted)

    def has_model_error(self) -> bool:
        """True if the best residual follows a pattern or a further effect by more than coloured noise explains.

        Further effects in the place of others are asked, too. So is a fit with one more, until effects have been
        offered and where few samples are independent: it is not hidden by large slow model error.
        """
        best = self.fits.best()
        known, trusted = (best.structure, best.cost), self.fits.error_floor_cost(best, TRUSTED_ACCURACY)
        if known not in self._model_error:
            self._model_error[known] = not self.is_explained() and bool(
                follows_further_effect(self.task, best, self.more, self.seed)
                or signs_of_model_error(self.task, best.structure, optimum_of(self.task, best), trusted)
                or explains_more_in_place(self.task, best, self.more, self.seed, self.executor)
                or (self.more and not self.offered and self.is_explained_better(best))
            )
        return self._model_error[known]

    @property
    def more(self) -> list[Placed]:
        """Further effects that have not been offered."""
        return [p for p in self.further if p not in self.lattice.atoms]


def effective_samples_of(task: IdentificationTask, fitted: StructureFit) -> float:
    """Number of independent samples whose mean is as exact as that of the residual of a fit."""
    whitening = whitening_by(task, fitted.structure, fitted.values)
    lengths = zip(whitening.models, whitening.lengths, strict=True)
    return float(sum(model.effective_samples_mean(n) for model, n in lengths))


def _with_effect(own: StructureFit, found: FurtherEffect) -> tuple[Structure, dict[str, float]]:
    """A structure with a further effect and what it requires, and the values from which it is fitted."""
    return Structure((*own.structure.placed, *found.added)), {**own.values, **found.start}
