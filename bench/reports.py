"""Reports of the demo and of measured drives: in a browser, on paper, their numbers, their words, and the terminal.

    python bench/reports.py FOLDER [--only demo|emps|mte360|pendulum] [--save]

Every drive is identified with nothing given, unless FOLDER has its result already. So a change of the report is seen
without a new search. FOLDER receives the written results, a PDF and pictures of each report. The recordings lie outside
of the repository (support/measured.py). It needs ``playwright``, ``axe-playwright-python`` and Chromium.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright

import brightgrey
from brightgrey import identify
from brightgrey.api.result import Result
from support.measured import emps_recording, pendulum_recordings, two_mass_recordings
from support.report_checks import (
    browsers,
    check_numbers,
    long_sentences,
    named_in_code,
    open_report,
    paper,
    prose,
    screen_prose,
    terminal,
    terminal_prose,
)
from support.results import Table, arguments, publish

DRIVES: Mapping[str, Callable[[], Result]] = {
    "demo": lambda: brightgrey.demo(workers=2),
    "emps": lambda: identify([emps_recording()], workers=2),
    "mte360": lambda: identify(list(two_mass_recordings().values()), workers=2),
    "pendulum": lambda: identify([pendulum_recordings()["system_identification"]], workers=2),
}
VIEWS = ((400, "light"), (400, "dark"), (1280, "light"), (1280, "dark"))
COLUMNS = (120, 80, 60)


def result_of(name: str, folder: Path) -> Result:
    """Result of a drive: that of the folder, or a new one."""
    kept = folder / f"{name}.pickle"
    if not kept.exists():
        kept.write_bytes(pickle.dumps(DRIVES[name]()))
    found: Result = pickle.loads(kept.read_bytes())
    return found


def checked(browser: Browser, name: str, found: Result, folder: Path) -> tuple[list[str], list[str], list[str]]:
    """Rows of a report: in the browser, its numbers and words, its terminal. What is wrong is printed."""
    found.write(folder)
    report = folder / "report.html"
    views = [open_report(browser, report, w, s, folder / f"{w}-{s}.png") for w, s in VIEWS]
    printed, pages = paper(browser, report)
    (folder / "report.pdf").write_bytes(printed)
    page = [
        name,
        f"{report.stat().st_size / 1e6:.2f}",
        *(str(sum(getattr(view, what) for view in views)) for what in ("console", "requests", "overflows")),
        str(sum(view.violations for view in views)),
        str(pages),
    ]
    count, wrong = check_numbers(browser, folder)
    texts = [*prose(browser, report), *terminal_prose(found)]
    texts += [one for width in COLUMNS for one in screen_prose(found, width)]
    names, long = named_in_code(texts, list(found.model.parameters)), long_sentences(texts)
    for text in (*wrong, *names, *long):
        print(f"{name}: {text}")
    shown = [terminal(found, width).splitlines() for width in (*COLUMNS, None)]
    widest = [str(max(map(len, lines))) for lines in shown]
    lines = [name, *(f"{len(rows)} ({wide})" for rows, wide in zip(shown, widest, strict=True))]
    return page, [name, str(count), str(len(wrong)), str(len(texts)), str(len(names)), str(len(long))], lines


def main() -> None:
    """Check the reports that are asked for."""
    parser = arguments(__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", choices=tuple(DRIVES))
    given = parser.parse_args()
    rows: list[tuple[list[str], list[str], list[str]]] = []
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=next(browsers()), args=["--no-sandbox", "--disable-gpu"])
        for name in (given.only,) if given.only else DRIVES:
            given.folder.mkdir(exist_ok=True)
            rows.append(checked(browser, name, result_of(name, given.folder), given.folder / name))
        browser.close()
    pages, words, lines = (list(column) for column in zip(*rows, strict=True))
    publish(
        "reports",
        [
            Table(
                "Reports in a browser and on paper",
                [
                    "report",
                    "MB",
                    "console messages",
                    "outside requests",
                    "overflows",
                    "violations of WCAG AA",
                    "A4 pages",
                ],
                pages,
            ),
            Table(
                "Numbers and words",
                ["report", "numbers", "not those of model.json", "texts", "code names", "sentences over 30 words"],
                words,
            ),
            Table(
                "Lines in the terminal (longest line)",
                ["result", *(f"{width} columns" for width in COLUMNS), "pipe"],
                lines,
            ),
        ],
        to_file=given.save,
    )


if __name__ == "__main__":
    main()
