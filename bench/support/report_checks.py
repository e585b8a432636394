"""Checks of a written result: its report in a real browser and on paper, its numbers, its words, its terminal text."""

from __future__ import annotations

import importlib.util
import io
import json
import re
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page
from rich.console import Console

from brightgrey.api.result import Result
from brightgrey.cli.terminal.overview import print_overview
from brightgrey.cli.terminal.results import PART, text
from brightgrey.effects import registry

__all__ = [
    "Prose",
    "browsers",
    "check_numbers",
    "long_sentences",
    "named_in_code",
    "open_report",
    "paper",
    "prose",
    "screen_prose",
    "terminal",
    "terminal_prose",
]

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
WCAG = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"]
CODE_NAMES = [name for name in registry() if "_" in name] + ["coulomb", "stribeck"]
SHOWS_COMMANDS = ("repeat", "model")
"""Sections of the report that show what is typed in a command, beside people's names."""
MANY = 4  # parameters of a list that would be too long with their meanings
DRAWN = "document.querySelectorAll('.plot .main-svg').length > 0"
TEXTS = """() => [...document.querySelectorAll('p, li, h1, h2, h3, figcaption, td, th')].map(e =>
  [e.closest('section')?.id ?? '', e.matches('td, th, .letters li') ? 'cell' : 'prose', e.textContent])"""
NUMBERS = """() => ({
  values: [...document.querySelectorAll('#parameters tbody tr')].map(row => [
    row.cells[0].textContent, row.cells[1].textContent, row.querySelector('data').value, row.cells[2].textContent,
    row.cells[4].textContent]),
  fits: [...document.querySelectorAll('#fit tbody tr')].map(row => [
    row.cells[0].textContent, row.cells[1].textContent,
    ...[...row.querySelectorAll('data')].map(d => [d.textContent, d.value])]),
  drawn: [...document.querySelectorAll('.drive-medium svg text')].map(t => t.textContent)
})"""


@dataclass(frozen=True)
class Prose:
    """A text of a report or of a terminal."""

    section: str
    kind: str  #: ``prose``, or ``cell`` of a table.
    text: str


@dataclass
class Opened:
    """What a browser has seen of a report."""

    console: int = 0
    requests: int = 0
    overflows: int = 0
    violations: int = 0


def open_report(browser: Browser, report: Path, width: int, scheme: str, picture: Path | None = None) -> Opened:
    """Open a report with all its sections; optionally keep a picture of the whole page."""
    seen = Opened()
    context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
    page = context.new_page()
    said: list[str] = []
    asked: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    _load(page, report)
    page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    page.wait_for_timeout(1000)
    seen.console = len(said)
    seen.requests = sum(not url.startswith(("data:", "blob:", report.as_uri())) for url in asked)
    seen.overflows = int(page.evaluate("document.documentElement.scrollWidth") > width)
    found = Axe().run(page, options={"runOnly": WCAG, "resultTypes": ["violations"]}).response
    seen.violations = len(found["violations"])
    for violation in found["violations"]:
        print(report.parent.name, width, scheme, violation["id"], violation["nodes"][0]["html"][:200])
    if picture:
        page.screenshot(path=picture, full_page=True)
    context.close()
    return seen


def _load(page: Page, report: Path) -> None:
    page.goto(report.as_uri())
    page.wait_for_function(DRAWN)


def paper(browser: Browser, report: Path) -> tuple[bytes, int]:
    """The report as PDF on A4, and the number of its pages."""
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    page = context.new_page()
    _load(page, report)
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    printed = page.pdf(format="A4", prefer_css_page_size=True)
    context.close()
    return printed, len(re.findall(rb"/Type\s*/Page\b", printed))


def _is_rounded(shown: str, exact: float) -> bool:
    """True if a shown number is the exact one, rounded at its last digit; zeros at the end of 230 are none."""
    mantissa, _, exponent = shown.partition("e")
    whole, _, decimals = mantissa.partition(".")
    places = len(decimals) or len(whole.rstrip("0")) - len(whole)
    return abs(float(shown) - exact) <= 0.51 * 10.0 ** (int(exponent or 0) - places) or f"{exact:.2g}" == shown


def check_numbers(browser: Browser, folder: Path) -> tuple[int, list[str]]:
    """Number of figures in report.html that were compared with model.json, and those that differ."""
    model = json.loads((folder / "model.json").read_text(encoding="utf-8"))
    context = browser.new_context()
    page = context.new_page()
    _load(page, folder / "report.html")
    shown: dict[str, Any] = page.evaluate(NUMBERS)
    context.close()
    pairs: list[tuple[str, str, float, float]] = []  # name, as shown, as data, in the model
    for name, value, data, half, interval in shown["values"]:
        part = model["parameters"][name]
        pairs.append((name, value, float(data), part["value"]))
        if half:
            low, high = part["ci95"]
            pairs.append((f"± of {name}", half, 0.5 * (high - low), 0.5 * (high - low)))
        if interval:
            ends = zip(interval.split(" … "), part["ci95"], strict=True)
            pairs += [(f"interval of {name}", text, end, end) for text, end in ends]
    for output, on, *cells in shown["fits"]:
        part = model["fit"]["train" if on == "identified" else on][output]
        known = (part["fit_percent"], part["rmse"], part["rss"])
        pairs += [(f"fit of {output}", text, float(data), k) for (text, data), k in zip(cells, known, strict=True)]
    wrong = [f"{name}: {text} for {exact!r}" for name, text, data, exact in pairs if data != exact]
    wrong += [f"{name}: {text} for {exact!r}" for name, text, _, exact in pairs if not _is_rounded(text, exact)]
    drawn = " ".join(shown["drawn"])
    values = {float(found) for found in re.findall(r"= ([-\d.e+]+)", drawn)}
    wrong += [f"{n} in the drawing" for n, p in model["parameters"].items() if not any(_near(v, p) for v in values)]
    return len(pairs) + len(values), wrong


def _near(shown: float, part: dict[str, Any]) -> bool:
    """True if a value of the drawing is that of the model, within its interval or four digits."""
    low, high = part["ci95"] or (part["value"], part["value"])
    return abs(shown - part["value"]) <= max(0.5 * (high - low), 1e-3 * abs(part["value"]))


def prose(browser: Browser, report: Path) -> list[Prose]:
    """All texts of a report, with the sections that are folded."""
    context = browser.new_context()
    page = context.new_page()
    _load(page, report)
    found = [Prose(*row) for row in page.evaluate(TEXTS)]
    context.close()
    return found


def terminal(found: Result, width: int | None) -> str:
    """What a terminal of a width shows of a result; None for a pipe."""
    if width is None:
        brief, _, files = text(found, Path("out")).split(PART)
        return brief + files
    out = io.StringIO()
    print_overview(Console(file=out, width=width, markup=False, emoji=False, highlight=False), found)
    return f"{out.getvalue()}Results are in out\n"


def terminal_prose(found: Result) -> list[Prose]:
    """Sentences of the terminal with ``--verbose``: its head and its items; tables and the name in commands apart."""
    brief, details, _ = text(found, Path("out")).split(PART)
    shown = brief + details[: details.index("- The structure in commands")]
    head, _, rest = shown.partition("\n\n")
    items = re.findall(r"^- (.*(?:\n  .*)*)", rest, re.MULTILINE)
    whole = [Prose("terminal", "prose", " ".join(part.split())) for part in (*head.split(".\n"), *items)]
    return [*whole, Prose("terminal", "cell", shown)]


def screen_prose(found: Result, width: int) -> list[Prose]:
    """Sentences of a terminal of a width, unfolded, its tables apart; and the whole, as it stands there."""
    shown = terminal(found, width)
    parts = re.split(r"\n\s*\n|\n(?=- |  and \d+ more|Results are)", shown)
    whole = [Prose("terminal", "prose", " ".join(part.split())) for part in parts if not set(part) & set("─▁▂▃▄▅▆▇█")]
    return [*whole, Prose("terminal", "cell", shown)]


def named_in_code(texts: Sequence[Prose], parameters: Sequence[str]) -> list[str]:
    """Names of effects as in commands, and up to three parameters that are not called by what they are."""
    found = []
    for one in texts:
        if one.section in SHOWS_COMMANDS:
            continue
        found += [f"{name}: {one.text}" for name in CODE_NAMES if re.search(rf"\b{name}\b", one.text)]
        typed = re.sub(r"'[^']*'", "", one.text)
        bare = [p for p in parameters if re.search(rf"(?<![\w@(]){re.escape(p)}(?![\w@])", typed)]
        if one.kind == "prose" and len(bare) < MANY:
            found += [f"{p}: {one.text}" for p in bare]
    return found


def long_sentences(texts: Sequence[Prose]) -> list[str]:
    """Sentences of more than 30 words."""
    readability = _readability()
    sentences = (s for one in texts if "─" not in one.text for s in readability.sentences(one.text))
    return [s for s in sentences if len(s.split()) > readability.LONGEST]


def _readability() -> Any:
    path = Path(__file__).parents[2] / "tools" / "readability.py"
    spec = importlib.util.spec_from_file_location("readability", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def browsers() -> Iterator[str]:
    """Browsers on the path."""
    yield from filter(None, map(shutil.which, BROWSERS))
