"""Stage 2: recordings, what their channels are, and which part of them is used."""

from __future__ import annotations

from typing import Any

from nicegui import ui

from brightgrey.app.services import AppServices
from brightgrey.app.stages.channels import ChannelTable, reading_options
from brightgrey.app.stages.stage import Stage
from brightgrey.app.widgets import Figure, action, alert, entry, heading, option_row, paragraph, tag
from brightgrey.app.workspace.folder import toml_name
from brightgrey.app.workspace.project import ProjectDocument, RecordingUse, StoredRecording
from brightgrey.errors import BrightgreyError

__all__ = ["RecordingStage", "add_file"]

USES = {"train": "fit the model to it", "test": "only test the model on it", "unused": "leave it out"}


class RecordingStage(Stage):
    """Files are dropped, channels named, recordings marked for fit or test, windows taken from the plot."""

    name = "recording"
    title = "Recordings"
    lead = "A few seconds of torque (force, current or voltage) and motion, sampled together, from any controller."
    follows_runs = False

    def content(self) -> None:
        """Build the place to drop files, the channels, and the recordings."""
        self.spans: dict[str, tuple[float, float] | None] = {}
        with tag("div", "", "drop", data_drop="recordings"):
            tag("label", "Drop files here, or choose them", "strong", for_="files")
            tag(
                "p",
                "CSV and other text, MAT, HDF5, TDMS, MDF4, exports of TwinCAT, EPOS and LabVIEW; also packed by gzip",
                "soft",
            )
            tag(
                "input",
                type="file",
                multiple=True,
                id="files",
                data_project=self.page.name,
                data_key="files",
                aria_describedby="uploads",
            )
            tag("ul", id="uploads", role="status")
        if not self.document.recordings:
            with tag("div", "", "row middle"):
                paragraph("No recording at hand? Try the one that comes with brightgrey:", "soft")
                action("Use the demo recording", lambda: self.page.later(self.add_demo()), key="demo")
            return
        self.channels = tag("div")
        first = self.document.recordings[0]
        known = self.services.inspections.get((self.page.name, first.file))
        if known is not None:
            self.show_channels(first, known)
        else:
            with self.channels:
                paragraph("The file is being looked into …", "soft")
            self.page.later(self.fill_channels(first))
        heading("Files", 2)
        for recording in self.document.recordings:
            self.recording_card(recording)

    async def add_demo(self) -> None:
        """Take the recording that comes with the package."""
        from brightgrey.excitation import demo_recording

        source = self.folder / "recordings" / ".demo"
        source.write_text(demo_recording(), encoding="utf-8")
        await self.still(add_file(self.services, self.page.name, source, "demo.csv", ""))
        self.page.render()

    async def fill_channels(self, first: StoredRecording) -> None:
        """Look into the first recording, then build the table of its channels."""
        try:
            found = await self.still(self.services.inspect(self.page.name, first.file))
        except BrightgreyError as error:
            self.channels.clear()
            with self.channels:
                alert(str(error))
            return
        self.channels.clear()
        self.show_channels(first, found)

    def show_channels(self, first: StoredRecording, found: dict[str, Any]) -> None:
        """Build the table of channels of the first recording; what is chosen there holds for all."""
        with self.channels:
            ChannelTable(found, first.options, self.set_options).build(first.label)
            reading_options(first.options, self.set_options)

    def set_options(self, changes: dict[str, Any]) -> None:
        """Change options of all recordings."""

        def edit(document: ProjectDocument) -> ProjectDocument:
            changed = [
                r.model_copy(
                    update={"options": {k: v for k, v in {**r.options, **changes}.items() if v not in (None, "", [])}}
                )
                for r in document.recordings
            ]
            return document.model_copy(update={"recordings": tuple(changed)})

        self.page.edit(edit)

    def recording_card(self, recording: StoredRecording) -> None:
        """Build one recording: its use, its window, its plot."""
        key = recording.file.rpartition(".")[0]
        with tag("section", "", "card", aria_label=recording.label, data_recording=recording.label):
            heading(recording.label, 3)
            paragraph(f"{_size_in_words(recording.size)}, SHA-256 {recording.sha256[:12]}…", "soft")
            option_row(
                "Use",
                recording.use,
                USES,
                lambda value: self.set_use(recording.file, value),
                key=f"use-{key}",
            )
            window = str(recording.options.get("window", ""))
            start, _, end = window.partition(":")
            with tag("div", "", "row"):
                entry(
                    "Use the time from",
                    start,
                    lambda t: self.set_window(recording, t, end),
                    key=f"from-{key}",
                    unit="s",
                )
                entry("to", end, lambda t: self.set_window(recording, start, t), key=f"to-{key}", unit="s")
                action("Take the part shown", lambda: self.take_span(recording), key=f"span-{key}")
                action("Remove", lambda: self.remove(recording), key=f"remove-{key}", label=f"Remove {recording.label}")
            place = tag("div", "", "frame")
            self.page.later(self.draw(recording, place))

    def set_use(self, file: str, use: str) -> None:
        """Mark a recording; only one can be the test."""
        wanted: RecordingUse = "test" if use == "test" else "unused" if use == "unused" else "train"

        def edit(document: ProjectDocument) -> ProjectDocument:
            for other in document.of_use("test") if wanted == "test" else ():
                document = document.with_recording(other.file, use="train")
            return document.with_recording(file, use=wanted)

        self.page.edit(edit)

    def set_window(self, recording: StoredRecording, start: str, end: str) -> None:
        """Use a part of a recording only."""
        low, high = (text.strip().replace(",", ".") for text in (start, end))
        options = {k: v for k, v in recording.options.items() if k != "window"}
        if low or high:
            options["window"] = f"{low}:{high}"
        self.page.edit(lambda d: d.with_recording(recording.file, options=options))

    def take_span(self, recording: StoredRecording) -> None:
        """Use the part that the plot shows."""
        span = self.spans.get(recording.file)
        if span is None:
            ui.notify("Zoom into the plot first: drag over the part that you want.")
            return
        self.set_window(recording, f"{span[0]:.6g}", f"{span[1]:.6g}")

    def remove(self, recording: StoredRecording) -> None:
        """Delete a recording."""
        self.services.workspace.remove_recording(self.page.name, recording.file)
        self.page.render()

    async def draw(self, recording: StoredRecording, place: ui.element) -> None:
        """Draw a recording; a zoom asks for the samples of the part that is shown."""
        path = str(self.folder / "recordings" / toml_name(recording))
        if not (recording.options.get("input") and recording.options.get("output")):
            with place:
                paragraph("It is drawn once input and output are named.", "soft")
            return
        try:
            figure = await self.still(self.services.desk.call("recording_course", path, None, recording.label))
        except BrightgreyError as error:
            with place:
                alert(str(error).replace(recording.file, recording.label))
            return

        async def zoom(span: list[float] | None) -> None:
            shown = (float(span[0]), float(span[1])) if span else None
            self.spans[recording.file] = shown
            drawn.show(await self.still(self.services.desk.call("recording_course", path, shown, recording.label)))

        with place:
            drawn = Figure(figure, f"{recording.label} over time", on_zoom=zoom)
            paragraph("Drag over a part to zoom in, double-click to see everything.", "soft")


async def add_file(services: AppServices, project: str, content: Any, label: str, sha256: str) -> str:
    """Take a file as a recording of a project, with the options that it suggests or those of the first recording.

    Raises
    ------
    BrightgreyError
        If it is no recording; the file is gone then.
    """
    document = services.workspace.load(project)
    if not sha256:
        import hashlib

        sha256 = hashlib.sha256(content.read_bytes()).hexdigest()
    size = content.stat().st_size
    try:
        found = await services.desk.call("inspect_file", str(content))
    except BrightgreyError:
        content.unlink(missing_ok=True)
        raise
    finally:
        services.desk.recycle(size)
    options = dict(found["options"])
    names = {channel["name"] for channel in found["channels"]}
    if document.recordings:  # the same drive: what was said of the first one's channels holds, if it has them
        first = {k: v for k, v in document.recordings[0].options.items() if k not in ("window", "shift")}
        wanted = [str(first.get("input", "")), *(text.rpartition(":")[0] for text in first.get("output", []))]
        options = first if all(name in names for name in wanted) else options
    file = services.workspace.add_recording(project, content, label, sha256, options)
    services.inspections[project, file] = found
    return file


def _size_in_words(count: int) -> str:
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{count / 1e3:.1f} kB"
