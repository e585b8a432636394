"""What the desk does with recordings: content, course over time, checks and remedies, as plain data."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from brightgrey.api.inspection import inspect
from brightgrey.app.plots.channels import channel_figure
from brightgrey.errors import BrightgreyError
from brightgrey.notebook_html import sparkline
from brightgrey.option_texts import reading_arguments
from brightgrey.recordings import Recording, read_recording
from brightgrey.recordings.checks.checkup import check
from brightgrey.recordings.recording_toml import load_recording_toml, read_recordings, recording_toml

__all__ = ["apply_remedy", "check_files", "inspect_file", "recording_course"]


def inspect_file(path: str) -> dict[str, Any]:
    """Channels of a file with what each might be, and the options that would identify it, as a recording.toml has them.

    Raises
    ------
    RecordingError
        If it is no recording.
    """
    found = inspect(path)
    channels = []
    for row, profile, meaning in zip(found.rows(), found.channels, found.meanings, strict=True):
        drawn = sparkline(profile.course) if np.isfinite(profile.course).any() else ""
        channels.append(
            {
                "name": profile.name,
                "unit": profile.unit or "",
                "step": row[2],
                "range": row[3],
                "holes": row[4],
                "words": row[5],
                "reason": row[6],
                "quantity": meaning.quantity,
                "constant": profile.constant or bool(profile.text),
                "spark": drawn.replace('role="img"', 'aria-hidden="true"'),
            }
        )
    return {
        "format": found.format,
        "samples": found.samples,
        "channels": channels,
        "options": _as_toml_options(found.options),
        "why": list(found.why),
        "questions": list(found.questions),
        "notes": list(found.notes),
        "problem": found.problem,
    }


def _as_toml_options(options: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of `read_recording` as the keys of a recording.toml."""
    found: dict[str, Any] = {}
    for name, value in options.items():
        if name == "outputs":
            found["output"] = [value] if isinstance(value, str) else list(value)
        elif name in ("units", "counts"):
            key = "unit" if name == "units" else name
            found[key] = [f"{c}={v:g}" if isinstance(v, float) else f"{c}={v}" for c, v in value.items()]
        else:
            found[name] = value
    return found


@lru_cache(maxsize=1)
def _whole(path: str, changed: int, options: str) -> Recording:
    """Recording without its window; kept for the next zoom."""
    return read_recording(path, **reading_arguments(json.loads(options)))


def recording_course(toml: str, span: tuple[float, float] | None, label: str) -> dict[str, Any]:
    """Figure of a recording, decimated to what a screen shows of `span` in s, with the window marked.

    Raises
    ------
    BrightgreyError
        If it cannot be read with its options.
    """
    (file, *_), options = load_recording_toml(toml)
    window = options.pop("window", None)
    recording = _whole(str(file), file.stat().st_mtime_ns, json.dumps(options))
    return channel_figure(recording, span, window, label)


def check_files(tomls: Sequence[str], labels: Mapping[str, str]) -> dict[str, Any]:
    """Results of all checks of recordings, the gravest first.

    Parameters
    ----------
    tomls : sequence of str
        Each names one recording.
    labels : mapping of str to str
        Name for people by the name of each file.
    """
    recordings: list[Recording] = []
    problems = []
    for path in tomls:
        try:
            recordings += read_recordings(path)
        except BrightgreyError as error:
            problems.append(str(error))
    if problems:
        return {"grade": "stop", "problems": [_with_labels(p, labels) for p in problems], "results": []}
    found = check(recordings)
    results = [
        {
            "grade": r.grade,
            "check": r.check,
            "file": r.recording,
            "recording": labels.get(r.recording, r.recording),
            "figure": r.figure,
            "threshold": r.threshold,
            "sentence": _with_labels(r.sentence, labels),
            "remedy": dict(r.remedy),
        }
        for r in found.results
    ]
    return {"grade": found.grade, "problems": [], "results": results}


def _with_labels(text: str, labels: Mapping[str, str]) -> str:
    for file, label in labels.items():
        text = text.replace(file, label)
    return text


def apply_remedy(options: Mapping[str, Any], remedy: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a recording after a remedy, as ``brightgrey check --fix`` writes them."""
    content = tomllib.loads(recording_toml(["x"], options, remedy))
    return {name: value for name, value in content.items() if name != "recording"}
