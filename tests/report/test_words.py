"""Words of report and terminal: people's names for things, and sentences of at most 30 words."""

import importlib.util
import io
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest
from rich.console import Console

from brightgrey import Model, Result
from brightgrey.cli.terminal import results as terminal
from brightgrey.cli.terminal.overview import print_overview
from brightgrey.effects import registry
from brightgrey.estimation.diagnostics.second_opinion import TermOpinion
from brightgrey.estimation.diagnostics.symptoms import Symptom
from brightgrey.kit import Placed, Structure, grammar_named
from brightgrey.model.ranking import Row
from brightgrey.model.schema import FindingPart, OutcomePart, TiesPart
from brightgrey.recordings.units.signals import Units
from brightgrey.report.content import Content
from brightgrey.report.page import page
from brightgrey.report.text import prose
from brightgrey.report.text.headline import headline
from brightgrey.report.text.next_steps import next_steps, urgent_steps, why_not_richer
from brightgrey.report.text.opinion_table import opinion_sentences
from brightgrey.report.text.prose import left_out_in_words, listing, with_forces, with_meanings
from brightgrey.report.text.tables import remarks
from brightgrey.search.evidence import EffectVerdict
from brightgrey.search.verdicts import Reason, ReasonKind, Size
from support.evidence import evidence_of
from support.models import independent, model_with_intervals, random_model, trace_of

CODE_NAMES = [name for name in registry() if "_" in name] + ["coulomb", "stribeck"]
COMMANDS = ("repeat", "model")
"""Sections that show what is typed in a command, beside people's names."""
TEXTS = ("p", "li", "h1", "h2", "h3", "figcaption", "td", "th")


@pytest.fixture(scope="module")
def readability():
    path = Path(__file__).parents[2] / "tools" / "readability.py"
    spec = importlib.util.spec_from_file_location("readability", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Blocks(HTMLParser):
    """Texts of paragraphs, items, headings, captions and cells of prose, with their sections."""

    def __init__(self):
        super().__init__()
        self.section, self.texts, self.open = "", [], False

    def handle_starttag(self, tag, attrs):
        if tag == "section":
            self.section = dict(attrs)["id"]
        self.open = tag in ("p", "li", "h1", "h2", "h3", "figcaption", "td", "th") or (
            self.open and tag not in ("script", "style")
        )
        if tag in ("p", "li", "h1", "h2", "h3", "figcaption", "td", "th"):
            self.texts.append((self.section, ""))

    def handle_endtag(self, tag):
        if tag in TEXTS:
            self.open = False

    def handle_data(self, text):
        if self.open and self.texts:
            section, before = self.texts[-1]
            self.texts[-1] = (section, before + text)


def every_reason():
    """A verdict of every kind of reason on effects in turn, with sizes and names."""
    sizes = (Size("alpha", 1.4e-4, "rad", True),)
    names = ("two masses with Coulomb and viscous friction", "two masses with Coulomb friction, and a constant load")
    numbers = {"ratio": 1.34, "gain": 0.039, "lag": 1e-4, "interval": 1e-3}
    effects = [name for name in registry() if name != "one_mass"]
    for k, kind in enumerate(get_args(ReasonKind)):
        several = names if kind == "equivalent" else names[:1]
        reason = Reason(kind, numbers, size=sizes, limit=sizes, estimate=sizes, names=several)
        verdict = ("needed", "not needed", "not decidable")[k % 3]
        yield EffectVerdict(effects[k % len(effects)], verdict, 0.34, 0.1, reason)


def searched(seed):
    """Content of a search of random structures with every verdict there is."""
    rng = np.random.default_rng(seed)
    structures = list(grammar_named("drive").structures())
    chosen, *others = (structures[i] for i in rng.integers(len(structures), size=5))
    model = random_model(str(chosen), seed)
    names = tuple(map(str, (chosen, *others[:2])))
    left_out = {name: tuple(rng.uniform(0, 100, 2 + seed)) for name in names}
    minimal = names[1:] if seed % 2 else names  # the model may add effects to the first of them
    ties = TiesPart(minimal=minimal, optional=tuple(registry())[2:7], left_out=left_out)
    model = model.model_copy(update={"ties": ties})
    rows = tuple(Row(str(s), 5, 1.0, 99.0, 3.0, True) for s in (chosen, *others))
    return Content(
        model,
        [trace_of(model)],
        evidence=evidence_of(tuple(every_reason())),
        ranking=rows,
        differences=[SimpleNamespace(structure=s, rows=(("delay margin", "1 ms"),)) for s in (chosen, *others)],
    )


@pytest.mark.parametrize("seed", range(6))
def test_report__no_code_names_and_no_long_sentences(seed, readability):
    blocks = Blocks()
    blocks.feed(page(searched(seed)))
    assert len(blocks.texts) > 100
    for section, text in blocks.texts:
        if section not in COMMANDS:
            assert not [name for name in CODE_NAMES if re.search(rf"\b{name}\b", text)], text
        for sentence in readability.sentences(text):
            assert len(sentence.split()) <= readability.LONGEST, sentence


@pytest.mark.parametrize("seed", range(6))
def test_terminal__no_code_names_and_no_long_sentences(seed, readability):
    content = searched(seed)
    fit = SimpleNamespace(correlation={}, symptoms=(), second_opinion=())
    found = Result(content.model, tuple(content.traces), content.ranking, ("a note",), fit, evidence=content.evidence)
    brief, details, _ = terminal.text(found, Path("out")).split(terminal.PART)
    for name in CODE_NAMES:
        assert not re.search(rf"\b{name}\b", brief)
    shown = details[: details.index("The structure in commands")]
    for name in CODE_NAMES:
        assert not re.search(rf"\b{name}\b", shown)
    paragraphs = re.sub(r"\n(?=\S)", "\n\n", brief)  # folded lines of one item are indented
    for sentence in readability.sentences(paragraphs.replace("- ", "\n\n")):
        if "█" not in sentence and "─" not in sentence and "▁" not in sentence:
            assert len(sentence.split()) <= readability.LONGEST, sentence


@pytest.mark.parametrize("width", [60, 80, 120])
@pytest.mark.parametrize("seed", range(3))
def test_terminal__of_any_width__no_code_names_no_long_sentences_and_no_line_too_long(seed, width, readability):
    content = searched(seed)
    fit = SimpleNamespace(correlation={}, symptoms=(), second_opinion=())
    found = Result(content.model, tuple(content.traces), content.ranking, ("a note",), fit, evidence=content.evidence)
    out = io.StringIO()
    print_overview(Console(file=out, width=width, markup=False, emoji=False, highlight=False), found)
    assert max(map(len, out.getvalue().splitlines())) <= width
    assert not [name for name in CODE_NAMES if re.search(rf"\b{name}\b", out.getvalue())]
    for part in re.split(r"\n\s*\n|\n(?=- )", out.getvalue()):
        if not set(part) & set("─▁▂▃▄▅▆▇█"):
            for sentence in readability.sentences(" ".join(part.split())):
                assert len(sentence.split()) <= readability.LONGEST, sentence


def test_terminal__result__fits_on_one_screen():
    content = searched(0)
    fit = SimpleNamespace(correlation={}, symptoms=(), second_opinion=())
    found = Result(content.model, tuple(content.traces), content.ranking, (), fit)
    brief, *_ = terminal.text(found, Path("out")).split(terminal.PART)
    assert len(brief.splitlines()) <= 40


def test_headline__search_was_stopped__begins_with_that():
    found = headline(Content(model_with_intervals("two_mass+coulomb+viscous+stribeck"), stopped=True))
    assert found.sentences[0].startswith("The search was stopped: this is the best structure so far")


def test_headline__two_masses__coupled_by_a_shaft_with_its_resonance():
    found = headline(Content(model_with_intervals("two_mass+coulomb+viscous+stribeck")))
    assert re.fullmatch(
        r"Two masses, coupled by a shaft with a resonance at [\d.]+ Hz, with Coulomb, viscous and Stribeck friction\.",
        found.found,
    )
    assert found.absent == found.open == ""


def test_headline__one_mass__with_its_inertia():
    found = headline(Content(model_with_intervals("one_mass+coulomb")))
    assert re.fullmatch(r"One mass of [\d.]+ kg m², with Coulomb friction\.", found.found)


def test_headline__search__says_what_is_absent_and_what_is_open():
    gap = Reason("refuted", size=(Size("alpha", 1.4e-4, "rad", True),), estimate=(Size("alpha", 0.0, "rad"),))
    cards = (
        EffectVerdict("backlash", "not needed", None, 0.0, gap),
        EffectVerdict("delay", "not needed", None, 0.0, Reason("refuted", size=(Size("T_d", 2e-4, "s"),))),
        EffectVerdict("three_mass", "not decidable", None, 0.0, Reason("not detectable")),
    )
    found = headline(Content(model_with_intervals("two_mass+coulomb"), evidence=evidence_of(cards)))
    assert found.absent == "No backlash above ±0.14 mrad or dead time above 0.2 ms."
    assert found.open == (
        "The recording holds something that none of the structures offered explains."
        " The recording does not decide whether the drive has a third mass."
    )


def test_headline__model_lacks_what_helps_in_some_parts__says_so():
    model = model_with_intervals("one_mass+coulomb")
    ties = TiesPart(minimal=("two_mass+coulomb+stribeck",), optional=())
    found = headline(Content(model.model_copy(update={"ties": ties}), evidence=evidence_of(())))
    assert found.open.endswith(
        "The model leaves out a second mass and Stribeck friction."
        " That helps in some parts of the recording only, or nothing is known of its size."
    )


def test_headline__many_effects_of_which_one_is_needed__names_the_first_of_them_once():
    """The table of effects has them all; a list over several sentences would not be read."""
    names = tuple(f"Coulomb friction at mass {k}" for k in range(1, 9))
    why = [Reason("one of several", names=names[i : i + 4]) for i in (0, 4)]
    cards = [EffectVerdict(f"coulomb@{k}", "not decidable", None, None, reason) for k, reason in enumerate(why, 2)]
    found = headline(Content(model_with_intervals("two_mass+coulomb"), evidence=evidence_of(cards)))
    assert found.open.count("Among them are") == 1
    assert names[3] in found.open
    assert names[4] not in found.open


def test_listing__too_many_items__several_sentences():
    text = listing("No", [f"effect of kind {k}" for k in range(20)], "or")
    sentences = text.split(". ")
    assert len(sentences) == 3
    assert all(len(s.split()) <= 30 for s in sentences)
    assert all(f"kind {k}" in text for k in range(20))


def test_next_steps__model_with_a_parameter_at_its_bound__is_told_first():
    model = model_with_intervals("one_mass+coulomb")
    parts = dict(model.parameters)
    parts["M_C"] = parts["M_C"].model_copy(update={"at_bound": "high"})
    model = model.model_copy(update={"parameters": parts})
    steps = next_steps(Content(model, [trace_of(model)], correlation=independent(model)))
    assert steps[0].title == "Give Coulomb friction (M_C) room, or drop the effect"
    assert steps[-1].title == "Use the model"
    assert all(bool(step.task) == bool(step.commands) for step in steps)
    assert not any("--" in step.text for step in steps)  # a page without a command line shows the text alone


def test_remarks__initial_state_at_its_bound__is_said_and_a_parameter_once():
    model = model_with_intervals("one_mass+coulomb")
    text = "M_C at its upper bound, speed(0) at its lower bound"
    finding = FindingPart(kind="at bound", text=text, parameters=("M_C", "speed(0)"))
    outcome = OutcomePart(kind="at bound", text=text, findings=(finding,))
    parts = {**model.parameters, "M_C": model.parameters["M_C"].model_copy(update={"at_bound": "high"})}
    said = remarks(model.model_copy(update={"outcome": outcome, "parameters": parts}))
    assert sum("and at a bound of its range: speed(0). The recording may begin otherwise" in text for text in said) == 1
    assert sum("M_C" in text for text in said) == 1


@pytest.mark.parametrize(("actuator", "command"), [(1, "brightgrey control"), (2, "brightgrey analyse")])
def test_next_steps__input_at_another_mass__names_no_command_that_refuses_it(actuator, command):
    (*_, last) = next_steps(Content(random_model("two_mass", 1, actuator=actuator), []))
    assert last.commands[0].startswith(command)


def test_next_steps__parameter_of_a_negligible_effect__is_not_given_room():
    model = model_with_intervals("one_mass+coulomb")
    parts = dict(model.parameters)
    parts["M_C"] = parts["M_C"].model_copy(update={"at_bound": "low"})
    model = model.model_copy(update={"parameters": parts})
    small = Symptom(
        "Coulomb friction is negligible", "M_C is at its lower bound, below any relevant size", "leave it out"
    )
    titles = [step.title for step in next_steps(Content(model, [trace_of(model)], symptoms=(small,)))]
    assert small.title in titles
    assert not [title for title in titles if "room" in title]


def test_with_forces__sentence_about_a_linear_axis__has_no_torque():
    assert with_forces("Torque drifts: 'torque' holds a torque or force") == "Force drifts: 'torque' holds a force"


def test_with_meanings__parameters_in_a_finding__are_called_by_what_they_are():
    structure = Structure.parse("one_mass+coulomb+viscous+coulomb@2")
    text = with_meanings("this recording cannot tell M_C, f_v and M_C@2 apart, nor J1", structure)
    assert text == (
        "this recording cannot tell Coulomb friction (M_C), viscous friction (f_v) and Coulomb friction at mass 2"
        " (M_C@2) apart, nor inertia of mass 1 (J1)"
    )
    assert with_meanings(text, structure) == text


@pytest.mark.parametrize(("unit", "told"), [("rad/s", False), ("mm/s", True)])
def test_urgent_steps__arm_on_a_linear_axis__is_no_arm(unit, told):
    data = model_with_intervals("one_mass+pendulum").model_dump(mode="json")
    data["signals"][1]["unit"] = unit
    units = Units("N m", unit.removesuffix("/s"))
    for name, declared in Structure.parse("one_mass+pendulum").parameters.items():
        data["parameters"][name]["unit"] = units.of(declared.dimension)[0]
    data["settings"]["friction_width_unit"] = data["settings"]["speed_scale_unit"] = unit
    moved = Model.check(data)
    steps = {step.title: step.text for step in urgent_steps(Content(moved))}
    assert ("Find the cause of the position-dependent load" in steps) == told
    if told:
        assert "has no arm" in steps["Find the cause of the position-dependent load"]
    assert "a position-dependent load" in headline(Content(moved)).found


def test_why_not_richer__effects_that_are_not_needed__are_listed_unless_a_budget_has_ended():
    card = EffectVerdict("delay", "not needed", None, 0.0, Reason("refuted", size=(Size("T_d", 2e-4, "s"),)))
    evidence = evidence_of((card,))
    assert why_not_richer(Content(model_with_intervals("one_mass"), evidence=evidence))[-1] == (
        "So the model needs no dead time."
    )
    ended = replace(evidence, certificate=replace(evidence.certificate, undecided=("one_mass",)))
    assert why_not_richer(Content(model_with_intervals("one_mass"), evidence=ended)) == ()


def test_opinion_sentences__the_gravest_first():
    opinions = (
        TermOpinion((Placed("one_mass"),), ("J1",), 1.0, 1.01, 0.01),
        TermOpinion((Placed("stribeck"), Placed("stribeck", 2)), ("M_S", "M_S@2"), 12.0, -5.0, 0.5),
        TermOpinion((Placed("viscous"),), ("f_v",), 1.0, 2.0, 0.1),
    )
    assert opinion_sentences(opinions) == (
        "It contradicts the fit, by the sign of Stribeck friction. It differs from the fit by more than its interval in"
        " viscous friction. It agrees with the fit on total inertia."
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("the input has no unit", "The input has no unit."),
        ("demo.csv: no unit is given.", "demo.csv: no unit is given."),
        ("a gain of 0.35: it is small", "A gain of 0.35: it is small."),
    ],
)
def test_sentence__begins_with_a_capital__unless_a_file_is_named(text, said):
    assert prose.sentence(text) == said


@pytest.mark.parametrize(
    ("fits", "said"),
    [
        ((), ""),
        ((84.3, 89.2, 88.6), "predicts each recording from the others to 84.3, 89.2 and 88.6 %"),
        ((70.0, 71.0, 72.0, 73.0, 74.0, 75.0), "predicts each recording from the others to between 70.0 and 75.0 %"),
        (
            (84.3, -3e9, None),
            "predicts each recording from the others to 84.3 and below 0 %, and diverges in 1 of 3 recordings that were"
            " left out",
        ),
        ((-np.inf, None), "diverges in 2 of 2 recordings that were left out"),
    ],
)
def test_left_out_in_words__fits__are_named(fits, said):
    assert left_out_in_words(fits) == said
