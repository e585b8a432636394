"""What the desk does with runs and models: their state, their report, live fits and gains, as plain data."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from brightgrey.api.control import design
from brightgrey.api.to_si import identification_task
from brightgrey.app.desk.structures import traces_of_fit
from brightgrey.app.plots.loops import loop_figure
from brightgrey.errors import BrightgreyError, SettingsError
from brightgrey.kit import Placed, Structure
from brightgrey.kit.in_words import effects_in_words, enumerated, structure_in_words
from brightgrey.model.model import load_model
from brightgrey.recordings.recording_toml import read_recordings
from brightgrey.report.charts.comparison import comparisons
from brightgrey.report.drawing.plotly_figure import plot
from brightgrey.report.page_parts import page_parts
from brightgrey.runs import RunError, read_status
from brightgrey.search import IdentificationTask

__all__ = ["gains", "live_fit", "result_parts", "run_status"]


def _in_words(structures: Sequence[str]) -> list[str]:
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
        stage["words"] = _in_words([stage["best"]])[0] if stage.get("best") else ""
        stage["minimal_words"] = _in_words(stage.get("minimal", []))
        stage["rows"] = [
            [enumerated(effects_in_words(Placed.parse(name) for name in lacking)), ratio]
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


@lru_cache(maxsize=1)
def _live_task(tomls: tuple[tuple[str, int], ...]) -> IdentificationTask:
    """Task on the recordings of files that were changed at these times; kept for the next look at a search."""
    recordings = [recording for toml, _ in tomls for recording in read_recordings(toml)]
    return identification_task(recordings, None, {}, {}, None)


def live_fit(tomls: Sequence[str], structure: str, values: Mapping[str, float], label: str) -> dict[str, Any] | None:
    """Figure of the first recording beside the best structure so far; None where it cannot be simulated."""
    try:
        best = Structure.parse(structure)
        differing = {name.partition("#")[0] for name in values if "#" in name} & set(best.parameters)
        task = _live_task(tuple((toml, Path(toml).stat().st_mtime_ns) for toml in tomls))
        trace = next(traces_of_fit(replace(task, per_recording=tuple(sorted(differing))), best, values))
    except (BrightgreyError, OSError, KeyError, IndexError, np.linalg.LinAlgError):
        return None
    figure = plot(comparisons([trace])[0])
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
        sections = {name: section.replace(file, html.escape(label)) for name, section in sections.items()}
        header = header.replace(file, html.escape(label))
    model = load_model(Path(folder) / "model.json")
    return {
        "header": header,
        "sections": sections,
        "plots": json.loads(plots),
        "structure": str(model.structure),
        "input": [model.input.name, model.input.unit],
    }


def gains(model: str, torque: float, dt: float | None, computing: float) -> dict[str, Any]:
    """Gains of a cascade for a model, with their margins, notes, and Bode plots of the loop before and after.

    Raises
    ------
    BrightgreyError
        If no such control exists.
    """
    found = design(load_model(model), torque=torque, sampling_time=dt, computing_time=computing)
    cascade = found.cascade
    several = len(found.analyses) > 1
    words = [place.replace("forward", "in contact").replace("gap", "in the gap") for place in found.places]
    contacts = [f", {place}" if several else "" for place in words]
    margins = [
        (loop + contact, m)
        for loop, of_loop in (("speed loop", cascade.speed_margins), ("whole cascade", cascade.position_margins))
        for contact, m in zip(contacts, of_loop, strict=True)
    ]
    gains_of = [
        *found.cascade_gains(),
        *((f"state feedback: {name}", value, unit) for name, value, unit in found.feedback_gains()),
    ]
    return {
        "gains": [(f"{name[:1].upper()}{name[1:]}", f"{value:.4g}", unit) for name, value, unit in gains_of],
        "margins": [
            (
                loop,
                f"{20.0 * np.log10(m.gain):.3g}" if np.isfinite(m.gain) else "∞",
                f"{m.phase:.3g}",
                f"{m.sensitivity:.3g}",
                f"{m.crossover / (2.0 * np.pi):.3g}",
            )
            for loop, m in margins
        ],
        "notes": found.notes,
        "figure": loop_figure(found),
    }
