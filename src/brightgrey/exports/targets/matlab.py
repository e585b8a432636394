"""Export to MATLAB and GNU Octave: matrices and tables in a MAT file, and a function that simulates with them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat, savemat

from brightgrey.effects import Element
from brightgrey.exports.expressions.languages import MATLAB, assignments, number_literal
from brightgrey.exports.expressions.trace import traced
from brightgrey.exports.external_tools import program, run_program
from brightgrey.exports.numeric_model import NumericModel, propagator_tables
from brightgrey.exports.registry import Exporter, Verified
from brightgrey.exports.targets.c99 import NAME, engine, filled, header_words
from brightgrey.exports.verification import VerificationRun

__all__ = ["EXPORTER"]

_RUN = f"t = load('trial.mat'); y = {NAME}(t.u, t.x0); save('-v7', 'response.mat', 'y')"


def files_of(scheme: NumericModel) -> dict[str, bytes]:
    """Files ``drive.m`` and ``drive.mat``."""
    laws = "\n\n".join(_law(i, element) for i, (element, _) in enumerate(scheme.low.smooth))
    words = header_words(scheme) | {
        "dispatch": "\n".join(_call(i, k) for i, (_, k) in enumerate(scheme.low.smooth)) or "  % none",
        "laws": laws,
    }
    content = io.BytesIO()
    savemat(content, _numbers(scheme), oned_as="column")  # type: ignore[arg-type]  # it takes streams too
    head = b"MATLAB 5.0 MAT-file, written by brightgrey".ljust(116)  # scipy writes the time of day there
    return {f"{NAME}.m": filled(engine("engine.m"), words).encode(), f"{NAME}.mat": head + content.getvalue()[116:]}


def _law(i: int, element: Element) -> str:
    phi, slopes = traced(element.law, ("z",))
    lines = assignments({"force": phi, "slope": slopes[0]}, MATLAB)
    values = [
        f"{name} = {number_literal(float(np.ravel(p)[0]))};"
        for name, p in zip(element.law.parameters, element.p, strict=True)
        if any(name in line for line in lines)
    ]
    body = "\n".join(f"  {line.rstrip(';')};" for line in [*values, *lines])
    return f"function [force, slope] = law_{i}(z)\n% {element.name}\n{body}\nend"


def _call(i: int, channel: int) -> str:
    k = channel + 1
    return f"  [f, d] = law_{i}(z({k}));\n  force({k}) = force({k}) + f;\n  slope({k}) = slope({k}) + d;"


def _numbers(scheme: NumericModel) -> dict[str, Any]:
    """Content of the MAT file."""
    low, table, limits = scheme.low, propagator_tables(scheme), len(scheme.limited)
    model = scheme.model
    ends = [scheme.limits(b) for b in range(limits)]
    whole, part = scheme.delay
    scale = scheme.settings.speed_scale
    n, m = scheme.n, scheme.m
    system: dict[str, Any] = {
        "A": low.A[:, :, 0],
        "B": low.B[:, :1],
        "c": low.c[:, :1],
        "C": _rows(scheme)[0],
        "D": _rows(scheme)[1],
        "G": low.G[:, :, 0].T,
        "H": low.H[:, :, 0],
        "K": low.through[:, :1],
        "rate": np.array([scheme.rate(b) for b in range(limits)]).reshape(limits, n),
        "column": np.array([np.asarray(e.G).reshape(-1) for e in scheme.limited]).reshape(limits, n).T,
        "limited": np.array([e[0] + 1.0 for e in ends]),
        "low": np.array([e[1] for e in ends]),
        "high": np.array([e[2] for e in ends]),
        "gain": np.abs(low.G[:, :, 0]).max(axis=1, initial=0.0),
        "rest": np.array([float(state.at_rest == "input") for state in scheme.system.states]),
    }
    scalars: dict[str, float] = {
        "n": n,
        "channels": m,
        "limits": limits,
        "levels": scheme.tolerance.ticks,
        "ticks": 2**scheme.tolerance.ticks,
        "bases": scheme.base_steps,
        "newton": scheme.tolerance.newton,
        "error": scheme.tolerance.error * scale,
        "change": scheme.tolerance.change * scale,
        "dt": scheme.dt,
        "whole": whole,
        "shift": part,
        "linear": scheme.hold == "linear",
        "input_factor": scheme.input_factor,
    }
    outputs = {
        "row": np.array([o.row + 1.0 for o in scheme.outputs]),
        "differenced": np.array([float(o.differenced) for o in scheme.outputs]),
        "output_factor": np.array([o.factor for o in scheme.outputs]),
    }
    parameters = {
        name.replace("@", "_at_"): {"value": p.value, "unit": p.unit, "std": np.nan if p.std is None else p.std}
        for name, p in model.parameters.items()
    }
    settings = model.settings.model_dump(exclude={"bounds", "fixed"})
    return {
        **system,
        **{name: float(value) for name, value in scalars.items()},
        **outputs,
        "E": _cells(table.end),
        "T": _cells(table.third),
        "S": _cells(table.coupling),
        "parameters": parameters,
        "settings": settings,
        "structure": str(model.structure),
        "states": _cells(np.array(scheme.system.state_names)[:, None, None]),
    }


def _rows(scheme: NumericModel) -> tuple[Any, Any]:
    """C and D of the linear part, laws that are straight lines included."""
    n = scheme.n
    C, D = np.zeros((len(scheme.outputs), n)), np.zeros((len(scheme.outputs), 1))
    for i, output in enumerate(scheme.outputs):
        if output.row < n:
            C[i, output.row] = 1.0
        else:
            C[i], D[i] = scheme.low.A[output.row - n, :, 0], scheme.low.B[output.row - n, :1]
    return C, D


def _cells(array: Any) -> Any:
    """Matrices of the last two axes as a cell array over the first two."""
    cells = np.empty(array.shape[:2], object)
    for place in np.ndindex(*array.shape[:2]):
        cells[place] = array[place]
    return cells


def verify(folder: Path, scheme: NumericModel, trial: VerificationRun) -> Verified:
    """Run the function in GNU Octave."""
    octave = program("octave-cli")
    savemat(folder / "trial.mat", {"u": trial.u, "x0": trial.x0})
    run_program([octave, "--norc", "--quiet", "--eval", _RUN], folder)
    y = np.atleast_2d(loadmat(folder / "response.mat")["y"])
    return Verified(y, "GNU Octave")


EXPORTER = Exporter("MAT file with all matrices and a function for MATLAB and GNU Octave", 1e-6, files_of, verify)
