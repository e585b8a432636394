"""Stage 5: what was found, in the words and figures of the report; two runs side by side."""

from __future__ import annotations

from collections.abc import Awaitable
from typing import Any

from nicegui import ui

from brightgrey.app.jobs.arguments import selftest_arguments, shown_command
from brightgrey.app.jobs.queue import QueuedCommand
from brightgrey.app.stages.stage import Stage
from brightgrey.app.widgets import Parts, action, alert, choice, code_to_copy, heading, link, paragraph, tag
from brightgrey.errors import BrightgreyError

__all__ = ["ResultsStage", "shown_run"]

TITLES = {
    "next": "What to do next",
    "drawing": "The drive, with values",
    "motion": "Measured and simulated",
    "values": "Parameters",
    "evidence": "What the recording says of each effect",
    "certificate": "Why not simpler, why not richer",
    "ties": "Structures that cannot be told apart",
    "selftest": "Would this recording find the model again?",
    "commissioning": "Commissioning sheet",
    "opinion": "Second opinion",
    "friction": "Friction",
    "frequency": "Frequency response",
    "backlash": "Backlash",
    "residuals": "Residuals",
    "structures": "Structures tried",
    "model": "Effects of the model",
    "recording": "Recording and its checks",
}
OPEN = ("next", "drawing", "motion", "values", "evidence", "certificate", "ties", "selftest")
"""Sections that are shown at once."""
COMPARED_SECTIONS = ("drawing", "values", "evidence", "motion", "certificate")
"""Sections of two runs side by side."""


class ResultsStage(Stage):
    """Sections of the report of the latest run."""

    name = "results"
    title = "What was found"
    lead = "The same words and figures as in report.html."

    def content(self) -> None:
        """Build the choice of runs, and the sections of the chosen one."""
        self.runs = runs_with_results(self)
        self.chosen = shown_run(self)
        self.beside = ""
        if len(self.runs) > 1:
            names = {name: name.replace("-", " ") for name in self.runs}
            with tag("div", "", "row"):
                choice("Run", self.chosen, names, self.choose, key="run")
                others = {"": "nothing", **{n: t for n, t in names.items() if n != self.chosen}}
                choice("Side by side with", self.beside, others, self.compare, key="beside")
        self.place = tag("div")
        self.test_place = tag("div")
        self.page.later(self.fill())

    def choose(self, run: str) -> None:
        """Show another run."""
        self.chosen = run
        self.page.later(self.fill())

    def compare(self, run: str) -> None:
        """Show another run beside it."""
        self.beside = run
        self.page.later(self.fill())

    def follow(self) -> Awaitable[None] | None:
        """Show the report anew where a self-test has come to its end."""
        job = self.services.queue.of(self.page.name, self.chosen, "selftest")
        state = job.state if job else ""
        if state == getattr(self, "seen", ""):
            return None
        self.seen = state
        return self.fill()

    async def fill(self) -> None:
        """Read the reports and show their sections."""
        shown = [self.chosen, *([self.beside] if self.beside else [])]
        labels = {r.file: r.label for r in self.document.recordings}
        try:
            reports = [str(self.folder / "runs" / run) for run in shown]
            found = [await self.still(self.services.desk.call("result_parts", r, labels)) for r in reports]
        except BrightgreyError as error:
            with self.place:
                alert(str(error))
            return
        self.place.clear()
        with self.place:
            if self.beside:
                with tag("div", "", "two"):
                    for run, parts in zip(shown, found, strict=True):
                        with tag("section", aria_label=run):
                            heading(run.replace("-", " "), 2)
                            self.sections(run, parts, COMPARED_SECTIONS)
            else:
                self.sections(self.chosen, found[0], tuple(TITLES))
        self.test_place.clear()
        with self.test_place:
            self.self_test("selftest" in found[0]["sections"])

    def sections(self, run: str, parts: dict[str, Any], names: tuple[str, ...]) -> None:
        """Build the headline and sections of one report."""
        Parts(_as_second_level(parts["header"]), {})
        for name in names:
            content = parts["sections"].get(name)
            if content is None:
                continue
            body = _without_heading(content)
            if name in OPEN:
                heading(TITLES[name], 2)
                Parts(body, parts["plots"], f"{run}-")
            else:
                with tag("details") as folded:
                    with tag("summary"):
                        heading(TITLES[name], 2)
                    place = tag("div")
                _fill_when_opened(folded, place, body, parts["plots"], f"{run}-")
        if not self.beside:
            link(
                "Open the whole report",
                f"/files/{self.page.name}/runs/{run}/report.html",
                key="report",
                target="_blank",
            )

    def self_test(self, made: bool) -> None:
        """Build the button of the self-test."""
        heading("Self-test", 2)
        if made:
            paragraph("It was made; its section stands above and in the report.", "soft")
            return
        job = self.services.queue.of(self.page.name, self.chosen, "selftest")
        if job is not None and job.state != "ended":
            alert("The self-test runs: recordings of this model are simulated and identified anew.", "note")
            action("Stop it", lambda: self.services.queue.interrupt(job.key), key="stop-selftest")
            return
        if job is not None and job.code:
            alert(job.output.splitlines()[-1] if job.output else "The self-test has ended without a result.")
        paragraph(
            "Simulate recordings of the found model, identify them anew, and see how often it comes out again.", "soft"
        )
        arguments = selftest_arguments(self.chosen)

        def start() -> None:
            self.services.queue.add(QueuedCommand(self.page.name, self.chosen, arguments))
            self.services.ticks += 1
            ui.notify("The self-test has been put into the queue.")

        action("Make the self-test", start, key="selftest")
        code_to_copy(shown_command(arguments), key="selftest")


def runs_with_results(stage: Stage) -> list[str]:
    """Runs of a project that have results, the latest first."""
    known = stage.services.statuses
    return [
        r.name for r in reversed(stage.document.runs) if known.get((stage.page.name, r.name), {}).get("has_results")
    ]


def shown_run(stage: Stage) -> str:
    """Run that is shown: the latest with results."""
    return next(iter(runs_with_results(stage)), "")


def _without_heading(content: str) -> str:
    """Section without its own heading, and without what folds it up on paper."""
    _, found, rest = content.partition("</h2>")
    body = rest if found else content
    body = body.strip().removeprefix("</summary>")
    return body.removesuffix("</details>")


def _as_second_level(header: str) -> str:
    """Headline as a heading below that of the stage."""
    return header.replace("<h1>", "<h2>").replace("</h1>", "</h2>")


def _fill_when_opened(folded: ui.element, place: ui.element, body: str, plots: dict[str, Any], prefix: str) -> None:
    """Build a section when it is opened: a figure has no width before."""

    def fill(opened: object) -> None:
        if opened and not place.default_slot.children:
            with place:
                Parts(body, plots, prefix)

    folded.on("toggle", lambda event: fill(event.args), js_handler="(e) => emit(e.target.open)")
