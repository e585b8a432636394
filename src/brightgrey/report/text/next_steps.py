"""Advice that follows from a result: what to do before the model is used, and with it; and why it is not richer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from brightgrey.kit import Placed
from brightgrey.kit.in_words import effect_in_words, effects_in_words, enumerated
from brightgrey.report.content import Content
from brightgrey.report.options import REPORT_OPTIONS
from brightgrey.report.text.prose import doubtful_in_words, listing, sentence, with_forces, with_meanings
from brightgrey.report.text.tables import AT, NOT_IDENTIFIABLE, UNKNOWN, parameter_rows

__all__ = ["NextStep", "next_steps", "urgent_steps", "why_not_richer"]


@dataclass(frozen=True)
class NextStep:
    """One piece of advice."""

    title: str  #: A few words without a full stop.
    text: str  #: What was seen, then what to do; whole sentences, with what is typed between “ and ”.
    commands: tuple[str, ...] = ()  #: Commands, or options of ``brightgrey identify``, that do it.
    task: str = ""  #: Name of what is done, for pages that have a button for it; empty if there is none.

    @property
    def typed(self) -> str:
        """Sentence on what is typed; empty if there is nothing."""
        return f"On the command line: {', '.join(f'“{c}”' for c in self.commands)}." if self.commands else ""


def next_steps(content: Content) -> tuple[NextStep, ...]:
    """Advice on a result, the most urgent first.

    Parameters
    ----------
    content : Content
        Its symptoms, parameters, evidence and traces are what the advice rests on.
    """
    first, *rest = _of_symptoms(content), _of_effects(content), _of_verdicts(content), _of_use(content)
    return (*first, *_of_parameters(content), *(step for steps in rest for step in steps))


def urgent_steps(content: Content) -> tuple[NextStep, ...]:
    """Advice on what the model lacks and on what stays open; parameters and further use apart."""
    return (*_of_symptoms(content), *_of_effects(content), *_of_verdicts(content))


def why_not_richer(content: Content) -> tuple[str, ...]:
    """Sentences on the effects that a structure does without; none where a budget has left structures undecided."""
    evidence = content.evidence
    if evidence is None or evidence.certificate.undecided or not evidence.cards:
        return ()
    needless = [Placed.parse(card.effect) for card in evidence.cards if card.verdict == "not needed"]
    words = [effect_in_words(placed, article=False) for placed in needless]
    steady = [c for c in evidence.cards if any(reason.kind == "left out" for reason in c.why.further)]
    left_out = [effect_in_words(Placed.parse(card.effect)) for card in steady]
    sentences = (
        doubtful_in_words(left_out),
        "All other effects that were offered explain together no more than chance does.",
        listing("So the model needs no", words, "or"),
    )
    return tuple(text for text in sentences if text)


def _of_symptoms(content: Content) -> Iterator[NextStep]:
    model = content.model
    for symptom in content.symptoms:
        said = (with_meanings(text, model.structure) for text in (symptom.observation, symptom.advice))
        title, text = symptom.title, " ".join(map(sentence, said))
        yield NextStep(title, text) if model.is_rotary else NextStep(with_forces(title), with_forces(text))


def _of_parameters(content: Content) -> Iterator[NextStep]:
    rows, structure = parameter_rows(content.model), content.model.structure
    # What a symptom calls negligible needs no room.
    small = {n for s in content.symptoms for n in s.observation.partition(" is at its lower bound")[0].split(", ")}
    at = [with_meanings(row.name, structure) for row in rows if row.note in AT.values() and row.name not in small]
    if at:
        yield NextStep(
            f"Give {_few(at)} room, or drop the effect",
            "Widen the range. If the value runs on, the effect stands for something else.",
            ("--bound NAME=LOW:HIGH",),
            "known-value",
        )
    vague = [with_meanings(row.name, structure) for row in rows if row.note in (NOT_IDENTIFIABLE, UNKNOWN)]
    if vague:
        yield NextStep(
            f"Do not use {_few(vague)}",
            "This recording does not show the size. Fix what you know, or record a motion that shows it.",
            ("--fix NAME=VALUE",),
            "known-value",
        )


def _few(names: Sequence[str]) -> str:
    return (
        enumerated(names)
        if len(names) <= REPORT_OPTIONS.listed_parameters
        else "the parameters with a note in their table"
    )


def _of_effects(content: Content) -> Iterator[NextStep]:
    """Effects that cannot be there as what they are named after."""
    if content.model.is_rotary:
        return
    for placed in content.model.structure.placed:
        if placed.effect.in_linear_axis:
            title = f"Find the cause of the {effect_in_words(placed, article=False)}"
            yield NextStep(title, placed.effect.in_linear_axis)


def _of_verdicts(content: Content) -> Iterator[NextStep]:
    model, evidence = content.model, content.evidence
    several = model.ties is not None and len(model.ties.minimal) > 1
    if several:
        yield NextStep(
            "Several structures explain the recording",
            "The section on structures that cannot be told apart shows what they change for control. If that matters,"
            " record more.",
        )
    cards = evidence.cards if evidence else ()
    undecided = [Placed.parse(card.effect) for card in cards if card.verdict == "not decidable"]
    if several or undecided:
        yield NextStep(
            "Record what decides more",
            " ".join(
                [
                    *([listing("Open:", effects_in_words(undecided), "and")] if undecided else []),
                    "A motion can be designed for it, with a forecast of what it would decide.",
                ]
            ),
            ("brightgrey plan DIR",),
            "plan",
        )


def _of_use(content: Content) -> Iterator[NextStep]:
    if content.traces and not any(trace.test for trace in content.traces):
        yield NextStep(
            "Check the model on data that it has not seen",
            "Repeat the identification with a test recording.",
            ("--test-recording FILE",),
            "test-recording",
        )
    if content.evidence:
        yield NextStep(
            "Ask whether the recording would find this model again",
            "The self-test identifies simulated recordings of it.",
            ("brightgrey selftest DIR --fast",),
            "selftest",
        )
    what, command = "Design a controller", "control"
    if content.model.input.mass > 1:  # a cascade is designed for an input at mass 1
        what, command = "Look at its poles and resonances", "analyse"
    yield NextStep(
        "Use the model",
        f"{what}, or write the model for other tools.",
        (f"brightgrey {command} model.json", "brightgrey export model.json --to fmu"),
        "hand-over",
    )
