"""What the desk does with the structures of a run: motion in any detail, and two structures side by side."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from brightgrey.api.written_run import recording_of_run, task_of_run
from brightgrey.app.plots.motion import beside_figure, motion_figure
from brightgrey.estimation import predict
from brightgrey.estimation.problem.simulation_error import predict_many
from brightgrey.kit import Structure
from brightgrey.kit.in_words import effect_heading, structure_in_words
from brightgrey.model.model import Model, load_model
from brightgrey.model.run_record import RUN_FILE, RunRecord, load_run_record
from brightgrey.model.trace import Trace, pooled_fit
from brightgrey.numerics.number_format import significant
from brightgrey.recordings import Recording
from brightgrey.recordings.recording_toml import read_recordings
from brightgrey.search import IdentificationTask

__all__ = ["beside_course", "beside_tables", "result_course", "run_structures", "traces_of_fit"]


@dataclass(frozen=True)
class _OfferPolicy:
    """Offer of structures to compare with."""

    most: int = 24  #: Structures of a run that are offered beside those that tie with the best one, best first.


OFFER = _OfferPolicy()

STATUS_WORDS = {
    "minimal": "one of the simplest that explain the recording",
    "adequate": "explains the recording, with more than it needs",
    "refuted": "does not explain the recording",
    "undecided": "not decided",
    "rival": "fits as well, with an effect in the place of another",
    "steady": "lacks what helps in some parts of the recording only",
}


@dataclass(frozen=True)
class _OpenedRun:
    """Run with its recordings."""

    record: RunRecord
    model: Model
    recordings: tuple[Recording, ...]
    task: IdentificationTask


def traces_of_fit(task: IdentificationTask, structure: Structure, best: Mapping[str, float]) -> Iterator[Trace]:
    """Recordings of a task beside a structure at its best values, nuisances included, simulated as in the search."""
    problem = task.problem(structure)
    names = (*structure.parameters, *(part.name for part in problem.nuisances if part.name in best))
    values = {name: np.array([best[name]]) for name in names}
    known = all(part.name in values for part in problem.unknown_initial)
    settings = replace(task.settings, level="accurate")
    for recording, state in zip(task.recordings, problem.initial_states, strict=True):
        y = predict_many(structure, values, recording, settings, initial_state=state if known else None)
        yield Trace.of(recording, y[:, :, 0])


@lru_cache(maxsize=1)
def _run_with_recordings(folder: str, changed: int) -> _OpenedRun:
    """Content of a run of a project; kept for the next question."""
    run = Path(folder)
    record = load_run_record(run)
    recordings = tuple(recording_of_run(part, run, run.parents[1]) for part in record.recordings)
    return _OpenedRun(record, load_model(run / "model.json"), recordings, task_of_run(record, recordings))


@lru_cache(maxsize=3)
def _simulated(folder: str, changed: int, structure: str) -> tuple[Trace, ...]:
    """Recordings of a run beside one of its structures at its best values, simulated as in the search."""
    run = _run_with_recordings(folder, changed)
    return tuple(traces_of_fit(run.task, Structure.parse(structure), _values(run.record, structure)))


@lru_cache(maxsize=1)
def _motion_found(folder: str, changed: int, test: str | None) -> tuple[Trace, ...]:
    """Recordings beside the found model, the test recording last."""
    run = _run_with_recordings(folder, changed)
    several = [(r, False) for r in run.recordings] + ([(read_recordings(test)[0], True)] if test else [])
    values, settings = run.model.values_si(), run.model.settings_si()
    return tuple(
        Trace.of(r, predict(run.model.structure, values, r, replace(settings, hold=r.hold)), test=is_test)
        for r, is_test in several
    )


def _written_at(folder: str) -> int:
    return (Path(folder) / RUN_FILE).stat().st_mtime_ns


def _values(record: RunRecord, structure: str) -> Mapping[str, float]:
    return next(fitted.values for fitted in record.fits if fitted.structure == structure)


def run_structures(folder: str) -> list[dict[str, str]]:
    """Structures of a run whose best values are known, the best first: name, words, status in words, and fit.

    That of the model comes first, then those that tie with it. The ranking lacks rivals: their fit is shown beside the
    best one's.
    """
    status = {fitted.structure: fitted.status for fitted in load_run_record(folder).fits}
    with (Path(folder) / "ranking.csv").open(encoding="utf-8", newline="") as file:
        fits = {row["structure"]: f"fit {float(row['fit_percent']):.2f} %" for row in csv.DictReader(file)}
    tied = [name for k, (name, said) in enumerate(status.items()) if k == 0 or said in ("minimal", "rival")]
    others = [name for name in fits if name in status and name not in tied]
    return [
        {
            "name": name,
            "words": structure_in_words(Structure.parse(name)),
            "status": STATUS_WORDS.get(status[name], ""),
            "fit": fits.get(name, ""),
        }
        for name in (*tied, *others[: OFFER.most])
    ]


def result_course(folder: str, test: str | None, number: int, span: tuple[float, float] | None) -> dict[str, Any]:
    """Figure of measured and simulated motion, decimated to what a screen shows of `span` in s.

    Parameters
    ----------
    folder : str
        Of the run.
    test : str or None
        Path of the recording.toml of the test recording.
    number : int
        Of the figure in the report: recordings and their outputs in order.
    span : (float, float) or None

    Raises
    ------
    BrightgreyError
        If the recordings of the run are no longer what they were.
    """
    traces = _motion_found(folder, _written_at(folder), test)
    at, row = _place(traces, number)
    return motion_figure(traces[at], row, span)


def beside_course(folder: str, one: str, other: str, number: int, span: tuple[float, float] | None) -> dict[str, Any]:
    """Figure of two structures over a recording, with both residuals; arguments as for `result_course`."""
    both = [_simulated(folder, _written_at(folder), name) for name in (one, other)]
    at, row = _place(both[0], number)
    return beside_figure(both[0][at], both[1][at], row, span)


def _place(traces: Sequence[Trace], number: int) -> tuple[int, int]:
    """Recording and output of a figure."""
    return [(at, row) for at, trace in enumerate(traces) for row in range(len(trace.outputs))][number]


def beside_tables(folder: str, one: str, other: str) -> dict[str, Any]:
    """Effects, parameters and fits of two structures of a run, as texts; each fit has a figure.

    Raises
    ------
    BrightgreyError
        If the recordings of the run are no longer what they were.
    """
    changed = _written_at(folder)
    run = _run_with_recordings(folder, changed)
    both = [_simulated(folder, changed, name) for name in (one, other)]
    status = {fitted.structure: fitted.status for fitted in run.record.fits}
    return {
        "status": [STATUS_WORDS.get(status[name], "") for name in (one, other)],
        "effects": _effect_rows(Structure.parse(one), Structure.parse(other), _all_verdicts(run.model)),
        "parameters": _value_rows(run, one, other),
        "fits": _fit_texts(*both),
    }


def _all_verdicts(model: Model) -> dict[str, str]:
    """Verdicts on all effects, those that were not offered included."""
    return {**(model.certificate.held_back if model.certificate else {}), **(model.evidence or {})}


def _effect_rows(one: Structure, other: Structure, verdicts: Mapping[str, str]) -> list[tuple[str, str, str, str]]:
    """Rows of the effects that either has: name, in the one, in the other, verdict of the run."""
    rows = [("Number of masses", str(one.masses), str(other.masses), "")]
    for placed in dict.fromkeys((*one.placed, *other.placed)):
        if not placed.effect.masses:
            a, b = ("yes" if placed in s.placed else "no" for s in (one, other))
            rows.append((effect_heading(placed), a, b, verdicts.get(str(placed), "")))
    return rows


def _value_rows(run: _OpenedRun, one: str, other: str) -> list[tuple[str, str, str, str, str, str]]:
    """Rows of the parameters: name, values of both, unit, change in %, meaning."""
    units, rows = run.model.units, []
    values = [_values(run.record, name) for name in (one, other)]
    declared = {**Structure.parse(one).parameters, **Structure.parse(other).parameters}
    for name, parameter in declared.items():
        unit, factor = units.of(parameter.dimension)
        shown = [factor * v[name] if name in v else None for v in values]
        known = [value for value in shown if value is not None]
        change = ""
        if len(known) == 2 and known[0]:
            percent = round(100.0 * (known[1] / known[0] - 1.0), 1)
            change = f"{percent:+.1f}" if percent else "0"
        texts = ["" if value is None else significant(value) for value in shown]
        rows.append((name, texts[0], texts[1], unit, change, parameter.about))
    return rows


def _fit_texts(one: Sequence[Trace], other: Sequence[Trace]) -> list[tuple[str, ...]]:
    """Rows of recordings and outputs: fits in %, RMS of the residuals, unit."""
    rows = []
    for a, b in zip(one, other, strict=True):
        for signal in a.outputs:
            fits = [pooled_fit([trace])[signal.name] for trace in (a, b)]
            percent = ["diverges" if f.fit_percent is None else f"{f.fit_percent:.2f}" for f in fits]
            rms = ["" if f.rmse is None else significant(f.rmse) for f in fits]
            rows.append((a.name, signal.name, *percent, *rms, signal.unit))
    return rows
