"""Export to python-control: a module with the model as NonlinearIOSystem and, linearised, as StateSpace."""

from __future__ import annotations

import importlib.util
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from brightgrey.effects import Element
from brightgrey.exports.expressions.languages import PYTHON, assignments, number_literal
from brightgrey.exports.expressions.trace import traced
from brightgrey.exports.external_tools import import_library
from brightgrey.exports.numeric_model import NumericModel
from brightgrey.exports.registry import Exporter, Verified
from brightgrey.exports.targets.c99 import NAME, engine, filled, header_words
from brightgrey.exports.targets.fmu import names_of
from brightgrey.exports.verification import VerificationRun

__all__ = ["EXPORTER"]

FILE = f"{NAME}_control.py"


def files_of(scheme: NumericModel) -> dict[str, bytes]:
    """File ``drive_control.py``."""
    low = scheme.low
    names = names_of(scheme)
    whole, part = scheme.delay
    limited = [_limited(scheme, b) for b in range(len(scheme.limited))]
    words = header_words(scheme) | {
        "dead_time": number_literal((whole + part) * scheme.dt),
        "hold_name": scheme.hold,
        "state_names": _list(scheme.system.state_names),
        "signal_names": f"{names[0]!r}, {names[1:]!r}",
        "input_factor": number_literal(scheme.input_factor),
        "output_factors": _list([o.factor for o in scheme.outputs]),
        "rows": _list([o.row for o in scheme.outputs]),
        "differenced": _list([o.differenced for o in scheme.outputs]),
        "rest": _list([float(state.at_rest == "input") for state in scheme.system.states]),
        "A": _list(low.A[:, :, 0]),
        "B": _list(low.B[:, 0]),
        "C0": _list(low.c[:, 0]),
        "G": _list(low.G[:, :, 0]),
        "H": _list(low.H[:, :, 0]),
        "K": _list(low.through[:, 0]),
        "limited": f"[{', '.join(limited)}]",
        "scale": number_literal(scheme.settings.speed_scale),
        "dispatch": "\n".join(_call(i, k) for i, (_, k) in enumerate(low.smooth)) or "    # none",
        "laws": "\n\n\n".join(_law(i, element) for i, (element, _) in enumerate(low.smooth)) or "# No law.",
    }
    return {FILE: filled(engine("control.py.in"), words).encode()}


def _limited(scheme: NumericModel, b: int) -> str:
    state, low, high = scheme.limits(b)
    column = np.asarray(scheme.limited[b].G).reshape(-1)
    limits = f"{number_literal(low)}, {number_literal(high)}"
    return f"({state}, {limits}, np.array({_list(scheme.rate(b))}), np.array({_list(column)}))"


def _list(values: Any) -> str:
    """Python literal; floats read back exactly."""
    return repr(np.asarray(values).tolist())


def _law(i: int, element: Element) -> str:
    phi, slopes = traced(element.law, ("z",))
    lines = assignments({"force": phi, "slope": slopes[0]}, PYTHON)
    values = [
        f"{name} = {number_literal(float(np.ravel(p)[0]))}"
        for name, p in zip(element.law.parameters, element.p, strict=True)
        if any(name in line for line in lines)
    ]
    body = "\n".join(f"    {line}" for line in [*values, *lines])
    return f'def _law_{i}(z):\n    """{element.name}: force and slope."""\n{body}\n    return force, slope'


def _call(i: int, k: int) -> str:
    return f"    f, d = _law_{i}(z[{k}])\n    force[{k}] += f\n    slope[{k}] += d"


def verify(folder: Path, scheme: NumericModel, trial: VerificationRun) -> Verified:
    """Simulate by python-control, with its solver."""
    import_library("control", "control")
    spec = importlib.util.spec_from_file_location("brightgrey_exported_drive", folder / FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        spec.loader.exec_module(module)
        y = module.simulate(trial.u, trial.x0)
    return Verified(np.asarray(y), "python-control, its own solver")


EXPORTER = Exporter("python-control objects: NonlinearIOSystem and StateSpace", 2e-4, files_of, verify)
