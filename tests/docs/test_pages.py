"""The pages say what is there: links, options, every effect and every public name."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import brightgrey
from brightgrey.cli import main
from brightgrey.effects import registry
from brightgrey.report.effect_catalogue import catalogue

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted(page for page in DOCS.rglob("*.md") if "build" not in page.parts)
each = pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(DOCS).with_suffix("").as_posix())


@each
def test_linked_pages_are_there(page):
    for target in re.findall(r"\]\(([^)#:]+\.md)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).is_file(), target


def test_every_page_is_in_the_contents():
    contents = re.findall(r"^[\w/-]+$", (DOCS / "index.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(contents) == {page.relative_to(DOCS).with_suffix("").as_posix() for page in PAGES} - {"index"}


def test_options_that_are_named_exist(capsys):
    for command in ("identify", "simulate", "analyse", "control", "watch", "export", "reproduce", "demo"):
        main([command, "--help"])
    offered = set(re.findall(r"--[a-z][a-z-]+", capsys.readouterr().out))
    for page in PAGES:
        if page.stem == "results":  # those of the benchmarks
            continue
        named = set(re.findall(r"`(--[a-z][a-z-]+)", page.read_text(encoding="utf-8")))
        assert named <= offered, page.stem


def test_function_set_has_every_declaration():
    text = catalogue()
    for effect in registry().values():
        part = text[text.index(f"## {effect.number} · {effect.title}") :].split("\n## ")[0]
        for word in (effect.name, effect.about, effect.equation, effect.source, *(p.about for p in effect.parameters)):
            assert word in part
        for parameter in effect.parameters:
            assert f"| `{parameter.symbol}` |" in part


def test_reference__lists_exactly_the_public_names():
    text = (DOCS / "reference" / "python.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\.\. auto\w+:: brightgrey\.(\w+)$", text, re.MULTILINE)
    assert sorted(listed) == sorted(set(brightgrey.__all__) - {"__version__"})


@pytest.mark.long
def test_documentation_builds_without_a_warning(tmp_path):
    pytest.importorskip("myst_nb", reason="brightgrey[docs] is not installed")
    command = [sys.executable, "-m", "sphinx", "-W", "-q", "-b", "html", str(DOCS), str(tmp_path / "html")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
