"""Stage 5: what was found, in the words and figures of the report; two runs or structures side by side."""

from __future__ import annotations

import html
from collections.abc import Awaitable
from typing import Any

from nicegui import ui

from brightgrey.app.jobs.arguments import selftest_arguments, shown_command
from brightgrey.app.jobs.queue import QueuedCommand
from brightgrey.app.stages.beside import StructuresBeside
from brightgrey.app.stages.option_places import in_app_words
from brightgrey.app.stages.stage import Stage
from brightgrey.app.widgets import Parts, action, alert, choice, code_to_copy, heading, link, paragraph, tag
from brightgrey.errors import BrightgreyError

__all__ = ["ResultsStage", "shown_run"]

OPEN = ("next", "drawing", "motion", "values", "evidence", "certificate", "ties", "selftest")
"""Sections that are shown at once."""
TASK_LABELS = {
    "known-value": "To the known values",
    "plan": "To the plan of the next motion",
    "test-recording": "Add a test recording",
    "selftest": "Make the self-test",
    "hand-over": "To gains and exports",
}
"""Buttons of the advice."""
TASK_STAGES = {"known-value": "drive", "plan": "handover", "test-recording": "recording", "hand-over": "handover"}
"""Stages where an advice is followed."""
STRUCTURE_MARK = "structure:"
"""Begin of the value of a choice that is a structure and not a run."""
COMPARED_SECTIONS = ("drawing", "values", "evidence", "motion", "certificate")
"""Sections of two runs side by side."""


class ResultsStage(Stage):
    """Sections of the report of a run, or two of them, or two structures of one run side by side."""

    name = "results"
    title = "What was found"
    lead = "The same words and figures as in report.html."

    def content(self) -> None:
        """Build the choice of runs and structures, and the sections of the chosen run."""
        self.runs = runs_with_results(self)
        self.chosen = shown_run(self)
        self.beside = ""
        self.offered: dict[str, str] = {}
        self.chooser = tag("div", "", "row")
        self.place = tag("div")
        self.test_place = tag("div")
        self.page.later(self.fill())

    def choose(self, run: str) -> None:
        """Show another run."""
        self.chosen = run
        self.beside = ""
        self.page.later(self.fill())

    def compare(self, other: str) -> None:
        """Show another run, or another structure of this one, beside it."""
        self.beside = other
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
        desk, chosen, beside = self.services.desk, self.chosen, self.beside
        shown = [chosen, *([beside] if beside in self.runs else [])]
        labels = {r.file: r.label for r in self.document.recordings}
        try:
            found = [await self.still(desk.call("result_parts", self.run_folder(run), labels)) for run in shown]
            structures = await self.still(desk.call("run_structures", self.run_folder(chosen)))
        except BrightgreyError as error:
            self.place.clear()
            with self.place:
                alert(str(error))
            return
        if (chosen, beside) != (self.chosen, self.beside):  # something else has been chosen meanwhile
            return
        self.show_chooser(structures)
        self.place.clear()
        with self.place:
            if beside and len(shown) == 1:
                words = {s["name"]: s["words"] for s in structures}
                both = (found[0]["structure"], beside.removeprefix(STRUCTURE_MARK))
                self.page.later(StructuresBeside(self, self.run_folder(chosen), both, words, labels).fill())
            elif beside:
                with tag("div", "", "two"):
                    for run, parts in zip(shown, found, strict=True):
                        with tag("section", aria_label=run):
                            heading(run.replace("-", " "), 2)
                            self.sections(run, parts, COMPARED_SECTIONS)
            else:
                self.sections(chosen, found[0], tuple(found[0]["sections"]))
        self.test_place.clear()
        with self.test_place:
            self.self_test("selftest" in found[0]["sections"])

    def run_folder(self, run: str) -> str:
        """Path of a run."""
        return str(self.folder / "runs" / run)

    def show_chooser(self, structures: list[dict[str, str]]) -> None:
        """Build the choice of a run, and of a run or a structure beside it."""
        names = {name: name.replace("-", " ") for name in self.runs}
        others = {"": "nothing", **{n: t for n, t in names.items() if n != self.chosen}}
        for s in structures[1:]:
            said = "; ".join(filter(None, (s["status"], s["fit"])))
            others[STRUCTURE_MARK + s["name"]] = f"{s['words'][:1].upper()}{s['words'][1:]} ({said})"
        offered = {**names, **others, "chosen": self.chosen, "beside": self.beside}
        if offered == self.offered:
            return
        self.offered = offered
        self.chooser.clear()
        with self.chooser:
            if len(names) > 1:
                choice("Run", self.chosen, names, self.choose, key="run")
            if len(others) > 1:
                choice("Side by side with", self.beside, others, self.compare, key="beside")

    def sections(self, run: str, parts: dict[str, Any], names: tuple[str, ...]) -> None:
        """Build the headline and sections of one report."""
        Parts(in_app_words(_as_second_level(parts["header"])), {})
        for name in names:
            content = parts["sections"].get(name)
            if content is None:
                continue
            title, body = _heading_and_body(content)
            if name in OPEN:
                heading(title, 2)
                self.section(run, name, body, parts)
            else:
                with tag("details") as folded:
                    with tag("summary"):
                        heading(title, 2)
                    place = tag("div")
                _fill_when_opened(folded, place, body, parts["plots"], f"{run}-")
        if not self.beside:
            link(
                "Open the whole report",
                f"/files/{self.page.name}/runs/{run}/report.html",
                key="report",
                target="_blank",
            )

    def section(self, run: str, name: str, body: str, parts: dict[str, Any]) -> None:
        """Build one section that is shown at once: its figures can be zoomed into, its advice can be followed."""
        prefix, plots = f"{run}-", parts["plots"]
        if name == "motion":
            Parts(body, plots, prefix, on_zoom=lambda p, plot, span: self.page.later(self.zoom(run, p, plot, span)))
        elif name == "next":
            tasks = dict(TASK_LABELS)
            if "selftest" in parts["sections"] or self.job_of_self_test() is not None:
                tasks["selftest"] = ""
            Parts(in_app_words(body), plots, prefix, tasks=tasks, on_task=self.follow_advice)
        else:
            Parts(body, plots, prefix)

    async def zoom(self, run: str, parts: Parts, plot: str, span: list[float] | None) -> None:
        """Show the samples of a part of a recording, instead of the few that the report has."""
        kind, _, number = plot.rpartition("-")
        if kind != "comparison":
            return
        entry = next(r for r in self.document.runs if r.name == run)
        words = dict(zip(entry.arguments, entry.arguments[1:], strict=False))
        test = words.get("--test-recording")
        ends = (float(span[0]), float(span[1])) if span else None
        asked = (self.run_folder(run), str(self.folder / test) if test else None, int(number), ends)
        try:
            parts.show(plot, await self.still(self.services.desk.call("result_course", *asked)))
        except BrightgreyError as error:
            ui.notify(f"The figure keeps its few points: {error}")

    def follow_advice(self, task: str) -> None:
        """Do what an advice is about, or open the stage where it is done."""
        if task == "selftest":
            self.start_self_test()
        elif task in TASK_STAGES:
            self.page.go(TASK_STAGES[task])

    def job_of_self_test(self) -> QueuedCommand | None:
        """Self-test of the chosen run that waits or runs."""
        job = self.services.queue.of(self.page.name, self.chosen, "selftest")
        return job if job is not None and job.state != "ended" else None

    def self_test(self, made: bool) -> None:
        """Build the button of the self-test."""
        heading("Self-test", 2)
        if made:
            paragraph("It was made; its section stands above and in the report.", "soft")
            return
        running = self.job_of_self_test()
        if running is not None:
            alert("The self-test runs: recordings of this model are simulated and identified anew.", "note")
            action("Stop it", lambda: self.services.queue.interrupt(running.key), key="stop-selftest")
            return
        job = self.services.queue.of(self.page.name, self.chosen, "selftest")
        if job is not None and job.code:
            alert(job.output.splitlines()[-1] if job.output else "The self-test has ended without a result.")
        paragraph(
            "Simulate recordings of the found model, identify them anew, and see how often it comes out again.", "soft"
        )
        action("Make the self-test", self.start_self_test, key="selftest")
        code_to_copy(shown_command(selftest_arguments(self.chosen)), key="selftest")

    def start_self_test(self) -> None:
        """Put the self-test into the queue."""
        self.services.queue.add(QueuedCommand(self.page.name, self.chosen, selftest_arguments(self.chosen)))
        self.services.ticks += 1
        ui.notify("The self-test has been put into the queue.")


def runs_with_results(stage: Stage) -> list[str]:
    """Runs of a project that have results, the latest first."""
    known = stage.services.statuses
    return [
        r.name for r in reversed(stage.document.runs) if known.get((stage.page.name, r.name), {}).get("has_results")
    ]


def shown_run(stage: Stage) -> str:
    """Run that is shown: the latest with results."""
    return next(iter(runs_with_results(stage)), "")


def _heading_and_body(section: str) -> tuple[str, str]:
    """Heading of a section as text, and the rest as HTML, without what folds it up on paper."""
    before, _, rest = section.partition("</h2>")
    body = rest.strip().removeprefix("</summary>").removesuffix("</details>")
    return html.unescape(before.rpartition("<h2>")[2]), body


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
