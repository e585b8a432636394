"""What every stage has in common."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any, Protocol, TypeVar

from nicegui import ui

from brightgrey.app.services import AppServices
from brightgrey.app.widgets import action, heading, paragraph, tag
from brightgrey.app.workspace.progress import STAGES
from brightgrey.app.workspace.project import ProjectDocument

__all__ = ["ProjectView", "Stage", "StageLeftError"]

T = TypeVar("T")


class StageLeftError(Exception):
    """The stage that waited for something is no longer shown: there is no place for the answer."""


class ProjectView(Protocol):
    """The page that a stage is shown on."""

    services: AppServices
    name: str
    main: ui.element
    shown: Any

    @property
    def document(self) -> ProjectDocument:
        """Document of the project, as the disk has it."""

    def edit(self, change: Callable[[ProjectDocument], ProjectDocument], *, again: bool = True) -> None:
        """Change the document."""

    def go(self, stage: str) -> None:
        """Open a stage."""

    def render(self) -> None:
        """Show the stage anew."""

    def later(self, work: Awaitable[None]) -> None:
        """Do something that takes time."""


class Stage:
    """A stage on a page; those that show what runs follow it without being built anew."""

    name = ""
    title = ""
    lead = ""
    follows_runs = True

    def __init__(self, page: ProjectView) -> None:
        self.page = page
        self.services = page.services
        self.document = page.document
        self.folder = self.services.workspace.path(page.name)

    def build(self) -> None:
        """Build the stage: title, content, and the way on."""
        heading(self.title, 1)
        paragraph(self.lead, "lead")
        self.content()
        self.onward()

    def content(self) -> None:
        """Build what is particular to the stage."""

    async def still(self, work: Awaitable[T]) -> T:
        """Wait for something that is then shown here.

        Raises
        ------
        StageLeftError
            If another stage, or this one built anew, is shown meanwhile, or the page was closed.
        """
        found = await work
        if self.page.shown is not self or self.page.main.is_deleted:
            raise StageLeftError
        return found

    def follow(self) -> Awaitable[None] | None:
        """Show what has changed in a run."""
        return None

    def onward(self) -> None:
        """Button to the next stage, with the reason why it cannot be opened yet."""
        at = STAGES.index(self.name)
        if at + 1 == len(STAGES):
            return
        following = STAGES[at + 1]
        state = self.services.states(self.page.document)[following]
        with tag("footer", "", "onward"):
            action(
                "Continue",
                lambda: self.page.go(following),
                key="continue",
                primary=True,
                disabled=not state.reachable,
                described="why-not" if not state.reachable else None,
            )
            if not state.reachable:
                tag("span", state.reason, "soft", id="why-not")
