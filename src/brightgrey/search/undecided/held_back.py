"""Effects that a search has not offered: a verdict on each at first order, beside the minimal structures.

At the least size that matters an effect changes the motion. The part of it that neither the parameters of the structure
nor another effect can make says whether the recording would have shown it. What that part shares with the residual says
whether it is there (Rao 1948, doi:10.1017/S0305004100023987). Only springs are fitted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.noise.orthonormal_basis import beyond
from brightgrey.kit import Grammar, Placed, Structure, function_set
from brightgrey.kit.in_words import effect_in_words
from brightgrey.kit.structure import Verdict
from brightgrey.search.detectability import Detectability, power, relevant_sizes
from brightgrey.search.fitting.refined_fit import accurate, refine, residual_and_jacobian
from brightgrey.search.fitting.structure_fit import Options
from brightgrey.search.further.proposals import fit_below, is_spring
from brightgrey.search.parallel import in_order
from brightgrey.search.policy import BORDER, FURTHER, SELECTION
from brightgrey.search.undecided.open_choice import open_choice
from brightgrey.search.verdicts import EffectVerdict, Reason, decisive, size_in_units

__all__ = ["first_order_verdicts", "verdicts_on_masses"]


def first_order_verdicts(
    detectability: Detectability,
    structures: Sequence[Structure],
    more: Sequence[Placed],
    known: Sequence[EffectVerdict],
    rivals: Sequence[Structure] = (),
    seed: int = 0,
) -> tuple[EffectVerdict, ...]:
    """Verdicts on effects that the lattice lacks: *not needed*, or *not decidable*.

    An effect that a rival has is *not decidable*. Another one is *not needed* if, beside each of the structures, it
    would have shown at the least size that matters, and the residual does not ask for it. With a spring the optimum may
    lie elsewhere: no fit by multistart may be as good, either.

    What stands at a mass that no structure has gets no verdict: it depends on that mass. What requires an effect that
    the structures lack gets the verdict of that one.

    Parameters
    ----------
    detectability : Detectability
        Of the round.
    structures : sequence of Structure
        The minimal ones.
    more : sequence of Placed
        Effects that the lattice lacks.
    known : sequence of EffectVerdict
        On the effects of the lattice.
    rivals : sequence of Structure
        Structures with some of these effects that explain as well as the minimal ones.
    seed : int
        Of the starts of springs.
    """
    doubts, needless = _first_order_tests(detectability, structures, more)
    springs = [p for p in needless if p not in doubts and is_spring(p)]
    elsewhere = _fitting_elsewhere(detectability, (*structures, *rivals), springs, seed)
    doubts |= dict.fromkeys(elsewhere, Reason("fits at relevant size"))
    said = {card.effect: card for card in known}
    found = []
    for placed in more:
        if any(placed in s.placed for s in rivals):
            why = open_choice((*structures, *rivals), str(placed))
            said[str(placed)] = EffectVerdict(str(placed), "not decidable", None, None, why)
            found.append(said[str(placed)])
            continue
        tested = placed in doubts or placed in needless
        if tested:
            reason = doubts[placed] if placed in doubts else decisive(needless[placed])
            verdict: Verdict = "not decidable" if placed in doubts else "not needed"
            found.append(EffectVerdict(str(placed), verdict, None, None, reason))
        required = [card for name in placed.effect.requires if (card := said.get(str(Placed(name, placed.place))))]
        if required and not tested:
            found.append(_as(str(placed), required[0]))
        said |= {card.effect: card for card in found}
    return tuple(found)


def _first_order_tests(
    detectability: Detectability, structures: Sequence[Structure], more: Sequence[Placed]
) -> tuple[dict[Placed, Reason], dict[Placed, list[Reason]]]:
    """The first doubt about an effect, and the reasons why others are needless beside all structures."""
    doubts: dict[Placed, Reason] = {}
    needless: dict[Placed, list[Reason]] = {}
    for structure in structures:
        if all(placed in doubts for placed in more):
            break
        beside = _Beside.of(detectability, structure, more)
        for placed in (p for p in beside.changes if p not in doubts):
            is_needless, reason = beside.test(placed)
            if is_needless:
                needless.setdefault(placed, []).append(reason)
            else:
                doubts[placed] = reason
    return doubts, needless


def _fitting_elsewhere(
    detectability: Detectability, structures: Sequence[Structure], effects: Sequence[Placed], seed: int
) -> list[Placed]:
    """Those of some effects beside which a fit by multistart is no worse than without, at a size that matters."""
    refined, kit, found = detectability.refined, function_set(), list[Placed]()
    tried = [(own, p, Structure((*own.placed, p))) for own in structures for p in effects if p not in own.placed]
    tried = [(own, p, larger) for own, p, larger in tried if not kit.broken_rule(larger)]
    enough = {s: (1.0 + FURTHER.notable_gain) * refined.of(s).cost for s in structures}
    calls = [(refined.task, larger, enough[own], seed, _SPRING_STARTS) for own, _, larger in tried]
    for (own, placed, larger), fitted in zip(tried, in_order(detectability.executor, fit_below, calls), strict=True):
        if placed not in found and fitted.cost <= enough[own] < np.inf:
            end = refine(refined.task, larger, fitted.values, refined.whitening, np.inf)
            no_worse = end.deviance <= detectability.no_worse_than(own)
            sizes = relevant_sizes(refined.task, refined.of(own).values, str(placed))
            if no_worse and any(all(abs(end.values[n]) >= abs(v) for n, v in size.items()) for size in sizes):
                found.append(placed)
    return found


def verdicts_on_masses(
    grammar: Grammar, exclude: Sequence[str], known: Sequence[EffectVerdict]
) -> tuple[EffectVerdict, ...]:
    """Verdicts on multiple-mass systems that were not offered: that on the largest one which was.

    Parameters
    ----------
    grammar : Grammar
    exclude : sequence of str
        Effects that were excluded; masses count cumulatively.
    known : sequence of EffectVerdict
        On the effects that were offered.
    """
    offered = {Placed.parse(c.effect).effect.masses: c for c in known if Placed.parse(c.effect).effect.masses}
    if not offered:
        return ()
    last = offered[max(offered)]
    most = min((Placed.parse(e).effect.masses for e in exclude if Placed.parse(e).effect.masses), default=np.inf)
    beyond = sorted(p.effect.masses for p in grammar.placed if max(offered) < p.effect.masses < most)
    names = {p.effect.masses: str(p) for p in grammar.placed}
    return tuple(_as(names[m], last) for m in beyond)


def _as(effect: str, card: EffectVerdict) -> EffectVerdict:
    """Verdict on an effect that was not tested, because another one is not called for."""
    verdict: Verdict = "not needed" if card.verdict == "not needed" else "not decidable"
    return EffectVerdict(
        effect, verdict, None, None, Reason("not offered", names=(effect_in_words(Placed.parse(card.effect)),))
    )


#: Of a spring beside a structure. With one batch a hardening shaft was found in 3 of 12 cases, with more in all.
_SPRING_STARTS = Options(fresh=2, patience=BORDER.patience)


@dataclass(frozen=True)
class _Beside:
    """Changes by effects at the least sizes that matter, beside one structure, whitened."""

    detectability: Detectability
    structure: Structure
    residual: Array  #: Beyond what the structure's parameters explain, shape (residuals,).
    sizes: Mapping[Placed, Sequence[Mapping[str, float]]]  #: Two of opposite sign for effects that have both.
    changes: Mapping[Placed, Array]  #: Of the first of the sizes, beyond the structure's parameters.

    @classmethod
    def of(cls, detectability: Detectability, structure: Structure, more: Sequence[Placed]) -> _Beside:
        """Simulate all effects that may stand beside a structure."""
        refined, kit = detectability.refined, function_set()
        task, own, whitening = refined.task, refined.of(structure), refined.whitening
        residual, jacobian, _ = refined.jacobian(structure)
        basis = whitening.basis(jacobian)
        sizes, changes = {}, {}
        for placed in more:
            larger = Structure((*structure.placed, placed))
            found = [] if kit.broken_rule(larger) else relevant_sizes(task, own.values, str(placed))
            if found:
                problem, space = task.problem_and_space(larger)
                start = dict(zip(space.names, space.start.tolist(), strict=True)) | dict(space.fixed)
                values = {**start, **own.values, **found[0]}
                moved = problem.residuals({n: np.array([v]) for n, v in values.items()}, accurate(task).settings)[:, 0]
                sizes[placed] = found
                changes[placed] = beyond(basis, whitening.whiten(moved - residual))
        return cls(detectability, structure, beyond(basis, whitening.whiten(residual)), sizes, changes)

    @cached_property
    def others(self) -> dict[Placed, Array]:
        """Orthonormal basis of what the structure can explain at first order with another effect of the lattice."""
        found = dict[Placed, Array]()
        for placed in self.detectability.circumstances.lattice.atoms:
            if self.detectability.can_be_added(self.structure, str(placed)):
                beside = self.detectability.with_effect(self.structure, str(placed))
                jacobian = self.slopes_with(beside, str(placed))
                found[placed] = self.detectability.refined.whitening.basis(jacobian)
        return found

    def slopes_with(self, beside: Structure, effect: str) -> Array:
        """Jacobian of the structure with another effect: at its fit if there is one, or at the size that matters."""
        refined = self.detectability.refined
        if beside in refined.fits.done:
            return refined.jacobian(beside)[1]
        task, own = refined.task, refined.of(self.structure).values
        size = next(iter(relevant_sizes(task, own, effect)), {})
        return residual_and_jacobian(task, beside, {**task.default_start(beside), **own, **size})[1]

    def test(self, placed: Placed) -> tuple[bool, Reason]:
        """True if an effect is needless beside the structure, and why it is, or why it cannot be called so."""
        task = self.detectability.refined.task
        change, sizes = self.changes[placed], self.sizes[placed]
        size = size_in_units(task.recordings[0].units, str(placed), sizes)
        if not self.shows(placed, change):
            return False, Reason("not detectable", size=size)
        for other, basis in self.others.items():
            if not self.shows(placed, beyond(basis, change)):
                return False, Reason("masked", size=size, names=(effect_in_words(other),))
        for other, beside in self.changes.items():
            unit = beside / max(float(np.linalg.norm(beside)), np.finfo(float).tiny)
            allowed = len(self.sizes[other]) > 1 or len(sizes) > 1 or float(unit @ change) < 0.0
            if other != placed and allowed and not self.shows(placed, beyond(unit[:, None], change)):
                return False, Reason("masked", size=size, names=(effect_in_words(other),))
        along, length = float(self.residual @ change), float(change @ change)
        step = -along / length if len(sizes) > 1 or along < 0.0 else 0.0
        explained, deviance = step * step * length, self.detectability.refined.of(self.structure).deviance
        gain = 1.0 - float(np.sqrt(max(1.0 - explained / deviance, 0.0)))
        if gain > SELECTION.notable_gain:
            return False, Reason("gain below threshold", {"gain": 100.0 * gain})
        if explained > self.detectability.circumstances.chance(self.parameters(placed)):
            return False, Reason("small gain")
        signs = (1.0, -1.0)[: len(sizes)]
        enough = self.detectability.circumstances.by_chance()
        if not all(length + 2.0 * sign * along > enough for sign in signs):
            return False, Reason("fits with fixed size", size=size)
        return True, Reason("refuted at first order", {"gain": 100.0 * gain}, size=size)

    def shows(self, placed: Placed, change: Array) -> bool:
        """True if a whitened change would have been detected."""
        free = self.parameters(placed)
        critical = self.detectability.threshold(self.structure, free)
        return power(float(change @ change), free, critical) >= SELECTION.min_power

    def parameters(self, placed: Placed) -> int:
        """Number of parameters of an effect that are estimated."""
        fixed = self.detectability.refined.task.fixed
        return sum(placed.parameter(q.symbol) not in fixed for q in placed.effect.parameters)
