"""Advice that follows from a result: what to do before the model is used, and with it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from brightgrey.report.content import Content
from brightgrey.report.text.tables import AT, NOT_IDENTIFIABLE, UNKNOWN, parameter_rows, sentence

__all__ = ["NextStep", "next_steps"]


@dataclass(frozen=True)
class NextStep:
    """One piece of advice."""

    title: str  #: A few words without a full stop.
    text: str  #: What was seen, then what to do; whole sentences.


def next_steps(content: Content) -> tuple[NextStep, ...]:
    """Advice on a result, the most urgent first.

    Parameters
    ----------
    content : Content
        Its symptoms, parameters, evidence and traces are what the advice rests on.
    """
    return (*_of_symptoms(content), *_of_parameters(content), *_of_verdicts(content), *_of_use(content))


def _of_symptoms(content: Content) -> Iterator[NextStep]:
    for symptom in content.symptoms:
        yield NextStep(symptom.title, f"{sentence(symptom.observation)} {sentence(symptom.advice)}")


def _of_parameters(content: Content) -> Iterator[NextStep]:
    rows = parameter_rows(content.model)
    at = [row for row in rows if row.note in AT.values()]
    if at:
        names = ", ".join(row.name for row in at)
        yield NextStep(
            f"Give {names} room, or drop the effect",
            "Widen the range by --bound NAME=LOW:HIGH. If the value runs on, the effect stands for something else.",
        )
    vague = [row.name for row in rows if row.note in (NOT_IDENTIFIABLE, UNKNOWN)]
    if vague:
        yield NextStep(
            f"Do not use {', '.join(vague)}",
            "This recording does not show the size. Fix what you know by --fix NAME=VALUE, or record a motion that"
            " shows it.",
        )


def _of_verdicts(content: Content) -> Iterator[NextStep]:
    model, evidence = content.model, content.evidence
    several = model.ties is not None and len(model.ties.minimal) > 1
    if several:
        yield NextStep(
            "Several structures explain the recording",
            "The table below shows what they change for control. If that matters, record more.",
        )
    if several or (evidence and any(card.verdict == "not decidable" for card in evidence.cards)):
        yield NextStep(
            "Record what decides more",
            "“brightgrey plan DIR” with the folder of this result designs a motion for it, and says what it would"
            " decide.",
        )


def _of_use(content: Content) -> Iterator[NextStep]:
    if content.traces and not any(trace.test for trace in content.traces):
        yield NextStep("Check the model on data that it has not seen", "Repeat the command with --test-recording FILE.")
    if content.evidence:
        yield NextStep(
            "Ask whether the recording would find this model again",
            "“brightgrey selftest DIR --fast” identifies simulated recordings of it.",
        )
    yield NextStep(
        "Use the model",
        "“brightgrey control model.json” designs a controller; “brightgrey export model.json --to fmu” writes it for"
        " other tools.",
    )
