"""Export to MATLAB and GNU Octave: matrices and tables in a MAT file, and a function that simulates with them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat, savemat

from brightgrey.arrays import Array
from brightgrey.effects import Element
from brightgrey.exports.expressions.languages import MATLAB, law_statements
from brightgrey.exports.external_tools import program, run_program
from brightgrey.exports.numeric_model import NumericModel, propagator_tables
from brightgrey.exports.registry import Exporter
from brightgrey.exports.source_text import NAME, fill_words, header_words, template
from brightgrey.exports.verification import VerificationRun, Verified

__all__ = ["EXPORTER"]

_OCTAVE_SCRIPT = f"t = load('run.mat'); y = {NAME}(t.u, t.x0); save('-v7', 'response.mat', 'y')"
_MATLAB_LAW_CALL = """\
  [f, d] = law_{law}(z({port}));
  force({port}) = force({port}) + f;
  slope({port}) = slope({port}) + d;"""
_MATLAB_DRY_CALL = """
  speed = max(side({port}) * z({port}), 0);
  [f, d] = law_{law}(speed);
  force({port}) = force({port}) - side({port}) * (f + d * (side({port}) * z({port}) - speed));
  slope({port}) = slope({port}) - side({port}) ^ 2 * d;"""


def files_of(numeric: NumericModel) -> dict[str, bytes]:
    """Files ``drive.m`` and ``drive.mat``."""
    calls = [
        (_MATLAB_DRY_CALL if law.dry else _MATLAB_LAW_CALL).format(law=i, port=law.port + 1)
        for i, law in enumerate(numeric.laws)
    ]
    words = header_words(numeric) | {
        "dispatch": "\n".join(calls) or "  % none",
        "laws": "\n\n".join(_law_subfunction(i, law.element) for i, law in enumerate(numeric.laws)),
    }
    content = io.BytesIO()
    savemat(content, _mat_variables(numeric), oned_as="column")  # type: ignore[arg-type]  # it takes streams too
    head = b"MATLAB 5.0 MAT-file, written by brightgrey".ljust(116)  # scipy writes the time of day there
    return {
        f"{NAME}.m": fill_words(template("engine.m"), words).encode(),
        f"{NAME}.mat": head + content.getvalue()[116:],
    }


def _law_subfunction(i: int, element: Element) -> str:
    """MATLAB function of a law, from the declared Python function."""
    body = "\n".join(f"  {line}" for line in law_statements(element, MATLAB))
    return f"function [force, slope] = law_{i}(z)\n% {element.name}\n{body}\nend"


def _mat_variables(numeric: NumericModel) -> dict[str, Any]:
    """Variables of the MAT file; states and outputs are counted from 1."""
    a, table = numeric.arrays(), propagator_tables(numeric)
    C, D = _output_rows(numeric)
    system = {name: a[name] for name in ("A", "B", "c")}
    system |= {"C": C, "D": D, "G": a["G"].T, "H": a["H"], "K": a["K"][:, None]}
    system |= {"rate": a["rate"], "column": a["column"].T, "limited": a["limited"] + 1.0}
    system |= {"stopped": a["stopped"] + 1.0, "held": a["held"] + 1.0}
    system |= {name: a[name] for name in ("low", "high", "gain", "rest")}
    outputs = {"row": a["row"] + 1.0, "differenced": a["differenced"].astype(float)}
    model = numeric.model
    return {
        **system,
        **_scalars(numeric),
        **outputs,
        "output_factor": a["output_factor"],
        "E": _cell_array(table.end),
        "T": _cell_array(table.third),
        "S": _cell_array(table.coupling),
        "parameters": {
            name.replace("@", "_at_"): {"value": p.value, "unit": p.unit, "std": np.nan if p.std is None else p.std}
            for name, p in model.parameters.items()
        },
        "settings": model.settings.model_dump(exclude={"bounds", "fixed", "friction_width_ci95"})
        | ({"friction_width": 0.0} if numeric.low.dry else {}),
        "structure": str(model.structure),
        "states": _cell_array(np.array(numeric.system.state_names)[:, None, None]),
    }


def _scalars(numeric: NumericModel) -> dict[str, float]:
    """Sizes and settings of the simulation."""
    whole, part = numeric.delay
    numbers: dict[str, float] = {
        "n": numeric.n,
        "channels": numeric.m,
        "limits": len(numeric.limited),
        "levels": numeric.tolerance.ticks,
        "ticks": 2**numeric.tolerance.ticks,
        "bases": numeric.base_steps,
        "newton": numeric.tolerance.newton,
        "error": numeric.step_error,
        "change": numeric.step_change,
        "dt": numeric.dt,
        "whole": whole,
        "shift": part,
        "linear": numeric.hold == "linear",
        "input_factor": numeric.input_factor,
    }
    return {name: float(value) for name, value in numbers.items()}


def _output_rows(numeric: NumericModel) -> tuple[Array, Array]:
    """C and D of the linear part, laws that are straight lines included."""
    n = numeric.n
    C, D = np.zeros((len(numeric.outputs), n)), np.zeros((len(numeric.outputs), 1))
    for i, output in enumerate(numeric.outputs):
        if output.row < n:
            C[i, output.row] = 1.0
        else:
            C[i], D[i] = numeric.low.A[output.row - n, :, 0], numeric.low.B[output.row - n, :1]
    return C, D


def _cell_array(array: Any) -> Any:
    """Matrices of the last two axes as a cell array over the first two."""
    cells = np.empty(array.shape[:2], object)
    for place in np.ndindex(*array.shape[:2]):
        cells[place] = array[place]
    return cells


def verify(folder: Path, numeric: NumericModel, run: VerificationRun) -> Verified:
    """Run the function in GNU Octave."""
    octave = program("octave-cli")
    savemat(folder / "run.mat", {"u": run.u, "x0": run.x0})
    run_program([octave, "--norc", "--quiet", "--eval", _OCTAVE_SCRIPT], folder)
    y = np.atleast_2d(loadmat(folder / "response.mat")["y"])
    return Verified(y, "GNU Octave")


EXPORTER = Exporter("MAT file with all matrices and a function for MATLAB and GNU Octave", 1e-6, files_of, verify)
