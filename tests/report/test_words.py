"""Words of report and terminal: people's names for things, and sentences of at most 30 words."""

import importlib.util
import re
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest

from brightgrey import Result
from brightgrey.cli.terminal import results as terminal
from brightgrey.effects import registry
from brightgrey.kit import grammar_named
from brightgrey.model.ranking import Row
from brightgrey.model.schema import TiesPart
from brightgrey.report.content import Content
from brightgrey.report.page import page
from brightgrey.report.text.headline import headline, listing
from brightgrey.report.text.next_steps import next_steps
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
    ties = TiesPart(minimal=tuple(map(str, (chosen, *others[:2]))), optional=tuple(registry())[2:7])
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


def test_terminal__result__fits_on_one_screen():
    content = searched(0)
    fit = SimpleNamespace(correlation={}, symptoms=(), second_opinion=())
    found = Result(content.model, tuple(content.traces), content.ranking, (), fit)
    brief, *_ = terminal.text(found, Path("out")).split(terminal.PART)
    assert len(brief.splitlines()) <= 40


def test_headline__two_masses__coupled_by_a_shaft_with_its_resonance():
    found = headline(Content(model_with_intervals("two_mass+coulomb+viscous+stribeck")))
    assert re.fullmatch(
        r"Two masses, coupled by a shaft with a resonance at [\d.]+ Hz, with Coulomb, viscous and Stribeck friction\.",
        found.found,
    )
    assert found.absent == found.open == ""


def test_headline__one_mass__with_its_inertia():
    found = headline(Content(model_with_intervals("one_mass+coulomb")))
    assert re.fullmatch(r"One mass \(J1 = [\d.]+ kg m²\), with Coulomb friction\.", found.found)


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
    titles = [step.title for step in next_steps(Content(model, [trace_of(model)], correlation=independent(model)))]
    assert titles[0] == "Give M_C room, or drop the effect"
    assert titles[-1] == "Use the model"
