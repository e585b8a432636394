"""Stage 3: is a recording fit to be used; each fault with its remedy."""

from __future__ import annotations

from functools import partial
from typing import Any

from brightgrey.app.stages.option_places import in_app_words
from brightgrey.app.stages.stage import Stage
from brightgrey.app.widgets import action, alert, heading, paragraph, tag, tick
from brightgrey.app.workspace.project import ProjectDocument
from brightgrey.errors import BrightgreyError

__all__ = ["CheckStage"]

WORDS = {"stop": "stop", "mind": "mind", "note": "note", "passed": "passed"}
GRADE_SENTENCES = {
    "stop": "A fault makes an identification meaningless. Mend it, or record again.",
    "mind": "Something is likely to be a fault. Read it before you go on.",
    "note": "Nothing is wrong. There is something that is good to know.",
    "passed": "Nothing is wrong with these recordings.",
}


class CheckStage(Stage):
    """Table of the doctor, each remedy with a button; *stop* blocks the way on."""

    name = "check"
    title = "Check of the recordings"
    lead = "Signs, factors, clocks, repeated samples, limits and motion, before any time is spent on them."
    follows_runs = False

    def content(self) -> None:
        """Build the place of the table, which the desk fills."""
        self.place = tag("div", role="status", aria_live="polite")
        with self.place:
            paragraph("The recordings are being checked …", "soft")
        self.page.later(self.fill())

    def onward(self) -> None:
        """Build the way on with the results, below the table."""

    async def fill(self) -> None:
        """Show the results."""
        changes = self.services.workspace.changes.get(self.page.name)
        try:
            found = await self.still(self.services.check(self.document))
        except BrightgreyError as error:
            found = {"grade": "stop", "problems": [str(error)], "results": []}
        self.place.clear()
        with self.place:
            self.show(found)
            super().onward()
        if self.services.workspace.changes.get(self.page.name) != changes:
            self.page.edit(lambda d: d, again=False)

    def show(self, found: dict[str, Any]) -> None:
        """Build the table of results."""
        if found["problems"]:
            for text in found["problems"]:
                alert(text)
            paragraph("A recording cannot be read with what is said of its channels.")
            action("Back to the recordings", lambda: self.page.go("recording"), key="back")
            return
        alert(GRADE_SENTENCES[found["grade"]], {"passed": "good", "note": "good"}.get(found["grade"], "note"))
        told = [r for r in found["results"] if r["grade"] != "passed"]
        if told:
            self.table(told, "What the checks say")
        if found["grade"] == "stop":
            self.override()
        good = [r for r in found["results"] if r["grade"] == "passed"]
        with tag("details"):
            with tag("summary"):
                heading(f"{len(good)} checks passed", 3)
            self.table(good, "Checks that passed")

    def table(self, results: list[dict[str, Any]], caption: str) -> None:
        """Build a table of results, each with the button of its remedy."""
        with tag("div", "", "scroll", tabindex="0", role="region", aria_label=caption), tag("table", "", "stack"):
            tag("caption", caption, "unseen")
            with tag("thead"), tag("tr"):
                for text in ("Grade", "Check", "Recording", "Figure", "What to do", "Remedy"):
                    tag("th", text, scope="col")
            with tag("tbody"):
                for at, result in enumerate(results):
                    with tag("tr"):
                        with tag("td"):
                            tag("span", WORDS[result["grade"]], f"grade {result['grade']}")
                        tag("td", result["check"])
                        tag("td", result["recording"])
                        figure = result["figure"] + (f" ({result['threshold']})" if result["threshold"] else "")
                        tag("td", figure, "text")
                        tag("td", _as_sentence(in_app_words(result["sentence"])), "text")
                        with tag("td"):
                            if result["remedy"]:
                                action(
                                    "Apply",
                                    partial(self.start_remedy, result),
                                    key=f"apply-{at}",
                                    label=f"Apply the remedy for {result['check']}: {_remedy(result['remedy'])}",
                                )
                                tag("span", _remedy(result["remedy"]), "about")

    def override(self) -> None:
        """Build the way on against a *stop*."""

        def change(value: bool) -> None:
            self.page.edit(lambda d: d.model_copy(update={"check": d.check.model_copy(update={"override": value})}))

        tick(
            "Go on all the same. The result may be meaningless: what a check has stopped is then part of the model.",
            self.document.check.override,
            change,
            key="override",
        )

    def start_remedy(self, result: dict[str, Any]) -> None:
        """Apply a remedy, in its time."""
        self.page.later(self.apply(result))

    async def apply(self, result: dict[str, Any]) -> None:
        """Apply a remedy to the options of its recording, as ``brightgrey check --fix`` does."""
        (recording,) = (r for r in self.document.recordings if r.file == result["file"])
        options = await self.still(self.services.desk.call("apply_remedy", dict(recording.options), result["remedy"]))

        def edit(document: ProjectDocument) -> ProjectDocument:
            return document.with_recording(recording.file, options=options)

        self.page.edit(edit)


def _remedy(remedy: dict[str, Any]) -> str:
    parts = []
    for name, value in remedy.items():
        shown = ", ".join(map(str, value)) if isinstance(value, list) else f"× {value:g}"
        parts.append(f"{name.replace('_', ' ')} {shown}")
    return "; ".join(parts)


def _as_sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}" + ("" if not text or text.endswith(".") else ".")
