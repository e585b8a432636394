"""Headline of a result: what was found, what is absent, how well it fits and what stays open, in sentences."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from brightgrey.kit import Placed, Structure, function_set
from brightgrey.kit.in_words import effect_in_words, effects_in_words, enumerated, masses_in_words
from brightgrey.model.model import Model
from brightgrey.recordings.units.amounts import rounded
from brightgrey.report.content import Content
from brightgrey.report.text.prose import doubtful_in_words, left_out_in_words, listing
from brightgrey.report.text.tables import fit_rows, parameter_rows
from brightgrey.search.policy import FURTHER

__all__ = ["Headline", "beside_minimal", "headline"]


@dataclass(frozen=True)
class Headline:
    """Sentences of a headline by what they speak of; empty where there is nothing to say."""

    found: str  #: Masses, shafts and effects of the model, and that the search was stopped if it was.
    absent: str  #: Effects that the recording excludes, with the size from which on they would have shown.
    fit: str  #: Fit of every output, and of the test recording.
    #: Something that nothing explains, effects that the recording does not decide, structures that explain it as well.
    open: str

    @property
    def sentences(self) -> tuple[str, ...]:
        """The parts that say something."""
        return tuple(part for part in (self.found, self.absent, self.fit, self.open) if part)


def headline(content: Content) -> Headline:
    """Headline of a result.

    Parameters
    ----------
    content : Content
        Its model and its evidence; the linear model gives the resonances.
    """
    found = _found_sentence(content)
    if content.stopped:
        found = f"The search was stopped: this is the best structure so far, and no effect is decided. {found}"
    return Headline(found, _absent(content), _fit(content), _open(content))


def _found_sentence(content: Content) -> str:
    structure = content.model.structure
    masses = f"{masses_in_words(structure).capitalize()}{_coupling(content)}"
    effects = effects_in_words(p for p in structure.placed if not p.effect.masses)
    if not effects:
        return f"{masses}, without friction or load."
    whole = listing(f"{masses}, with", effects, "and")
    return whole if whole.count(". ") == 0 else f"{masses}. {listing('The drive has', effects, 'and')}"


def _coupling(content: Content) -> str:
    """Size of a single mass, or the shafts (springs, in a linear axis) between several with their resonances."""
    masses, link = content.model.structure.masses, "shaft" if content.model.is_rotary else "spring"
    if masses == 1:
        row = parameter_rows(content.model)[0]
        return f" of {row.value} {row.unit}"
    shafts = f"a {link}" if masses == 2 else f"{link}s"
    found = content.assembled.analysis
    heights = [rounded(mode.frequency, 3) for mode in found.resonances] if found else []
    if not heights:
        return f", coupled by {shafts}"
    word = "a resonance" if len(heights) == 1 else "resonances"
    return f", coupled by {shafts} with {word} at {enumerated(heights)} Hz"


def _absent(content: Content) -> str:
    items = []
    for card in content.evidence.cards if content.evidence else ():
        if card.verdict == "not needed":
            words = effect_in_words(Placed.parse(card.effect), article=False)
            size = " at ".join(map(str, card.why.size))
            items.append(f"{words} above {size}" if size and card.why.kind == "refuted" else words)
    return listing("No", items, "or")


def _fit(content: Content) -> str:
    return " ".join(_fit_sentences(content))


def _fit_sentences(content: Content) -> Iterable[str]:
    rows = fit_rows(content.model)
    for on, where in (("train", ""), ("test", " of the test recording")):
        some = [row for row in rows if row.on == on]
        fits = [
            f"{row.output} to {row.fit_percent} % (RMSE {row.rmse} {row.unit})"
            for row in some
            if row.fit_percent != "diverged"
        ]
        lost = [row.output for row in some if row.fit_percent == "diverged"]
        if fits:
            yield listing("The model fits", fits, "and", where)
        if lost:
            yield listing("The simulation of", lost, "and", f"{where} diverges")


def _open(content: Content) -> str:
    model, parts = content.model, []
    if content.evidence:
        if content.evidence.certificate.unexplained:
            parts.append("The recording holds something that none of the structures offered explains.")
        some = [c for c in content.evidence.cards if c.verdict == "not decidable"]
        alternatives = dict.fromkeys(name for c in some if c.why.kind == "one of several" for name in c.why.names)
        items = effects_in_words([Placed.parse(c.effect) for c in some if c.why.kind != "one of several"], "or")
        parts.append(listing("The recording does not decide whether the drive has", items, "or"))
        if alternatives:
            parts.append("One of several effects is needed, and the recording does not say which.")
            parts.append(listing("Among them are", list(alternatives)[: FURTHER.named], "and"))
    minimal = model.ties.minimal if model.ties else ()
    if len(minimal) > 1 and str(model.structure) in minimal:
        parts.append(f"This is the first of {len(minimal)} structures that explain it equally well.")
    parts.append(beside_minimal(model))
    return " ".join(part for part in parts if part)


def beside_minimal(model: Model) -> str:
    """Sentences on what the model lacks or has beside the first minimal structure; empty where it is one of them."""
    if model.ties is None or str(model.structure) in model.ties.minimal:
        return ""
    first = Structure.parse(model.ties.minimal[0])
    return " ".join(part for part in (_left_out(model, first), _added_for_the_fit(model, first)) if part)


def _left_out(model: Model, first: Structure) -> str:
    """Sentences on what the first minimal structure has and the model lacks."""
    own = model.structure
    masses = [p for p in function_set().whole.placed if own.masses < p.effect.masses <= first.masses]
    more = [*masses, *(p for p in first.placed if not p.effect.masses and p not in own.placed)]
    return doubtful_in_words(effects_in_words(more))


def _added_for_the_fit(model: Model, first: Structure) -> str:
    """Sentence on effects that no verdict demands, with which the model fits notably better, and what it predicts."""
    own, ties = str(model.structure), model.ties
    added = sorted(model.structure.beside - first.beside, key=lambda p: (p.effect.number, p.place))
    if ties is None or own not in ties.left_out or not added:
        return ""
    with_it, without = (left_out_in_words(ties.left_out[name]) for name in (own, str(first)))
    several = len(ties.minimal)
    best = f"The first of {several} structures that explain it equally well" if several > 1 else "The minimal structure"
    return f"{best} {without}. {listing('The model adds', effects_in_words(added), 'and')} Then it {with_it}."
