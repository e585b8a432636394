"""The pages say what is there: links, options, every effect and every public name."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

import brightgrey
from brightgrey.cli import main
from brightgrey.effects import registry
from brightgrey.recordings.checks.checkup import all_checks
from brightgrey.report.effect_catalogue import catalogue

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted(page for page in DOCS.rglob("*.md") if "build" not in page.parts)
each = pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(DOCS).with_suffix("").as_posix())


@each
def test_page__links_to_pages_that_are_there(page):
    for target in re.findall(r"\]\(([^)#:]+\.md)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).is_file(), target


def test_contents__list_every_page():
    listed = {
        (index.parent / name).with_suffix(".md")
        for index in DOCS.rglob("index.md")
        for toctree in re.findall(
            r"^```\{toctree\}(.*?)^```", index.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
        )
        for name in re.findall(r"^[\w/-]+$", toctree, re.MULTILINE)
    }
    assert listed == set(PAGES) - {DOCS / "index.md"}


def test_pages__name_options_that_exist(capsys):
    for command in (
        "identify",
        "simulate",
        "analyse",
        "control",
        "watch",
        "export",
        "reproduce",
        "selftest",
        "demo",
        "fleet",
        "inspect",
        "check",
        "plan",
        "app",
    ):
        main([command, "--help"])
    offered = set(re.findall(r"--[a-z][a-z-]+", capsys.readouterr().out))
    for page in PAGES:
        if page.parent.name == "validation":  # those of the benchmarks
            continue
        named = set(re.findall(r"`(--[a-z][a-z-]+)", page.read_text(encoding="utf-8")))
        assert named <= offered, page.stem


@each
def test_page__has_lines_of_at_most_120_characters(page):
    for line in page.read_text(encoding="utf-8").splitlines():
        assert len(line) <= 120 or line.startswith(("|", "   :exclude-members:")), line


@pytest.fixture(scope="module")
def readability():
    """The module tools/readability.py."""
    spec = importlib.util.spec_from_file_location("readability", DOCS.parent / "tools" / "readability.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    "page", [*PAGES, *sorted(DOCS.parent.glob("*.md"))], ids=lambda p: p.relative_to(DOCS.parent).as_posix()
)
def test_sentence__has_at_most_30_words(page, readability):
    for sentence in readability.sentences(readability.markdown_prose(page.read_text(encoding="utf-8"))):
        assert len(sentence.split()) <= readability.LONGEST, sentence


@pytest.mark.parametrize("page", sorted((DOCS / "validation").glob("*.md")), ids=lambda p: p.stem)
def test_validation_page__has_at_most_60_lines(page):
    assert len(page.read_text(encoding="utf-8").splitlines()) <= 60


def test_validation_pages__are_those_that_the_data_give():
    done = subprocess.run(
        [sys.executable, str(DOCS.parent / "bench" / "validation.py"), "--check"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def test_readme__figures_stand_on_the_page_that_is_linked():
    text = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    rows = re.findall(
        r"^\| [^|]+ \| ([^|]+) \| \[[^\]]+\]\((docs/(?:validation|gallery)/[\w-]+\.md)\) \|$", text, re.MULTILINE
    )
    assert len(rows) >= 9
    assert len(rows) == len(re.findall(r"^\|.*\]\(docs/(?:validation|gallery)/", text, re.MULTILINE))  # one page each
    for answer, page in rows:
        there = set(re.findall(r"[\d.,e-]*\d", (DOCS.parent / page).read_text(encoding="utf-8")))
        assert set(re.findall(r"[\d.,e-]*\d", answer)) <= there, page


@pytest.mark.parametrize("page", ["docs/reference/paper.md", "docs/architecture.md", "CONTRIBUTING.md"])
def test_page_for_developers__names_files_and_folders_that_are_there(page):
    root = DOCS.parent
    text = re.sub(r"^`src/[\w/]+\.py`:$", "", (root / page).read_text(encoding="utf-8"), flags=re.MULTILINE)
    for name in re.findall(r"`([a-z_]+(?:/[a-z_]+)*/[a-z_]+(?:\.py)?/?)`", text):
        assert any((root / place / name).exists() for place in ("src/brightgrey", "tests", "")), name


def test_effect_catalogue__has_every_declaration():
    text = catalogue()
    for effect in registry().values():
        part = text[text.index(f"## {effect.number} · {effect.title}") :].split("\n## ")[0]
        for word in (effect.name, effect.about, effect.equation, effect.source, *(p.about for p in effect.parameters)):
            assert word in part
        for parameter in effect.parameters:
            assert f"| `{parameter.symbol}` |" in part
        for label, words in (("When it matters", effect.matters), ("Confused with", effect.confused_with)):
            assert words
            assert f"- {label}: {words}." in part
        assert 'class="drive"' in part


def test_reference__lists_exactly_the_public_names():
    text = (DOCS / "reference" / "python.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\.\. auto\w+:: brightgrey\.(\w+)$", text, re.MULTILINE)
    assert sorted(listed) == sorted(set(brightgrey.__all__) - {"__version__"})


@pytest.mark.long
def test_documentation__builds_without_a_warning(tmp_path):
    pytest.importorskip("myst_nb", reason="brightgrey[docs] is not installed")
    command = [sys.executable, "-m", "sphinx", "-W", "-q", "-b", "html", str(DOCS), str(tmp_path / "html")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_page_of_checks__lists_every_check_with_its_question():
    text = (DOCS / "how-to" / "check.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| ([a-z ]+) \| (.+?\?) \|", text, re.MULTILINE) == [
        (c.name, c.question) for c in all_checks()
    ]
