"""Stage 4: the search for the structure, live."""

from __future__ import annotations

from collections.abc import Awaitable
from typing import Any

from nicegui import ui

from brightgrey.app.jobs.arguments import free_cores, identify_arguments, shown_command
from brightgrey.app.stages.option_places import in_app_words
from brightgrey.app.stages.stage import Stage
from brightgrey.app.stages.time_left import time_left
from brightgrey.app.widgets import (
    Figure,
    action,
    alert,
    code_to_copy,
    entry,
    heading,
    hint,
    option_row,
    paragraph,
    table_of,
    tag,
)
from brightgrey.app.workspace.progress import StageState, current_run
from brightgrey.app.workspace.project import RunEntry

__all__ = ["SearchStage"]

_INTERRUPTED = (0, 130, 143, None)
"""Exit codes of a search that came to its end, was stopped, or was watched by another server."""

GRAMMAR_WORDS = {
    "drive": "of real axes",
    "paper": "of the paper",
}
FIGURE_HINTS = {
    "structures fitted": "A structure is a set of effects, such as two masses with Coulomb friction.",
    "parts decided": "The simplest structures that explain the recordings, and the largest that do not.",
    "parts left": "The largest structures of which it is not known whether they explain the recordings.",
    "best fit": "Of the best structure so far: 100 % is perfect, 0 % is no better than a constant.",
    "computing time": "Time of all cores together.",
}
PHASES = {
    "fits": "fitting structures",
    "border": "deciding",
    "restarts": "looking for missed optima",
    "structures": "fitting every structure",
    "missed optima": "looking for missed optima",
}


class SearchStage(Stage):
    """Start, stop with the best so far, go on; what is decided is shown while it runs."""

    name = "search"
    title = "Search for the structure"
    lead = "Structures are fitted until the recordings have decided all of them. You may close this page meanwhile."

    def content(self) -> None:
        """Build what can be chosen, the command, and what runs."""
        self.figure: Figure | None = None
        self.drawn: str = ""
        self.run = current_run(self.document)
        if not self._is_busy():
            self.choices()
        arguments = identify_arguments(self.document, self._name())
        with tag("details"):
            with tag("summary"):
                heading("The same on the command line", 3)
            paragraph("Run in the folder of the project, it gives the same model.json, byte for byte:", "soft")
            code_to_copy(f"cd {self.folder}\n{shown_command(arguments)}", key="identify")
        self.panel, self.panel_kind = tag("div", role="status"), ""
        self.numbers = tag("div")
        self.plot = tag("div")
        self.show()
        self.page.later(self.look())

    def onward(self) -> None:
        """Build the way on where the search has a result."""
        self.way_on = tag("div")
        self.way_open: StageState | None = None
        self.show_way_on()

    def show_way_on(self) -> None:
        """Build the way on anew, if it has opened."""
        state = self.services.states(self.page.document)["results"]
        if state != self.way_open:
            self.way_open = state
            self.way_on.clear()
            with self.way_on:
                super().onward()

    def _name(self) -> str:
        if self.run is not None:
            return self.run.name
        return f"run-{1 + max((int(r.name.split('-')[1]) for r in self.document.runs), default=0)}"

    def _is_busy(self) -> bool:
        return self.run is not None and self.services.is_busy(self.document, self.run.name)

    def choices(self) -> None:
        """Build the choice of the function set and of the seed."""
        search = self.document.search

        def change(**changes: Any) -> None:
            self.page.edit(
                lambda d: d.model_copy(
                    update={"search": type(search).model_validate({**search.model_dump(), **changes})}
                )
            )

        def seed(text: str) -> None:
            if text.strip().isdigit():
                change(seed=int(text))

        with tag("details"):
            with tag("summary"):
                heading("Options of the search", 3)
            with tag("div", "", "row"):
                option_row(
                    "Effects that are tried",
                    search.grammar,
                    GRAMMAR_WORDS,
                    lambda v: change(grammar=v),
                    key="grammar",
                    about="Real axes have friction at every mass, springs to ground, play in every shaft. "
                    "The paper has 448 structures without these.",
                )
                entry(
                    "Seed",
                    str(search.seed),
                    seed,
                    key="seed",
                    about="Another seed draws other starts.",
                    inputmode="numeric",
                )
                if len(self.document.of_use("train")) > 1 or search.per_recording:
                    entry(
                        "Values that may differ between the recordings",
                        search.per_recording,
                        lambda text: change(per_recording="".join(text.split())),
                        key="per-recording",
                        about="Names with commas, such as f_v,M_C where the drive was cold and then warm.",
                    )

    async def look(self) -> None:
        """Read the state of the run once, for a page that was opened after it."""
        if self.run is not None:
            await self.still(self.services.look(self.page.name, [self.run.name]))
            await self.follow_run()

    def follow(self) -> Awaitable[None]:
        """Show what has changed."""
        return self.follow_run()

    async def follow_run(self) -> None:
        """Show the state of the run, and the best fit so far."""
        before, self.document = self.run, self.page.document
        self.run = current_run(self.document)
        if before != self.run:
            self.page.render()
            return
        self.show()
        status = self.status()
        best, values = status.get("stage", {}).get("best"), status.get("stage", {}).get("values")
        if self._is_busy() and values and self.drawn != f"{best}{values}":
            self.drawn = f"{best}{values}"
            await self.draw(best, values)

    def status(self) -> dict[str, Any]:
        """State of the run as it was read last."""
        return {} if self.run is None else self.services.statuses.get((self.page.name, self.run.name), {})

    def show(self) -> None:
        """Build the figures anew; the buttons only if others are wanted, so that no click is lost."""
        status = self.status()
        kind = self.kind(status)
        if kind != self.panel_kind:
            self.panel_kind = kind
            self.panel.clear()
            with self.panel:
                self.buttons(kind)
        self.numbers.clear()
        with self.numbers:
            if kind in ("queued", "running"):
                self.progress(kind, status.get("stage", {}))
            if status.get("stage"):
                self.figures(status["stage"], status)
                self.border(status["stage"])
        if hasattr(self, "way_on"):
            self.show_way_on()

    def kind(self, status: dict[str, Any]) -> str:
        """State of the search: new, queued, running, finished, failed, stopped or empty."""
        if self.run is None:
            return "new"
        job = self.services.queue.of(self.page.name, self.run.name, "identify")
        if self._is_busy() and job is not None:
            return job.state
        if status.get("state") == "finished":
            return "finished"
        if job is not None and job.output and job.code not in _INTERRUPTED:
            return "failed"
        return "stopped" if status.get("has_results") else "empty"

    def buttons(self, kind: str) -> None:
        """Build what can be done, with what has happened."""
        if kind == "new":
            self.start_panel("Start the search")
        elif kind in ("queued", "running"):
            assert self.run is not None
            run = self.run
            with tag("div", "", "row middle"):
                action("Stop with the best so far", lambda: self.stop(run), key="stop")
                paragraph("Nothing is lost: “Go on” continues where it was stopped.", "soft")
        elif kind == "finished":
            left = self.status().get("stage", {}).get("left")
            spent = "its budget of structures is spent, and the result says what has stayed undecided."
            alert(f"The search is finished: {spent if left else 'everything is decided.'}", "good")
        elif kind == "failed":
            assert self.run is not None
            job = self.services.queue.of(self.page.name, self.run.name, "identify")
            said = job.output.splitlines()[-1].removeprefix("brightgrey: ") if job else "It has failed."
            alert(in_app_words(said))
            self.start_panel("Try again")
        elif kind == "stopped":
            said = (
                "The search was stopped. Its best structure so far is the result, without verdicts. “Go on” continues."
            )
            alert(said, "note")
            self.start_panel("Go on")
        else:
            alert("The search was stopped before it had a result. It goes on with what it has kept.", "note")
            self.start_panel("Go on")

    def start_panel(self, text: str) -> None:
        """Build the button that starts."""
        with tag("div", "", "row middle"):
            action(text, self.start, key="start", primary=True)
            paragraph("It takes seconds to minutes, and leaves one core to you.", "soft")

    def start(self) -> None:
        """Start the search or go on with it."""
        self.services.begin_search(self.page.name)
        self.page.render()

    def progress(self, kind: str, stage: dict[str, Any]) -> None:
        """Build the line on what is being done, with the share that is decided."""
        seconds = float(self.status().get("seconds", 0.0))
        first = "fitting the largest structures" if seconds else "preparing, which takes a minute the first time"
        said = PHASES.get(stage.get("name", ""), first)
        paragraph("It waits until another command has ended." if kind == "queued" else f"Running: {said} …")
        tag("progress", aria_label="Share of the border that is decided", **_share(stage))
        if kind == "running":
            paragraph(time_left(stage, seconds, free_cores()), "soft")

    def stop(self, run: RunEntry) -> None:
        """Stop: the command ends as with Ctrl-C, with the best so far, and can go on."""
        self.services.stop_search(self.page.name, run.name)
        ui.notify("The search writes the best structure so far, and ends.")
        self.show()

    def figures(self, stage: dict[str, Any], status: dict[str, Any]) -> None:
        """Build the figures of a search."""
        fit = stage.get("fit_percent")
        shown = {
            "structures fitted": stage.get("done"),
            "parts decided": stage.get("decided"),
            "parts left": stage.get("left"),
            "best fit": None if fit is None else f"{fit:.2f} %",
            "computing time": f"{status.get('seconds', 0.0):.0f} s",
        }
        with tag("dl", "", "figures"):
            for name, value in shown.items():
                if value is not None:
                    with tag("div"):
                        with tag("dt"):
                            hint(name, FIGURE_HINTS[name])
                        tag("dd", str(value))

    def border(self, stage: dict[str, Any]) -> None:
        """Build the table of the border: what cannot be missing."""
        minimal = stage.get("minimal_words", [])
        if minimal:
            with tag("h2"):
                so_far = "" if self.panel_kind == "finished" else " so far"
                hint(f"Simplest structures{so_far}", "They explain the recording, and nothing can be taken from them.")
            with tag("ul"):
                for text in minimal:
                    tag("li", text[:1].upper() + text[1:])
        if stage.get("rows"):
            with tag("h2"):
                hint("What cannot be missing", "Without these effects the residual grows, whatever else is allowed.")
            table_of(
                ("Without", "Residual"),
                [(f"{name[:1].upper()}{name[1:]}", f"{ratio:.3g} times as large") for name, ratio in stage["rows"]],
                caption="Effects without which the residual grows, whatever else is allowed",
                numbers=(1,),
            )

    async def draw(self, best: str, values: dict[str, float]) -> None:
        """Draw the best structure so far over the first recording."""
        tomls = self.services.tomls(self.document, "train")
        label = self.document.of_use("train")[0].label
        figure = await self.still(self.services.desk.call("live_fit", tomls, best, values, label))
        if figure is None:
            return
        if self.figure is None:
            with self.plot:
                heading("The best structure so far over the recording", 2)
                with tag("div", "", "frame"):
                    self.figure = Figure(figure, figure["label"])
        else:
            self.figure.show(figure)


def _share(stage: dict[str, Any]) -> dict[str, str]:
    """Attributes of a progress bar; without a border there is no share yet."""
    if "decided" not in stage:
        return {}
    return {"max": str(stage["decided"] + stage["left"]), "value": str(stage["decided"])}
