"""Stage 6: what is taken along: report, model, exports, gains, the next motion, the command line."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import tomli_w
from nicegui import ui

from brightgrey.app.jobs.arguments import export_arguments, plan_arguments, shown_command
from brightgrey.app.jobs.queue import QueuedCommand
from brightgrey.app.stages.results import shown_run
from brightgrey.app.stages.stage import Stage
from brightgrey.app.widgets import (
    Figure,
    action,
    alert,
    code_to_copy,
    entry,
    heading,
    hint,
    link,
    paragraph,
    table_of,
    tag,
)
from brightgrey.errors import BrightgreyError
from brightgrey.model.files import write_file

__all__ = ["HandoverStage"]

TARGETS = {
    "fmu": ("FMU", "FMI 2.0 for co-simulation: Simulink, Dymola, OpenModelica, FMPy and others."),
    "c": ("C99", "One file without libraries, for a controller."),
    "matlab": ("MATLAB and Simulink", "Functions and a script; also for Octave."),
    "modelica": ("Modelica", "A package that every Modelica tool reads."),
    "control": ("Python Control", "The linear model for the library python-control."),
    "latex": ("LaTeX", "Equations and a drawing for a document."),
}


class HandoverStage(Stage):
    """Everything that leaves the app."""

    name = "handover"
    title = "Hand over"
    lead = "Take the report and the model along. Each export is run and compared with the own simulation."

    def content(self) -> None:
        """Build the parts."""
        self.run = shown_run(self)
        self.told: dict[str, str] = {}
        base = f"/files/{self.page.name}/runs/{self.run}"
        heading("Report and model", 2)
        with tag("div", "", "row"):
            link("Report (HTML)", f"{base}/report.html", key="report", style="button primary", target="_blank")
            link("Save the report", f"{base}/report.html?save=1", key="save-report", style="button", download=True)
            link("model.json", f"{base}/model.json", key="model", style="button", download=True)
            link("ranking.csv", f"{base}/ranking.csv", key="ranking", style="button", download=True)
        heading("Exports", 2)
        self.all_exports = tag("div")
        with tag("div", "", "cards gap"):
            self.cards = {target: tag("section", "", "card", aria_label=TARGETS[target][0]) for target in TARGETS}
        heading("Gains", 2)
        self.gains_form()
        heading("The next motion", 2)
        self.motion = tag("div")
        self.show()
        heading("The same on the command line", 2)
        entry_of_run = next(r for r in self.document.runs if r.name == self.run)
        paragraph("In the folder of the project these commands give the same files:", "soft")
        lines = [shown_command(entry_of_run.arguments), shown_command(export_arguments(self.run, "fmu"))]
        code_to_copy("\n".join([f"cd {self.folder}", *lines]), key="all")

    def follow(self) -> Awaitable[None] | None:
        """Show which exports have ended."""
        self.show()
        return None

    def show(self) -> None:
        """Build anew what depends on commands that have come further, and nothing else: a click would be lost."""
        waiting = any(self.job(f"export-{target}") is None for target in TARGETS)
        self.show_part("all", str(waiting), self.all_exports, self.export_all)
        for target, card in self.cards.items():
            self.show_part(target, self.state(f"export-{target}"), card, partial(self.export_card, target))
        self.show_part("plan", self.state("plan"), self.motion, self.motion_panel)

    def show_part(self, name: str, state: str, place: ui.element, build: Callable[[], None]) -> None:
        """Build one part, if its state is another one than when it was built."""
        if self.told.get(name) != state:
            self.told[name] = state
            place.clear()
            with place:
                build()

    def state(self, kind: str) -> str:
        """State of a command; empty if it was not given."""
        job = self.job(kind)
        return job.state if job else ""

    def export_all(self) -> None:
        """Build the button that makes all exports that are not made, if there are such."""
        if any(self.job(f"export-{target}") is None for target in TARGETS):
            action("Make and verify all", self.make_rest, key="export-all")

    def make_rest(self) -> None:
        """Put all exports that are not made into the queue."""
        self.export(*(target for target in TARGETS if self.job(f"export-{target}") is None))

    def job(self, kind: str) -> QueuedCommand | None:
        """The latest command of a kind for this run."""
        return self.services.queue.of(self.page.name, self.run, kind)

    def export(self, *targets: str) -> None:
        """Put exports into the queue."""
        for target in targets:
            self.services.queue.add(QueuedCommand(self.page.name, self.run, export_arguments(self.run, target)))
        self.services.ticks += 1
        self.show()

    def export_card(self, target: str) -> None:
        """Build one export: button, state, deviation, files."""
        title, about = TARGETS[target]
        job = self.job(f"export-{target}")
        heading(title, 3)
        paragraph(about, "soft")
        if job is None:
            action("Make and verify", lambda: self.export(target), key=f"export-{target}", label=f"Make {title}")
            return
        if job.state != "ended":
            tag("p", "Being made and compared …", role="status")
            return
        done = _exported(job)
        if done is None:
            alert(job.output.splitlines()[-1].removeprefix("brightgrey: ") if job.output else "It has failed.")
            action("Try again", lambda: self.export(target), key=f"export-{target}", label=f"Make {title} again")
            return
        tag("p", done["text"], "good" if done["good"] else "warn", data_verified=target)
        with tag("ul"):
            for file in done["files"]:
                with tag("li"):
                    name = file.rsplit("/", 1)[-1]
                    link(name, f"/files/{self.page.name}/{file}?save=1", download=True)

    def gains_form(self) -> None:
        """Build the question for the torque, and the place of the gains."""
        limits = self.document.drive.limits
        given = {"torque": limits.get("torque", ""), "computing": "0"}
        with tag("div", "", "row form"):
            entry(
                "Largest torque or force of the drive",
                given["torque"],
                lambda text: given.update(torque=text),
                key="torque",
                about="In the unit of the recording's input.",
                inputmode="decimal",
            )
            entry(
                "Computing time of the controller",
                "0",
                lambda text: given.update(computing=text),
                key="computing",
                unit="ms",
                inputmode="decimal",
            )
            action("Suggest gains", lambda: self.page.later(self.suggest(given)), key="gains")
        self.gains = tag("div", role="status")

    async def suggest(self, given: dict[str, str]) -> None:
        """Design gains and show them with the loop before and after."""
        self.gains.clear()
        try:
            torque, computing = (float(given[name].replace(",", ".")) for name in ("torque", "computing"))
        except ValueError:
            with self.gains:
                alert("Two numbers are wanted: the largest torque, and the computing time in ms.")
            return
        model = str(self.folder / "runs" / self.run / "model.json")
        try:
            found = await self.still(self.services.desk.call("gains", model, torque, None, 1e-3 * computing))
        except BrightgreyError as error:
            with self.gains:
                alert(str(error))
            return
        with self.gains:
            self.show_gains(found)
            words = ["control", f"runs/{self.run}/model.json", "--torque", f"{torque:g}"]
            delay = ["--computing", f"{1e-3 * computing:g}"] if computing else []
            code_to_copy(shown_command([*words, *delay]), key="control")

    def show_gains(self, found: dict[str, Any]) -> None:
        """Build the tables and the Bode plot."""
        with tag("div", "", "two"):
            with tag("div"):
                table_of(("Gain", "Value", "Unit"), found["gains"], caption="Suggested gains", numbers=(1,))
            with tag("div"):
                with tag("p"):
                    hint("Margins", "How much gain and phase the loop can lose before it oscillates.")
                table_of(
                    ("Loop", "Gain, dB", "Phase, °", "Sensitivity", "Crossover, Hz"),
                    found["margins"],
                    caption="Stability margins",
                    numbers=(1, 2, 3, 4),
                )
        for note in found["notes"]:
            paragraph(note)
        with tag("div", "", "frame"):
            Figure(found["figure"], "Bode plot of the speed loop, the drive alone and with the controller")

    def motion_panel(self) -> None:
        """Build the plan of the next motion."""
        job = self.job("plan")
        paragraph(
            "The motion that decides what this recording has left open, within the limits of the machine.", "soft"
        )
        folder = self.folder / "exports" / self.run / "plan"
        if job is not None and job.state != "ended":
            tag("p", "Motions are being tried …", role="status")
            action("Stop it", lambda: self.services.queue.interrupt(job.key), key="stop-plan")
            return
        if job is not None and job.code:
            alert(job.output.splitlines()[-1].removeprefix("brightgrey: ") if job.output else "It has failed.")
        if (folder / "plan.csv").is_file():
            base = f"/files/{self.page.name}/exports/{self.run}/plan"
            tag("img", "", "planned", src=f"{base}/plan.svg", alt="The planned motion over time")
            with tag("div", "", "row"):
                link("plan.csv", f"{base}/plan.csv?save=1", key="plan-csv", style="button", download=True)
                link("plan.toml", f"{base}/plan.toml?save=1", key="plan-toml", style="button", download=True)
        else:
            action("Plan the next motion", self.plan, key="plan")
        code_to_copy(shown_command(self.plan_words()), key="plan")

    def plan_words(self) -> tuple[str, ...]:
        """Arguments of the plan."""
        return plan_arguments(self.run, "limits.toml" if self.document.drive.usable_limits else None)

    def plan(self) -> None:
        """Write the limits and put the plan into the queue."""
        limits = self.document.drive.usable_limits
        if limits:
            write_file(self.folder / "limits.toml", tomli_w.dumps(limits).encode())
        self.services.queue.add(QueuedCommand(self.page.name, self.run, self.plan_words()))
        self.services.ticks += 1
        self.show()


def _exported(job: QueuedCommand) -> dict[str, Any] | None:
    """Output of ``brightgrey export --json``; None if it has failed."""
    try:
        (found,) = json.loads(job.output)
    except ValueError:
        return None
    return dict(found)
