"""Pages: the list of projects, and a project with its stages, of which one is shown."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from nicegui import background_tasks, ui

from brightgrey.app.controls import connect_control, show_scene
from brightgrey.app.services import AppServices
from brightgrey.app.stages.check import CheckStage
from brightgrey.app.stages.drive import DriveStage
from brightgrey.app.stages.handover import HandoverStage
from brightgrey.app.stages.recording import RecordingStage
from brightgrey.app.stages.results import ResultsStage
from brightgrey.app.stages.search import SearchStage
from brightgrey.app.stages.stage import ProjectView, Stage, StageLeftError
from brightgrey.app.widgets import action, alert, entry, heading, link, paragraph, tag
from brightgrey.app.workspace.progress import STAGES, StageState, next_stage
from brightgrey.app.workspace.project import ProjectDocument
from brightgrey.errors import BrightgreyError

__all__ = ["home_page", "project_page"]


@dataclass(frozen=True)
class _PagePolicy:
    """Times of a page."""

    look_every: float = 0.7  #: Time in s between two looks at whether something has changed.


PAGES = _PagePolicy()

STAGE_NAMES = {
    "drive": "Drive",
    "recording": "Recording",
    "check": "Check",
    "search": "Search",
    "results": "Results",
    "handover": "Hand over",
}
STAGE_KINDS: dict[str, Callable[[ProjectView], Stage]] = {
    "drive": DriveStage,
    "recording": RecordingStage,
    "check": CheckStage,
    "search": SearchStage,
    "results": ResultsStage,
    "handover": HandoverStage,
}
STAGE_SIGNS = {"done": "✓", "stale": "!", "open": "", "blocked": ""}
STAGE_WORDS = {"done": "done", "stale": "out of date", "open": "open", "blocked": "not yet"}


def _frame(where: str = "") -> None:
    """Head of every page."""
    ui.page_title(f"{where} – brightgrey" if where else "Brightgrey")
    tag("a", "To the content", "skip", href="#content")
    with tag("header", "", "bar"):
        link("Brightgrey", "/", style="brand", aria_label="Brightgrey: all projects")
        if where:
            tag("span", where, "where")


def home_page(services: AppServices) -> None:
    """Page with all projects."""
    _frame()
    title = ""

    def typed(text: str) -> None:
        nonlocal title
        title = text

    def create() -> None:
        document = services.workspace.create(title or "New drive")
        ui.navigate.to(f"/project/{document.name}/drive")

    with tag("div", "", "main", id="content", tabindex="-1"):
        heading("From a recording to a model of the drive", 1)
        paragraph(
            "Record torque and motion of a drive for a few seconds. Brightgrey finds out which effects are at work, "
            "how large they are, and what the recording does not show. Nothing leaves this computer.",
            "lead",
        )
        with tag("form", "", "row", data_form="create") as form:
            entry(
                "Name of a new project", "", typed, key="title", placeholder="X axis, milling machine", maxlength="80"
            )
            tag("button", "Create", "button primary", type="submit", data_key="create")
        form.on("submit.prevent", lambda _: create())
        heading("Projects")
        names = services.workspace.names()
        if not names:
            paragraph("There is none yet. Create one above; it can begin with the demo recording.", "soft")
        with tag("ul", "", "cards plain"):
            for name in names:
                _project_card(services, name)


def _project_card(services: AppServices, name: str) -> None:
    with tag("li", "", "card"):
        try:
            document = services.workspace.load(name)
        except BrightgreyError as error:
            heading(name, 3)
            alert(str(error))
            return
        states = services.states(document)
        stage = next_stage(states)
        with tag("h3"):
            link(document.title, f"/project/{name}/{stage}", key=f"open-{name}")
        count = len(document.recordings)
        paragraph(f"{count} recording{'' if count == 1 else 's'}, next: {STAGE_NAMES[stage].lower()}", "soft")
        with tag("details"):
            tag("summary", "Delete")
            paragraph("This removes the project's recordings, runs and exports from the disk.", "soft")

            def delete() -> None:
                for run in document.runs:
                    services.queue.interrupt((name, run.name, "identify"))
                services.workspace.delete(name)
                ui.navigate.to("/")

            action("Delete for good", delete, key=f"delete-{name}", label=f"Delete {document.title} for good")


class _ProjectPage:
    """A project in one tab of a browser."""

    def __init__(self, services: AppServices, name: str, stage: str) -> None:
        self.services, self.name, self.stage = services, name, stage
        self.shown: Stage | None = None
        self.seen: tuple[int, int] = (-1, -1)
        self.times_built = 0
        self.told: tuple[str, dict[str, StageState]] | None = None
        self.client = ui.context.client

    @property
    def document(self) -> ProjectDocument:
        """Document of the project, as the disk has it."""
        return self.services.workspace.load(self.name)

    def build(self) -> None:
        """Build the page."""
        document = self.document
        _frame(document.title)
        with tag("nav", "", "stages", aria_label="Stages") as self.nav:
            pass
        self.main = tag("div", "", "main", id="content", tabindex="-1")
        unknown = [r.name for r in document.runs if (self.name, r.name) not in self.services.statuses]
        if unknown:  # right after the start of the server: what a run has come to decides which stages are open
            with self.main:
                tag("h1", document.title)
                paragraph("The runs of this project are being read …", "soft")
            self.later(self.read_runs(unknown))
        else:
            self.arrive()
        ui.timer(PAGES.look_every, self.tick)

    async def read_runs(self, runs: list[str]) -> None:
        """Read what runs have come to, then show the stage that was asked for."""
        await self.services.look(self.name, runs)
        if not self.main.is_deleted:  # the page may have been closed meanwhile
            self.arrive()

    def arrive(self) -> None:
        """Show the stage that was asked for, or the next one if it is blocked."""
        states = self.services.states(self.document)
        if not states[self.stage].reachable:
            self.stage = next_stage(states)
        self.render()

    def version(self) -> tuple[int, int]:
        """Grows whenever the document or something that runs has changed."""
        return self.services.workspace.changes.get(self.name, 0), self.services.ticks

    def render(self) -> None:
        """Show the stage anew."""
        self.seen = self.version()
        self.times_built += 1
        self._render_nav()
        self.main.clear()
        show_scene(self.main, self.stage)
        states = self.services.states(self.document)
        with self.main:
            self.shown = STAGE_KINDS[self.stage](self)
            if states[self.stage].progress == "stale":
                alert(states[self.stage].reason, "note")
            self.shown.build()

    def _render_nav(self) -> None:
        states = self.services.states(self.document)
        told = self.stage, states
        if told == self.told:  # a button that is made anew would lose a click that is on its way
            return
        self.told = told
        self.nav.clear()
        with self.nav, tag("ol"):
            for number, name in enumerate(STAGES, 1):
                with tag("li", "", states[name].progress):
                    self._stage_button(number, name, states[name])

    def _stage_button(self, number: int, name: str, state: StageState) -> None:
        button = tag(
            "button",
            type="button",
            title=state.reason or None,
            aria_current="step" if name == self.stage else None,
            aria_disabled=None if state.reachable else "true",
        )
        with button:
            tag("span", STAGE_SIGNS[state.progress] or str(number), "dot", aria_hidden="true")
            tag("span", STAGE_NAMES[name], "name")
            tag("span", f"{STAGE_NAMES[name]}, {STAGE_WORDS[state.progress]}. {state.reason}", "unseen")
        connect_control(button, f"stage-{name}", lambda _: self.go(name))

    def go(self, stage: str) -> None:
        """Open a stage, if it is not blocked."""
        if not self.services.states(self.document)[stage].reachable:
            return
        self.stage = stage
        self.render()
        self.client.run_javascript(f"brightgrey.arrive('/project/{self.name}/{stage}')")

    def edit(self, change: Callable[[ProjectDocument], ProjectDocument], *, again: bool = True) -> None:
        """Change the document, and show the stage anew or only the state of the stages."""
        self.services.workspace.change(self.name, change)
        if again:
            self.render()
        else:
            self.seen = self.version()
            self._render_nav()

    def later(self, work: Awaitable[None]) -> None:
        """Do something that takes time, in the place where the page is now."""
        built = self.times_built

        async def run() -> None:
            try:
                with self.main:
                    await work
            except StageLeftError:
                return
            except RuntimeError:  # NiceGUI's, for a place that is gone: the page was built anew meanwhile
                if self.times_built == built and not self.main.is_deleted:
                    raise

        background_tasks.create(run())

    async def tick(self) -> None:
        """Look whether something has changed elsewhere: another tab, a search, an upload."""
        if not self.services.workspace.path(self.name).is_dir():
            ui.navigate.to("/")
            return
        now = self.version()
        if now == self.seen or self.shown is None:
            return
        changed_elsewhere, self.seen = now[0] != self.seen[0], now
        if changed_elsewhere or not self.shown.follows_runs:
            self.render()
            return
        self._render_nav()
        found = self.shown.follow()
        if found is not None:
            self.later(found)


def project_page(services: AppServices, name: str, stage: str) -> None:
    """Page of a project, opened at a stage."""
    try:
        services.workspace.load(name)
    except BrightgreyError as error:
        _frame()
        with tag("div", "", "main", id="content"):
            heading("This project cannot be opened", 1)
            alert(str(error))
            link("All projects", "/")
        return
    _ProjectPage(services, name, stage if stage in STAGES else STAGES[0]).build()
