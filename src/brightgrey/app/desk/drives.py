"""What the desk does with drives and models: drawings, results, live fits and gains, as plain data."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from brightgrey.api.to_si import identification_task
from brightgrey.app.plots.loops import loop_figure
from brightgrey.drawing.drive import Sensor, drive_of
from brightgrey.drawing.picture import DriveDrawing
from brightgrey.errors import BrightgreyError, SettingsError
from brightgrey.estimation import predict
from brightgrey.kit import Structure, grammar_named
from brightgrey.kit.in_words import effect_heading, structure_in_words
from brightgrey.kit.structure import Placed
from brightgrey.model.model import load_model
from brightgrey.model.trace import Trace
from brightgrey.recordings.recording_toml import read_recordings
from brightgrey.report.charts.comparison import comparisons
from brightgrey.report.drawing.plotly_figure import plot
from brightgrey.report.page_parts import page_parts
from brightgrey.runs import RunError, read_status

__all__ = [
    "drive_picture",
    "effect_choices",
    "gains",
    "live_fit",
    "result_parts",
    "run_status",
    "words_of",
]

_MASSES = {1: "one_mass", 2: "two_mass", 3: "three_mass", 4: "four_mass"}
_OPTIONAL_IN_DRAWING = ("coulomb", "viscous", "gravity", "backlash", "current_control", "delay")
"""Effects that are drawn dashed while nothing is known of them."""


def effect_choices() -> dict[str, Any]:
    """Effects and parameters that a user may know something of, with words and explanations."""
    grammar = grammar_named("drive")
    effects = [
        {"name": str(p), "title": effect_heading(p), "about": p.effect.about, "equation": p.effect.equation}
        for p in (*grammar.placed, *grammar.further)
        if not p.effect.masses and p.place == 1
    ]
    parameters = [{"name": name, "about": declared.about} for name, declared in grammar.parameters.items()]
    return {"effects": effects, "parameters": [p for p in parameters if "@" not in p["name"]]}


def drive_picture(
    motion: str, least: int, most: int, certain: Sequence[str], absent: Sequence[str], sensors: Sequence[list[Any]]
) -> str:
    """Drawing of what is known of a drive; what is open is dashed.

    Parameters
    ----------
    motion : {'rotary', 'linear'}
    least, most : int
        Number of masses.
    certain, absent : sequence of str
        Effects.
    sensors : sequence of [mass, name, kind]
    """
    chosen = [Placed.parse(name) for name in certain if Placed.parse(name).place <= max(least, 1)]
    chosen = [p for p in chosen if p.effect.where != "shaft" or p.place < least]
    structure = Structure((Placed(_MASSES[least]), *chosen))
    undecided = [_MASSES[n] for n in range(least + 1, most + 1)]
    for name in (*_OPTIONAL_IN_DRAWING, *certain):
        placed = Placed.parse(name)
        enough = most > placed.place if placed.effect.where == "shaft" else True
        if enough and name not in absent and placed not in structure.placed:
            undecided.append(name)
    drive = drive_of(
        structure,
        rotary=motion == "rotary",
        sensors=[Sensor(mass, name, kind) for mass, name, kind in sensors if mass <= most],
        undecided=undecided,
    )
    return DriveDrawing(drive).html()


def words_of(structures: Sequence[str]) -> list[str]:
    """Structures in words."""
    return [structure_in_words(Structure.parse(name)) for name in structures]


def run_status(folders: Sequence[str]) -> list[dict[str, Any]]:
    """State and stage of runs; ``missing`` where there is none."""
    found = []
    for folder in folders:
        has_results = (Path(folder) / "model.json").is_file()
        try:
            status = read_status(folder)
        except RunError as error:
            state = "finished" if has_results else "missing"
            found.append({"state": state, "stage": {}, "seconds": 0.0, "has_results": has_results, "said": str(error)})
            continue
        stage = dict(status.stage)
        stage["words"] = words_of([stage["best"]])[0] if stage.get("best") else ""
        stage["minimal_words"] = words_of(stage.get("minimal", []))
        stage["rows"] = [
            [", ".join(effect_heading(Placed.parse(name)) for name in lacking), ratio]
            for lacking, ratio in stage.get("refuted", [])
        ]
        found.append(
            {
                "state": status.state,
                "stage": stage,
                "seconds": status.seconds,
                "has_results": has_results,
                "evaluations": status.evaluations,
                "said": "",
            }
        )
    return found


def live_fit(tomls: Sequence[str], structure: str, values: Mapping[str, float], label: str) -> dict[str, Any] | None:
    """Figure of the first recording beside the best structure so far; None where it cannot be simulated."""
    try:
        recording = read_recordings(tomls[0])[0]
        task = identification_task([recording], None, {}, {}, None)
        best = Structure.parse(structure)
        own = {name: values[name] for name in best.parameters}
        simulated = predict(best, own, recording, task.settings)
    except (BrightgreyError, KeyError, IndexError, np.linalg.LinAlgError):
        return None
    chart = comparisons([Trace.of(recording, simulated)])[0]
    figure = plot(chart)
    figure["label"] = f"{label}: measured, and simulated by the best structure so far"
    return figure


def result_parts(folder: str, labels: Mapping[str, str]) -> dict[str, Any]:
    """Parts of the report of a run, with the names of the recordings as they came.

    Raises
    ------
    SettingsError
        If there is no report.
    """
    try:
        text = (Path(folder) / "report.html").read_text(encoding="utf-8")
    except OSError as error:
        raise SettingsError(f"the report cannot be read: {error.strerror}") from None
    parts = page_parts(text)
    plots = json.dumps(parts.plots)
    header, sections = parts.header, dict(parts.sections)
    for file, label in labels.items():
        plots = plots.replace(file, json.dumps(label)[1:-1])
        sections = {name: section.replace(file, _escaped(label)) for name, section in sections.items()}
        header = header.replace(file, _escaped(label))
    model = load_model(Path(folder) / "model.json")
    return {
        "header": header,
        "sections": sections,
        "plots": json.loads(plots),
        "structure": str(model.structure),
        "input": [model.input.name, model.input.unit],
    }


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace('"', "&quot;")


def gains(model: str, torque: float, dt: float | None, computing: float) -> dict[str, Any]:
    """Gains of a cascade for a model, with their margins and Bode plots of the loop before and after.

    Raises
    ------
    BrightgreyError
        If no such control exists.
    """
    from brightgrey.api.control import design

    found = design(load_model(model), torque=torque, sampling_time=dt, computing_time=computing)
    cascade = found.cascade
    contacts = [a.operating_point.contact_mode.contact for a in found.analyses]
    margins = [
        (loop, contact, m)
        for loop, several in (("speed loop", cascade.speed_margins), ("whole cascade", cascade.position_margins))
        for contact, m in zip(contacts, several, strict=True)
    ]
    return {
        "gains": [
            ("Position gain", f"{cascade.position_gain:.4g}", "1/s"),
            ("Speed gain", f"{cascade.speed_gain:.4g}", "SI: torque per speed"),
            ("Reset time", f"{1e3 * cascade.reset_time:.4g}", "ms"),
            *(
                (f"State feedback {name}", f"{value:.4g}", "SI")
                for name, value in zip(
                    found.state_feedback.analysis.states, found.state_feedback.K.tolist(), strict=True
                )
            ),
            ("State feedback, integral", f"{found.state_feedback.integral:.4g}", "SI"),
        ],
        "margins": [
            (
                loop,
                contact,
                f"{20.0 * np.log10(m.gain):.3g}" if np.isfinite(m.gain) else "∞",
                f"{m.phase:.3g}",
                f"{m.sensitivity:.3g}",
                f"{m.crossover / (2.0 * np.pi):.3g}",
            )
            for loop, contact, m in margins
        ],
        "figure": loop_figure(found),
    }
