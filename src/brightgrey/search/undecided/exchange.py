"""Exchange of an effect of a structure for others: fits that are adequate as those of the lattice are.

The Jacobian at an optimum and one simulation of each other effect predict what an exchange would leave. What may
explain as well is fitted. So is an effect with no more parameters that explains a good part of what is lost: the
prediction may be off by far more than chance, where there is little noise. Several effects together may take a place,
too, where none of them does alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from brightgrey.kit import Placed, Structure, function_set
from brightgrey.search.adequacy import Deviance
from brightgrey.search.detectability import Detectability
from brightgrey.search.fitting.refined_fit import Refined, accurate, refine
from brightgrey.search.fitting.structure_fit import fit_multistart
from brightgrey.search.fitting.warm_start import handed_down
from brightgrey.search.further.proposals import (
    FURTHER_STARTS,
    EffectChanges,
    FurtherEffect,
    added_with,
    by_score,
    effects_by_multistart,
    further_effects,
    is_spring,
    limiting_cases,
    limiting_cases_within,
    moved_effects,
)
from brightgrey.search.lattice import contains, mass_chain_of
from brightgrey.search.parallel import in_order
from brightgrey.search.policy import BORDER, FURTHER
from brightgrey.search.undecided.exchange_prediction import (
    WithoutEffect,
    linearised,
    without_effect,
    without_effects,
)

__all__ = ["Exchange", "refutes"]


@dataclass(frozen=True)
class Exchange:
    """Exchange of one effect for another, or for several."""

    detectability: Detectability
    effects: tuple[Placed, ...]
    seed: int
    minimal: list[Structure]  #: Structures that are known to explain as well; what contains one is not fitted.
    within: Structure | None  #: What explains better than the structures within this one does not count.
    fitted: dict[Structure, Refined] = field(default_factory=dict)

    def still_rivals(self, known: Sequence[Refined]) -> list[Refined]:
        """Those of some rivals that are beyond the lattice, with no more masses than it has, and still adequate."""
        masses = max(p.effect.masses for p in (*self.allowed, Placed("one_mass")))
        new = [r for r in known if r.structure.masses <= masses and self.is_new(r.structure)]
        beyond = [(r.structure, r.values) for r in new if self.is_beyond_lattice(r.structure)]
        rivals = [end for end in self.ends(beyond) if self.is_adequate(end)]
        self.minimal.extend(r.structure for r in rivals)
        return rivals

    def of(self, own: Refined) -> list[Refined]:
        """Adequate fits with an effect of a structure exchanged, which lack what they can."""
        at, found = linearised(self.detectability.refined, own), list[Refined]()
        changes = at.changes(self.effects, self.seed)
        for gone in (p for p in self.removable(own.structure) if not p.effect.has_hard_limit):
            without = at.without(gone)
            starts = self.promising(own, gone, without, changes) | self.moved(own, gone)
            found += self.rivals(own.values, without.structure, starts) + self.limiting(own, gone)
        return found + self.of_excluded(own)

    def of_several(self, own: Refined) -> list[Refined]:
        """Fits with several effects in the place of one, if together they promise to explain most of what it does."""
        at, found = linearised(self.detectability.refined, own), list[Refined]()
        changes = at.changes(self.smooth, self.seed)
        for gone in (p for p in self.removable(own.structure) if not p.effect.has_hard_limit):
            without = at.without(gone)
            deviance, effects = without.with_several(changes)
            enough = FURTHER.shared_out * (without.deviance - own.deviance)
            if deviance <= self.far(own) or without.deviance - deviance >= enough:
                found += self.with_all(own, without.structure, effects)
        return found

    def of_refuted(self, best: Refined, refuted: Sequence[Structure]) -> list[Refined]:
        """Adequate fits of what is within refuted structures with a further effect, which lack what they can.

        The best fit within each of them may have one mass more than the minimal structures. So it may have what is
        there but at another mass. What explains no more than the `best` one but by chance is a richer way to say so.
        """
        d, found = self.detectability, list[Refined]()
        most = min((s.masses for s in self.minimal), default=1) + 1
        table = d.refined.all(d.circumstances.threshold_of_one_test)
        for whole in refuted:
            within = [r for s, r in table.items() if s.masses <= most and contains(whole, s)]
            if within:
                own = d.refined.of(min(within, key=lambda r: (r.deviance, r.free)).structure)
                scored = linearised(d.refined, own).beside(self.effects, self.seed)
                near = own.deviance - self.far(own)
                worth = [f for score, f in scored if score >= near][: FURTHER.exchanged]
                moved = moved_effects(d.refined.task, own, self.effects)
                ends = self.with_each(own.values, own.structure, {f.placed: f.start for f in (*worth, *moved)})
                found += self.reached([end for end in ends if refutes(d, end, best, len(self.effects))])
        return found

    @cached_property
    def required(self) -> frozenset[Placed]:
        """Masses and effects that every structure has."""
        lattice = self.detectability.circumstances.lattice
        return frozenset(p for i, p in enumerate(lattice.atoms) if lattice.required >> i & 1)

    @cached_property
    def allowed(self) -> frozenset[Placed]:
        """Masses and effects that a structure may have."""
        lattice = self.detectability.circumstances.lattice
        return frozenset((*(p for i, p in enumerate(lattice.atoms) if lattice.everything >> i & 1), *self.effects))

    @cached_property
    def smooth(self) -> list[Placed]:
        """Effects without a hard limit that a structure may have."""
        found = [p for p in self.allowed if not (p.effect.masses or p.effect.has_hard_limit)]
        return sorted(found, key=lambda p: (p.effect.number, p.place))

    def removable(self, structure: Structure) -> list[Placed]:
        """Effects beside the masses that are not required."""
        return [p for p in structure.placed if not p.effect.masses and p not in self.required]

    def is_new(self, structure: Structure) -> bool:
        """True for a legal structure that contains none that explains as well."""
        return not (any(contains(structure, s) for s in self.minimal) or function_set().broken_rule(structure))

    def promising(
        self, own: Refined, gone: Placed, without: WithoutEffect, changes: Sequence[EffectChanges]
    ) -> dict[Placed, Mapping[str, float]]:
        """Effects that may take the place of one by first-order scores, each with its start."""
        scored = by_score([without.beyond(c) for c in changes], without.left)
        near, like = without.deviance - self.far(own), FURTHER.imitated_share * (without.deviance - own.deviance)
        most = _parameter_count(p for p in own.structure.placed if p not in without.structure.placed)
        worth = [f for score, f in scored if score >= near or (score >= like and _parameter_count(f.added) <= most)]
        cases = limiting_cases_within(without.structure.placed)  # one in the place of another: no slope tells
        worth = worth[: FURTHER.exchanged] + [
            f for _, f in scored if gone.name != f.placed.name and {gone.name, f.placed.name} <= cases
        ]
        return {f.placed: f.start for f in worth}

    def moved(self, own: Refined, gone: Placed) -> dict[Placed, dict[str, float]]:
        """The same effect at other masses or shafts, with the values that it has."""
        return {
            p: {p.parameter(q.symbol): own.values[gone.parameter(q.symbol)] for q in gone.effect.parameters}
            for p in self.effects
            if p.name == gone.name and p not in own.structure.placed
        }

    def limiting(self, own: Refined, gone: Placed) -> list[Refined]:
        """Fits with the limiting cases of an effect in its place, and with one effect more where they leave much.

        Together they have no more parameters than it. No derivative tells of them, where such an effect carries a load.
        """
        bare, cases = without_effect(own.structure, gone), limiting_cases(own, gone, self.allowed)
        new = [p for p in cases if p not in bare.placed]
        structure = Structure((*bare.placed, *new))
        if set(new).isdisjoint(self.effects) or not self.is_new(structure):
            return []
        values = dict(own.values)
        for sizes in cases.values():
            values |= sizes
        ends = self.ends([(structure, values)])
        room = len(gone.effect.parameters) - _parameter_count(new)
        if room and not self.is_adequate(ends[0]):
            others = [p for p in self.smooth if p not in structure.placed]
            scored = [f for _, f in linearised(self.detectability.refined, ends[0]).beside(others, self.seed)]
            small = [f for f in scored if _parameter_count(f.added) <= room][: FURTHER.exchanged]
            larger = [(Structure((*structure.placed, *f.added)), {**ends[0].values, **f.start}) for f in small]
            ends += self.ends([(s, start) for s, start in larger if self.is_new(s)])
        return self.reached(ends)

    def is_beyond_lattice(self, structure: Structure) -> bool:
        """True for a structure with an effect that the lattice lacks; it has decided all others."""
        return not structure.beside.isdisjoint(self.effects)

    def with_all(self, own: Refined, bare: Structure, effects: Sequence[FurtherEffect]) -> list[Refined]:
        """An adequate fit of `bare` with some effects, but those that others exclude; none that needs one of them only.

        One alone was tried where that may be more than the effect that is gone as a limiting case.
        """
        structure, values = bare, dict(own.values)
        for f in effects:
            larger = Structure((*structure.placed, *(p for p in f.added if p not in structure.placed)))
            if not function_set().broken_rule(larger):
                structure, values = larger, {**f.start, **values}
        if not (self.is_beyond_lattice(structure) and self.is_new(structure)):
            return []
        (end,) = self.ends([(structure, values)])
        if not self.is_adequate(end):
            return []
        end = self.reduced(end)
        return self.taken([end] if len(end.structure.beside - bare.beside) > 1 else [])

    def of_excluded(self, own: Refined) -> list[Refined]:
        """Fits with what excludes an effect of a structure in its place, by multistart: the two are never beside."""
        task, found = self.detectability.refined.task, list[Refined]()
        for other in self.effects:
            for gone in (p for p in self.removable(own.structure) if p.excludes(other)):
                bare = without_effect(own.structure, gone)
                rival = Structure((*bare.placed, other))
                if self.is_new(rival):
                    values = fit_multistart(task, rival, FURTHER_STARTS, self.seed).values
                    found += self.rivals(own.values, bare, {other: values})
        return found

    def of_hard(self, own: Refined) -> list[Refined]:
        """Fits with a further effect in the place of the last mass, or of a gap.

        No derivative tells what these leave: the structure without them is fitted, and then with each of the effects.
        A mass brings damping, too, which friction may have to give then. So its place is also taken beside all other
        effects. Springs are fitted by multistart there: no first step leads to another resonance.
        """
        lattice, found = self.detectability.circumstances.lattice, list[Refined]()
        mask, chain = lattice.mask(own.structure), mass_chain_of(own.structure)
        hard = sum(1 << i for i, p in enumerate(lattice.atoms) if p.effect.has_hard_limit)
        most = lattice.within(lattice.everything & ~hard | mask)
        for bit in lattice.bits(mask & ~lattice.required):
            atom = lattice.atoms[bit.bit_length() - 1]
            if atom == chain:
                for bare in dict.fromkeys(lattice.without(whole, bit) for whole in (mask, most)):
                    found += self.of_added(own, lattice.structure(bare), [p for p in self.effects if is_spring(p)])
            elif atom.effect.has_hard_limit:
                found += self.of_added(own, lattice.structure(lattice.without(mask, bit)), [])
        return found

    def of_added(self, own: Refined, structure: Structure, springs: Sequence[Placed]) -> list[Refined]:
        """Adequate fits of a structure with a further effect, from its own optimum and that of a larger one."""
        refined, executor = self.detectability.refined, self.detectability.executor
        if structure not in refined.fits.done:
            refined.fits.add([structure], executor)
        fitted = refined.fits.done[structure]
        some = effects_by_multistart(refined.task, fitted, springs, self.seed, executor)
        if fitted.equals is None:  # the values of effects that it could do without mean nothing
            some = (*further_effects(refined.task, fitted, self.effects, self.seed), *some)
        starts = {f.placed: f.start for f in some}
        begun = (fitted.values, {**fitted.values, **own.values})
        return [rival for values in begun for rival in self.rivals(values, structure, starts)]

    def rivals(
        self, values: Mapping[str, float], bare: Structure, starts: Mapping[Placed, Mapping[str, float]]
    ) -> list[Refined]:
        """Adequate fits of `bare` with each of some effects, from some values."""
        return self.reached(self.with_each(values, bare, starts))

    def with_each(
        self, values: Mapping[str, float], bare: Structure, starts: Mapping[Placed, Mapping[str, float]]
    ) -> list[Refined]:
        """Fits of `bare` with each of some effects, but those that contain what explains as well."""
        larger = {p: Structure((*bare.placed, *added_with(p, bare))) for p in starts}
        new = {p: s for p, s in larger.items() if self.is_new(s)}
        return self.ends([(s, {**values, **starts[p]}) for p, s in new.items()])

    def reached(self, ends: Sequence[Refined]) -> list[Refined]:
        """Rivals that the adequate ones of some fits lead to."""
        return self.taken([self.reduced(end) for end in ends if self.is_adequate(end)])

    def taken(self, found: Sequence[Refined]) -> list[Refined]:
        """Those of some adequate fits that contain no structure which is known to explain as well."""
        proper = [end for end in found if not self.is_at_limit(end)]
        least = {end.structure: end for end in proper if not any(contains(end.structure, s) for s in self.minimal)}
        self.minimal.extend(least)
        return list(least.values())

    def is_at_limit(self, end: Refined) -> bool:
        """True if a parameter of a further effect, but its size, has run to a bound that the user did not set.

        The effect stands for another one there: Stribeck friction that fades at no speed is Coulomb friction.
        """
        beyond = end.structure.beside.intersection(self.effects)
        shapes = {p.parameter(q.symbol) for p in beyond for q in p.effect.parameters if not q.size}
        return any(n in shapes and n not in self.detectability.refined.task.bounds for n in end.at_bound)

    def reduced(self, own: Refined) -> Refined:
        """A rival without the masses and the effects that it does not need, but beyond the lattice."""
        while (joined := self.last_masses_joined(own)) is not None and self.is_adequate(joined):
            own = joined
        while (smaller := self.without_needless(own)) is not own:
            own = smaller
        return own

    def without_needless(self, own: Refined) -> Refined:
        """An adequate fit without some effects of a rival, but beyond the lattice; itself if it needs them all.

        Those that promise to be needless are left out together, then the half of them that promises most, and so on;
        at last each alone.
        """
        at, needless, cases = linearised(self.detectability.refined, own), list[tuple[float, Placed]](), list[Placed]()
        of_others = limiting_cases_within(own.structure.placed)
        for p in self.removable(own.structure):
            if self.is_beyond_lattice(without_effect(own.structure, p)):
                predicted = at.without(p).deviance
                if predicted <= self.far(own):
                    needless.append((predicted, p))
                elif p.name in of_others:
                    cases.append(p)
        order = [p for _, p in sorted(needless, key=lambda pair: pair[0])]
        several = len(order)
        while several > 1:
            structure = without_effects(own.structure, order[:several])
            if self.is_beyond_lattice(structure) and self.is_adequate(end := self.ends([(structure, own.values)])[0]):
                return end
            several //= 2
        ends = self.ends([(without_effect(own.structure, p), own.values) for p in (*order, *cases)])
        best = min(ends, key=lambda end: end.deviance, default=own)
        return best if self.is_adequate(best) else own

    def last_masses_joined(self, own: Refined) -> Refined | None:
        """Fit with the last two masses as one, which has the effects of both.

        None with as few masses as are required, or where that is a structure of the lattice, which has decided it. So
        it is where it takes an excluded effect, or leaves out a required one.
        """
        last, least = own.structure.masses, max((p.effect.masses for p in self.required), default=1)
        if last <= least:
            return None
        chain = next(p for p in function_set().whole.placed if p.effect.masses == last - 1)
        on_mass = {p: Placed(p.name, last - 1) for p in own.structure.beside if p.effect.where == "mass"}
        moved = {p: q for p, q in on_mass.items() if p.place == last}
        beside = [moved.get(p, p) for p in own.structure.placed if not p.effect.masses]
        beside = [p for p in beside if p.effect.where != "shaft" or p.place < last - 1]
        structure = Structure((chain, *dict.fromkeys(beside)))
        wanted = {p for p in self.required if not p.effect.masses}
        if function_set().broken_rule(structure) or not wanted <= structure.beside <= self.allowed:
            return None
        if not self.is_beyond_lattice(structure):
            return None
        values = dict(own.values)
        for p, q in moved.items():
            if q not in own.structure.placed:
                values |= {q.parameter(s.symbol): own.values[p.parameter(s.symbol)] for s in p.effect.parameters}
        space = self.detectability.refined.task.space(structure, nuisances=True)
        *_, start = handed_down(values, None, own.structure, structure, space)  # the last way joins the last two masses
        return self.ends([(structure, start)])[0]

    def ends(self, starts: Sequence[tuple[Structure, Mapping[str, float]]]) -> list[Refined]:
        """Refined fits from some values; once more where these are better than the end of an earlier fit."""
        refined, workers = self.detectability.refined, self.detectability.executor
        worth = [(s, values) for s, values in starts if self.is_worth_a_fit(s, values)]
        fits = refined.fits.tried(worth, workers, growing=True)
        calls = [(refined.task, f.structure, f.values, refined.whitening, np.inf) for f in fits]
        for end in in_order(workers, refine, calls):
            known = self.fitted.get(end.structure, end)
            self.fitted[end.structure] = min(known, end, key=lambda r: r.deviance)
        return [self.fitted[s] for s, _ in starts]

    def limit(self, end: Refined) -> float:
        """Largest deviance with which a structure is adequate that has as many parameters and masses as a fit."""
        d = self.detectability
        table = d.refined.all(d.circumstances.threshold_of_one_test)
        counted = [r for s, r in table.items() if self.within is None or contains(self.within, s)]
        own, *known = (Deviance(r.deviance, r.free, r.structure.masses) for r in (end, *counted))
        return d.circumstances.limit(own, d.circumstances.least(known))

    def is_adequate(self, end: Refined) -> bool:
        """True for a structure that would be adequate if it were in the lattice."""
        return end.deviance <= self.limit(end)

    def is_worth_a_fit(self, structure: Structure, values: Mapping[str, float]) -> bool:
        """True for a structure that has not been fitted, or is better at some values than after an inadequate fit."""
        known = self.fitted.get(structure)
        if known is None or self.is_adequate(known):
            return known is None
        task = self.detectability.refined.task
        problem, space = task.problem_and_space(structure)
        begin = [values.get(n, v) for n, v in zip(space.names, space.start, strict=True)]
        start = np.clip(begin, space.low, space.high)
        at = {name: np.array([value]) for name, value in (*zip(space.names, start, strict=True), *space.fixed.items())}
        return float(problem.costs(at, accurate(task).settings)[0]) < known.cost

    def far(self, own: Refined) -> float:
        """Predicted deviance above which an exchange is not worth a fit."""
        return self.limit(own) + BORDER.far * self.detectability.circumstances.chance(1)


def refutes(detectability: Detectability, rival: Refined, own: Refined, choices: int) -> bool:
    """True if a rival explains more than chance gives it, where it is the best one of some choices of effects."""
    more = max(rival.structure.masses - own.structure.masses, 0)
    enough = detectability.threshold(own.structure, rival.free - own.free, more, among=choices)
    return rival.deviance < own.deviance - enough


def _parameter_count(placed: Iterable[Placed]) -> int:
    """Number of parameters of some effects."""
    return sum(len(p.effect.parameters) for p in placed)
