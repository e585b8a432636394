"""Verdict on every effect: needed, not needed, or not decidable from the recordings.

Every structure that contains the true one fits as well, so neither one winner nor a list of all good fits says much.
Nothing can be removed from a *minimal* structure, and nothing has to be added to it. An effect that all minimal
structures have is needed. *Optional* effects would not have shown in these recordings at a size that matters, or show
without mattering.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from brightgrey.kit import Placed, Structure
from brightgrey.kit.in_words import effect_in_words
from brightgrey.kit.structure import Verdict
from brightgrey.numerics.distributions import f
from brightgrey.recordings.units.signals import Units
from brightgrey.search.border import Border
from brightgrey.search.certificate import Certificate
from brightgrey.search.detectability import Detectability, Obstacle
from brightgrey.search.fitting.refined_fit import Refined
from brightgrey.search.lattice import has
from brightgrey.search.policy import SELECTION
from brightgrey.search.task import IdentificationTask
from brightgrey.search.undecided.open_choice import open_choice
from brightgrey.search.undecided.question import OpenQuestions
from brightgrey.search.unexplained.doubtful import Doubts
from brightgrey.search.verdicts import EffectVerdict, Reason, Size, size_in_units

__all__ = ["EffectVerdict", "Evidence", "assess_effects", "with_model"]

_PARAMETERS_OF_A_MASS = 3  # an inertia, a spring and a damper


@dataclass(frozen=True)
class Evidence:
    """Result of :func:`assess_effects`."""

    minimal: tuple[Refined, ...]  #: The best first; rivals, with an effect that the lattice has no place for, last.
    #: Effects that beside one of the minimal structures would not have shown at a size that matters, or that explain
    #: too little to matter but more than chance.
    optional: tuple[str, ...]
    cards: tuple[EffectVerdict, ...]
    refined: Mapping[Structure, Refined]  #: Refined fits of all structures of the table.
    criterion: Mapping[Structure, float]  #: Bayesian information criterion by the deviance; less is better.
    #: 'minimal', 'adequate', 'refuted', 'undecided', 'rival': as good, with an effect in the place of another, or
    #: 'steady': handed back, and lacks what helps in some parts of the recordings only or is of unknown size.
    status: Mapping[Structure, str]
    certificate: Certificate
    independent: float  #: Independent samples that the residuals are worth.
    questions: OpenQuestions | None = None  #: What is left open, for the design of the next motion.
    held_back: tuple[EffectVerdict, ...] = ()  #: On effects that were not offered, at first order.
    #: NRMSE fit in percent of each recording by a model of the others; nothing for fewer than three recordings.
    left_out: Mapping[Structure, tuple[float, ...]] = field(default_factory=dict)
    #: The best minimal one without effects that help in some parts of the recordings only, and with optional effects by
    #: which it fits notably better; None where that is the minimal one itself.
    chosen: Refined | None = None

    @property
    def first(self) -> Refined:
        """The structure that is handed back."""
        return self.chosen or self.minimal[0]


@dataclass(frozen=True)
class _Case:
    """All that verdicts rest on."""

    detectability: Detectability
    border: Border
    doubts: Doubts
    certificate: Certificate
    rivals: Sequence[Structure]  #: Structures beyond the lattice that fit as well as the model.

    @property
    def task(self) -> IdentificationTask:
        """The task of the search."""
        return self.detectability.refined.task

    @property
    def found(self) -> tuple[Structure, ...]:
        """The minimal structures, the best first."""
        return self.doubts.found

    def compared(self, effect: str) -> tuple[Structure, ...]:
        """The minimal structures, and their rivals unless these lack an effect since the model does."""
        left_out = has(self.found[0], effect) and not has(self.doubts.model, effect)
        return self.found if left_out else (*self.found, *self.rivals)

    def with_effect(self, effect: str) -> list[Structure]:
        """Those of them that have an effect, and rivals that have another one in its place which contains it."""
        compared = self.compared(effect)
        having = [s for s in compared if has(s, effect)]
        return having + [s for s in compared if s not in having and having and self.containing(s, effect)]

    def containing(self, rival: Structure, effect: str) -> list[Placed]:
        """Effects that a rival has in the place of one which they contain."""
        name = Placed.parse(effect).name
        beside = frozenset[Placed]().union(*(s.beside for s in self.found if has(s, effect)))
        return [] if has(rival, effect) else [p for p in rival.placed if p not in beside and name in p.effect.contains]

    def is_open(self, effect: str) -> bool:
        """True if some of them have an effect and others lack it."""
        return 0 < len(self.with_effect(effect)) < len(self.compared(effect))

    @property
    def units(self) -> Units:
        """Units in which sizes are shown."""
        return self.task.recordings[0].units


def assess_effects(
    detectability: Detectability,
    border: Border,
    doubts: Doubts,
    certificate: Certificate,
    rivals: Sequence[Structure] = (),
) -> tuple[tuple[str, ...], tuple[EffectVerdict, ...]]:
    """Optional effects, and the verdict on every effect that some structures have and others lack.

    Parameters
    ----------
    detectability : Detectability
    border : Border
    doubts : Doubts
        With the minimal structures.
    certificate : Certificate
    rivals : sequence of Structure
        Structures beyond the lattice that fit as well as the model without doubtful effects.
    """
    case = _Case(detectability, border, doubts, certificate, rivals)
    lattice = detectability.circumstances.lattice
    effects = [str(p) for i, p in enumerate(lattice.atoms) if lattice.optional >> i & 1]
    against: dict[str, tuple[Structure, Reason]] = {}
    for s in doubts.found:  # one doubt decides an effect
        against = _doubts(case, s, [e for e in effects if not has(s, e) and e not in against], against)
    optional = tuple(e for e in effects if e in against or (rivals and case.is_open(e)))
    return optional, tuple(_verdict(case, e, against.get(e)) for e in effects)


def with_model(card: EffectVerdict, minimal: Structure, model: Structure) -> EffectVerdict:
    """Verdict that says why the model that is handed back has or lacks an effect, unlike the best minimal structure."""
    if has(minimal, card.effect) == has(model, card.effect):
        return card
    reason = Reason("fits better" if has(model, card.effect) else "left out")
    return replace(card, why=replace(card.why, further=(*card.why.further, reason)))


def _doubts(
    case: _Case, structure: Structure, effects: Sequence[str], known: Mapping[str, tuple[Structure, Reason]]
) -> dict[str, tuple[Structure, Reason]]:
    """Effects beside a structure that cannot be called needless, with the structure and a reason.

    What requires an effect that the structure lacks may be there if that may. It is not tested.
    """
    d, against = case.detectability, dict(known)
    alone = [e for e in effects if d.can_be_added(structure, e)]
    d.refined.of_all([d.with_effect(structure, e) for e in alone])
    tests = {e: d.refutation(structure, e) for e in alone}  # side by side
    doubts = {e: _doubt(case, structure, e, test) for e, test in tests.items()}
    against |= {e: (structure, doubt) for e, doubt in doubts.items() if doubt is not None}
    for effect in (e for e in effects if e not in alone):  # each after what it requires
        missing = d.missing(structure, effect)
        if all(e in against for e in missing):
            against[effect] = structure, Reason("needs further effects", names=_words_for(missing))
    return against


def _words_for(effects: Sequence[str]) -> tuple[str, ...]:
    return tuple(effect_in_words(Placed.parse(e)) for e in effects)


def _doubt(case: _Case, structure: Structure, effect: str, test: Obstacle | Callable[[], bool]) -> Reason | None:
    """Reason why an effect beside `structure` cannot be called needless; None if it can."""
    d = case.detectability
    refuted = not isinstance(test, Obstacle) and test()
    gain = d.gain(structure, effect)
    if gain > SELECTION.notable_gain:
        return Reason("gain below threshold", {"gain": 100.0 * gain})
    if d.tells(structure, effect):
        return Reason("small gain")
    if isinstance(test, Obstacle):
        names = (effect_in_words(Placed.parse(test.other)),) if test.other else ()
        return Reason(test.kind, size=size_in_units(case.units, effect, [test.size]), names=names)
    return (
        None
        if refuted
        else Reason(
            "fits with fixed size",
            size=size_in_units(case.units, effect, d.relevant_sizes(structure, effect)),
        )
    )


def _verdict(case: _Case, effect: str, against: tuple[Structure, Reason] | None) -> EffectVerdict:
    """Verdict on one effect, by the minimal structures, and by one of them with a reason not to call it needless."""
    found, d = case.found, case.detectability
    having = case.with_effect(effect)
    loss = case.certificate.loss(effect)
    gain = d.gain(found[0], effect) if d.can_be_added(found[0], effect) else None
    verdict: Verdict = "not decidable"
    if len(having) == len(case.compared(effect)):
        reservation = _reservation(case, effect)
        remarks = [reservation] if reservation else _alike(case, effect)
        why = replace(_needed(loss), further=tuple(remarks))
        verdict = verdict if reservation else "needed"
    elif having:
        late = _below_sampling(case, having[0], effect) if having[0] in found else None
        doubt = Reason(case.doubts.reasons[effect]) if effect in case.doubts.reasons else None
        why = replace(open_choice(case.compared(effect), effect), further=tuple(r for r in (late, doubt) if r))
    elif against:
        structure, why = against
        if why.kind == "not detectable":
            why = replace(why, limit=_detection_limit(case, effect, structure))
    else:
        verdict, why = "not needed", _refuted(case, effect)
    return EffectVerdict(effect, verdict, loss, gain, why)


def _alike(case: _Case, effect: str) -> list[Reason]:
    """Remark that effects which contain this one explain as well."""
    larger = dict.fromkeys(effect_in_words(p) for s in case.rivals for p in case.containing(s, effect))
    return [Reason("contained", names=tuple(larger))] if larger else []


def _reservation(case: _Case, effect: str) -> Reason | None:
    """Reason not to call an effect needed although all minimal structures have it."""
    lattice = case.detectability.circumstances.lattice
    bit = 1 << lattice.index(effect)
    if any(not m & bit for m in case.border.undecided):
        return Reason("undecided")
    late = _below_sampling(case, case.found[0], effect)
    if late:
        return late
    refined, placed = case.detectability.refined, Placed.parse(effect)
    masses = placed.effect.masses
    # with more masses than asked for, the last one may be a wall or too slow, and enough are left
    found = [s for s in case.found if s.masses == masses] or case.found
    if case.detectability.runs_away(found, effect):
        return Reason("inertia at bound" if masses else "gap at bound")
    moving = masses or placed.effect.has_hard_limit
    if moving and any(refined.of(s).swings_slowly(refined.task) for s in found):
        return Reason("slow mode")
    if moving and not _shows_in_few_samples(case, effect):
        return Reason("few samples")
    return Reason(case.doubts.reasons[effect]) if effect in case.doubts.reasons else None


def _shows_in_few_samples(case: _Case, effect: str) -> bool:
    """Return True if a mass or gap passes an F test with the samples that are independent, or these are many.

    A mass on a soft shaft follows any drift. With few independent samples the colour of the drift is not known, and the
    whitened cost takes its fast part for evidence.
    """
    refined, found = case.detectability.refined, case.found[0]
    samples, loss = refined.whitening.effective_samples, _least_loss(case, effect)
    left = samples - refined.of(found).free
    if samples >= SELECTION.few_samples or loss is None:
        return True
    added = Placed.parse(effect).effect
    more = _PARAMETERS_OF_A_MASS if added.masses else len(added.parameters)
    if left <= 0.0:
        return False
    ratio = ((1.0 + loss) ** 2 - 1.0) * left / more
    return float(f.sf(ratio, more, left)) <= SELECTION.false_alarm_level


def _least_loss(case: _Case, effect: str) -> float | None:
    """Loss without an effect, or without a further mass if the border refutes that: then it is at least as large."""
    placed = Placed.parse(effect)
    atoms = case.detectability.circumstances.lattice.atoms
    further = [str(p) for p in atoms if placed.effect.masses and p.effect.masses > placed.effect.masses]
    losses = (case.certificate.loss(e) for e in (effect, *further))
    return next((loss for loss in losses if loss is not None), None)


def _needed(loss: float | None) -> Reason:
    if loss is None:
        return Reason("indispensable")
    return Reason("loss", {"ratio": 1.0 + loss}) if loss > SELECTION.reported_loss else Reason("small loss")


def _refuted(case: _Case, effect: str) -> Reason:
    """Largest of the sizes that would have shown beside the minimal structures, and the estimate beside the best."""
    d = case.detectability
    found = [s for s in case.found if d.can_be_added(s, effect)]
    if not found:
        return Reason("not offered", names=_words_for(d.missing(case.found[0], effect)[:1]))
    sizes = [d.relevant_sizes(s, effect) for s in found]
    size = size_in_units(case.units, effect, max(sizes, key=lambda some: [abs(value) for value in some[0].values()]))
    big, numbers = d.with_effect(found[0], effect), {"gain": 100.0 * d.gain(found[0], effect)}
    if not size:
        return Reason("refuted without size", numbers)
    if size[0].name in d.refined.task.fixed:
        return Reason("refuted as fixed", size=size)
    values = d.refined.of(big).values
    (estimate, *_) = size_in_units(case.units, effect, [{size[0].name: values[size[0].name]}])
    if abs(estimate.value) < SELECTION.zero_share * size[0].value:
        estimate = replace(estimate, value=0.0)
    return Reason("refuted", numbers, size=size, estimate=(estimate,))


def _detection_limit(case: _Case, effect: str, structure: Structure) -> tuple[Size, ...]:
    """Size from which on the recording would have shown an effect beside a structure; empty if there is none."""
    d = case.detectability
    found = [d.detection_limit(structure, effect, least) for least in d.relevant_sizes(structure, effect)]
    both = [size for size in found if size]
    if not both or len(both) < len(found):
        return ()
    largest = {name: max(abs(size[name]) for size in both) for name in both[0]}
    return size_in_units(case.units, effect, [largest])


def _below_sampling(case: _Case, structure: Structure, effect: str) -> Reason | None:
    """Reservation on an effect that only delays the input, by less than a sample: data can be taken that way."""
    placed = Placed.parse(effect)
    if placed not in structure.placed or not placed.effect.parameters:
        return None
    if not all(p.lag for p in placed.effect.parameters):
        return None
    values = case.detectability.refined.of(structure).values
    lag = sum(values[placed.parameter(p.symbol)] for p in placed.effect.parameters)
    interval = case.task.scales.interval
    return Reason("sampling", {"lag": lag, "interval": interval}) if lag < interval else None
