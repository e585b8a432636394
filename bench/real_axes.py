"""Real axes with the function set `drive`: what is found with nothing given, and what it predicts.

    python bench/real_axes.py [--only emps|mte360|pendulum|predictions|all] [--save]

Recordings lie outside of the repository (support/measured.py). The speed of the second cart of MTE360 is never fitted.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from brightgrey import Recording, identify
from brightgrey.api.result import Result
from brightgrey.api.to_si import identification_task
from brightgrey.arrays import Array
from brightgrey.estimation import predict
from brightgrey.estimation.diagnostics.instability import parting_time
from brightgrey.kit import function_set
from brightgrey.search.fitting.structure_fit import Options, fit_multistart
from brightgrey.simulation import Settings
from support.measured import emps_recording, mte360_recording, pendulum_recordings, two_mass_recordings
from support.results import Table, arguments, publish

PAPER_MTE360 = "two_mass+coulomb+viscous+stribeck+gravity"
FRICTION_AT_BOTH = "two_mass+coulomb+viscous+gravity+coulomb@2+viscous@2"
EMPS_PAPER = "one_mass+coulomb+viscous+gravity"
PENDULUM = "one_mass+coulomb+viscous+gravity+pendulum"
PUBLISHED = {"J1": 0.0626, "G": 1.003, "f_v": 0.0471, "M_C": 0.289}


def fit_percent(measured: Array, simulated: Array) -> float:
    """100 (1 - |y - yhat| / |y - mean y|)."""
    return float(100.0 * (1.0 - np.linalg.norm(measured - simulated) / np.linalg.norm(measured - measured.mean())))


def found(name: str, recordings: Sequence[Recording]) -> list[Table]:
    """Search with nothing given: structure, verdicts and time."""
    began, cpu = time.perf_counter(), time.process_time()
    result = identify(list(recordings), workers=2)
    wall, spent = time.perf_counter() - began, time.process_time() - cpu
    assert result.evidence is not None
    certificate = result.evidence.certificate
    verdicts = {
        kind: [c.effect for c in result.evidence.cards if c.verdict == kind] for kind in ("needed", "not needed")
    }
    model = result.model
    (output,) = model.fit.train.values()
    row = [
        name,
        f"`{model.structure}`",
        f"{output.fit_percent:.1f}",
        f"{output.rmse:.4g}",
        ", ".join(certificate.offered) or "none",
        ", ".join(verdicts["needed"]),
        ", ".join(verdicts["not needed"]) or "none",
        f"{certificate.fitted}",
        f"{wall:.0f} / {spent:.0f}",
    ]
    columns = [
        "recording",
        "first structure",
        "fit in %",
        "RMSE",
        "offered",
        "needed",
        "not needed",
        "fits",
        "s / CPU s",
    ]
    values = [[n, _shown(p.value, p.std), p.unit] for n, p in model.parameters.items()]
    return [
        Table(f"{name}, nothing given", columns, [row]),
        Table(f"{name}, parameters", ["parameter", "estimate", "unit"], values),
    ]


def _shown(value: float, std: float | None) -> str:
    return f"{value:.4g}" if std is None else f"{value:.4g} ± {1.96 * std:.2g}"


def mte360_predictions() -> Table:
    """Each recording predicted from the two others, and the second cart's speed, which is never fitted."""
    recordings = two_mass_recordings()
    rows = []
    for structure in (PAPER_MTE360, FRICTION_AT_BOTH):
        joint = identify(list(recordings.values()), structure, workers=2)
        left_out, second = [], []
        for name in recordings:
            others = [r for key, r in recordings.items() if key != name]
            left_out.append(_predicted(identify(others, structure, workers=2), recordings[name], "v1"))
            second.append(_predicted(joint, mte360_recording(_file(name), "v2"), "v2"))
        (output,) = joint.model.fit.train.values()
        cells = [", ".join(f"{x:.1f}" for x in column) for column in (left_out, second)]
        rows.append([f"`{structure}`", f"{output.fit_percent:.1f}", *cells])
    columns = ["structure", "fit of all in %", "left out, predicted from the others, in %", "second cart, in %"]
    return Table("MTE360: square, sine 1 Hz, sine 3 Hz", columns, rows)


def _file(name: str) -> str:
    return "velocity_response_" + {"square": "1_5", "sine 1 Hz": "sine_1", "sine 3 Hz": "sine_3"}[name]


def _predicted(result: Result, recording: Recording, column: str) -> float:
    """Fit of a recording that was not fitted, in percent; the second cart's speed is measured at mass 2."""
    outputs = tuple(replace(s, mass=2 if column == "v2" else 1) for s in recording.outputs)
    measured = replace(recording, outputs=outputs)
    values = {name: e.value for name, e in result.fit.estimates.items()}
    simulated = predict(result.fit.structure, values, measured, result.fit.settings)
    return fit_percent(recording.y[0], simulated[0])


def emps_halves() -> Table:
    """RMSE of each half of EMPS from the other, with and without friction that depends on the direction."""
    whole = emps_recording()
    half = whole.samples // 2
    parts = [_part(whole, 0, half), _part(whole, half, whole.samples)]
    rows = []
    for structure in (EMPS_PAPER, f"{EMPS_PAPER}+directional_viscous"):
        result = identify(whole, structure, workers=2)
        (output,) = result.model.fit.train.values()
        cells = [f"{1e3 * output.rmse:.2f}"]
        for fitted, unseen in ((parts[0], parts[1]), (parts[1], parts[0])):
            own = identify(fitted, structure, test=unseen, workers=2)
            (train,), (test,) = own.model.fit.train.values(), (own.model.fit.test or {}).values()
            cells += [f"{1e3 * train.rmse:.2f}", f"{1e3 * test.rmse:.2f}"]
        p = result.model.parameters
        ratio = f"{p['f_d'].value / p['f_v'].value:.3f}" if "f_d" in p else ""
        rows.append([f"`{structure}`", *cells, ratio])
    columns = ["structure", "whole", "first half", "predicts second", "second half", "predicts first", "f_d / f_v"]
    return Table("EMPS, RMSE in mm in open loop", columns, rows)


def emps_drift() -> Table:
    """RMSE of EMPS with a drift of the torque as a nuisance and without it, as a search sees it."""
    recording = emps_recording()
    rows = []
    for name in (EMPS_PAPER, f"{EMPS_PAPER}+directional_viscous"):
        structure, cells = function_set().parse(name), []
        for drift in (False, True):
            task = replace(identification_task([recording], None, {}, {}, None), drift=drift)
            fitted = fit_multistart(task, structure, Options(fresh=4, patience=0), 0)
            weight = task.problem(structure).weights[0]
            cells.append(f"{1e3 * np.sqrt(fitted.cost / recording.samples) / weight:.2f}")
        rows.append([f"`{name}`", *cells])
    return Table("EMPS, RMSE in mm with a drift as a nuisance", ["structure", "without a drift", "with it"], rows)


def _part(recording: Recording, first: int, last: int) -> Recording:
    rows = slice(first, last)
    return replace(recording, t=recording.t[rows], u=recording.u[rows], y=recording.y[:, rows])


def pendulum() -> Table:
    """Parameters of the pendulum from each of its records, and what they predict of the first 2 s of all."""
    recordings = pendulum_recordings()
    begins = {name: _part(r, 0, min(int(2.0 / r.dt), r.samples)) for name, r in recordings.items()}
    rows = []
    for name, r in recordings.items():
        result = identify(_part(r, 0, min(int(4.0 / r.dt), r.samples)), PENDULUM, workers=2)
        p, fitted = result.model.parameters, result.fit
        values = {key: e.value for key, e in fitted.estimates.items()}
        cells = [_shown(p[key].value, p[key].std) for key in ("J1", "G", "k", "M_C")]
        rows.append([f"`{name}`", *cells, *_pendulum_predictions(values, fitted.settings, begins, recordings)])
    published = {**PUBLISHED, "M_G": 0.0759, "k": 1.0, "phi_0": 0.0}
    shown = [str(published[key]) for key in ("J1", "G", "k", "M_C")]
    rows.append(["published", *shown, *_pendulum_predictions(published, fitted.settings, begins, recordings)])
    columns = ["fitted on the first 4 s of", "J1", "G", "k", "M_C"]
    columns += ["G / J1", "first 2 s of each, fit in %", "unstable from"]
    return Table("Pendulum", columns, rows)


def _pendulum_predictions(
    values: dict[str, float], settings: Settings, begins: dict[str, Recording], recordings: dict[str, Recording]
) -> list[str]:
    """Ratio G / J, fit of the beginning of each record, and the time from which the motion of each is unstable."""
    structure = function_set().parse(PENDULUM)
    fits = [fit_percent(r.y[0], predict(structure, values, r, settings)[0]) for r in begins.values()]
    times = [parting_time(structure, values, r, settings) for r in recordings.values()]
    unstable = ["-" if time is None else f"{time:.1f} s" for time in times]
    return [f"{values['G'] / values['J1']:.1f}", ", ".join(f"{x:.1f}" for x in fits), ", ".join(unstable)]


JOBS = {
    "emps": lambda: found("EMPS", [emps_recording()]),
    "mte360": lambda: found("MTE360", list(two_mass_recordings().values())),
    "pendulum": lambda: [pendulum()],
    "predictions": lambda: [mte360_predictions(), emps_halves(), emps_drift()],
}


def main() -> None:
    """Run the jobs that are asked for."""
    parser = arguments(__doc__)
    parser.add_argument("--only", choices=(*JOBS, "all"), default="all")
    options = parser.parse_args()
    for name in JOBS if options.only == "all" else (options.only,):
        publish("real-axes", JOBS[name](), to_file=options.save)


if __name__ == "__main__":
    main()
