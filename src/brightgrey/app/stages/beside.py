"""Two structures of one run side by side: effects, parameters, fits, and both residuals over the recording."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from brightgrey.app.stages.stage import Stage
from brightgrey.app.widgets import Figure, alert, heading, paragraph, table_of, tag
from brightgrey.errors import BrightgreyError

__all__ = ["StructuresBeside"]


class StructuresBeside:
    """The part of the results that compares the found structure, A, with another one, B.

    Parameters
    ----------
    stage : Stage
    folder : str
        Of the run.
    both : (str, str)
    words : mapping of str to str
        Structures in words.
    labels : mapping of str to str
        Names of the recordings for people, by their files.
    """

    def __init__(
        self, stage: Stage, folder: str, both: tuple[str, str], words: Mapping[str, str], labels: Mapping[str, str]
    ) -> None:
        self.stage, self.folder, self.both, self.words, self.labels = stage, folder, both, words, labels
        self.place = tag("div", role="status")
        with self.place:
            paragraph("Both structures are simulated …", "soft")

    async def fill(self) -> None:
        """Show the tables, then the figures."""
        try:
            found = await self.stage.still(self.stage.services.desk.call("beside_tables", self.folder, *self.both))
        except BrightgreyError as error:
            found = None
            said = str(error)
        self.place.clear()
        with self.place:
            if found is None:
                alert(said)
                return
            self.tables(found)
            heading("Over the recording", 2)
            for number, (recording, output, *_) in enumerate(found["fits"]):
                heading(f"{self.labels.get(recording, recording)}: {output}", 3)
                await self.draw(number)
            paragraph("Drag over a part to zoom in, double-click to see everything.", "soft")

    def tables(self, found: dict[str, Any]) -> None:
        """Build the names and the tables."""
        with tag("dl", "", "pairs"):
            for letter, name, status in zip("AB", self.both, found["status"], strict=True):
                tag("dt", letter)
                words = self.words.get(name, name)
                tag("dd", f"{words[:1].upper()}{words[1:]}" + (f": {status}." if status else "."))
        heading("Effects", 2)
        rows = [row for row in found["effects"] if row[1] != row[2]]
        table_of(("Effect", "A", "B", "The recording says"), rows, caption="Effects in which the two structures differ")
        heading("Parameters", 2)
        columns = ("Name", "A", "B", "Unit", "Change in %", "Meaning")
        table_of(columns, found["parameters"], caption="Parameters of both structures", numbers=(1, 2, 4))
        heading("Fit", 2)
        fits = [(self.labels.get(row[0], row[0]), *row[1:]) for row in found["fits"]]
        header = ("Recording", "Output", "Fit of A, %", "Fit of B, %", "RMS of A", "RMS of B", "Unit")
        table_of(header, fits, caption="Fit of both structures", numbers=(2, 3, 4, 5))

    async def draw(self, number: int) -> None:
        """Draw one output of one recording; a zoom asks for its samples."""
        desk = self.stage.services.desk
        figure = await self.stage.still(desk.call("beside_course", self.folder, *self.both, number, None))

        async def zoom(span: list[float] | None) -> None:
            ends = (float(span[0]), float(span[1])) if span else None
            drawn.show(await self.stage.still(desk.call("beside_course", self.folder, *self.both, number, ends)))

        with self.place, tag("div", "", "frame"):
            drawn = Figure(figure, "Measured motion, and simulated by both structures", on_zoom=zoom)
