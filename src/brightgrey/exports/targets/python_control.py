"""Export to python-control: a module with the model as NonlinearIOSystem and, linearised, as StateSpace."""

from __future__ import annotations

import importlib.util
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from brightgrey.effects import Element
from brightgrey.exports.expressions.languages import PYTHON, law_statements, number_literal
from brightgrey.exports.external_tools import import_library
from brightgrey.exports.numeric_model import NumericModel
from brightgrey.exports.registry import Exporter
from brightgrey.exports.source_text import NAME, fill_words, header_words, signal_names, template
from brightgrey.exports.verification import VerificationRun, Verified

__all__ = ["EXPORTER"]

_MODULE_FILE = f"{NAME}_control.py"
_PYTHON_LAW_CALL = "    f, d = _law_{law}(z[{port}])\n    force[{port}] += f\n    slope[{port}] += d"


def files_of(numeric: NumericModel) -> dict[str, bytes]:
    """File ``drive_control.py``; its solver cannot stop a mass, so that dry friction has a smoothed sign."""
    numeric = numeric.smoothed()
    arrays, smooth = numeric.arrays(), numeric.low.smooth
    names = signal_names(numeric)
    limited = [_saturated_integrator(numeric, b) for b in range(len(numeric.limited))]
    words = header_words(numeric) | {
        "dead_time": number_literal(sum(numeric.delay) * numeric.dt),
        "hold_name": numeric.hold,
        "state_names": _literal(numeric.system.state_names),
        "signal_names": f"{names[0]!r}, {names[1:]!r}",
        "input_factor": number_literal(numeric.input_factor),
        "output_factors": _literal(arrays["output_factor"]),
        "rows": _literal(arrays["row"]),
        "C0": _literal(arrays["c"]),
        **{name: _literal(arrays[name]) for name in ("differenced", "rest", "A", "B", "G", "H", "K")},
        "limited": f"[{', '.join(limited)}]",
        "scale": number_literal(numeric.settings.speed_scale),
        "dispatch": "\n".join(_PYTHON_LAW_CALL.format(law=i, port=k) for i, (_, k) in enumerate(smooth))
        or "    # none",
        "laws": "\n\n\n".join(_law_definition(i, element) for i, (element, _) in enumerate(smooth)) or "# No law.",
    }
    return {_MODULE_FILE: fill_words(template("control.py.in"), words).encode()}


def _saturated_integrator(numeric: NumericModel, b: int) -> str:
    """Python literal of limited state b: state, limits, row of its free rate, column it acts by."""
    state, low, high = numeric.limits(b)
    limits = f"{number_literal(low)}, {number_literal(high)}"
    return f"({state}, {limits}, np.array({_literal(numeric.rate(b))}), np.array({_literal(numeric.column(b))}))"


def _literal(values: Any) -> str:
    """Python literal of an array; floats read back exactly."""
    return repr(np.asarray(values).tolist())


def _law_definition(i: int, element: Element) -> str:
    """Python function of a law, from the declared one."""
    body = "\n".join(f"    {line}" for line in law_statements(element, PYTHON))
    return f'def _law_{i}(z):\n    """{element.name}: force and slope."""\n{body}\n    return force, slope'


def verify(folder: Path, numeric: NumericModel, run: VerificationRun) -> Verified:
    """Simulate by python-control, with its solver."""
    import_library("control", "control")
    spec = importlib.util.spec_from_file_location("brightgrey_exported_drive", folder / _MODULE_FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        spec.loader.exec_module(module)
        y = module.simulate(run.u, run.x0)
    return Verified(np.asarray(y), "python-control, its own solver")


EXPORTER = Exporter(
    "python-control objects: NonlinearIOSystem and StateSpace", 2e-4, files_of, verify, stops_masses=False
)
