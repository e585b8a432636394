"""Models and recordings for reports, made without an identification."""

import numpy as np

from brightgrey.kit import PAPER, assemble
from brightgrey.model.model import Model
from brightgrey.model.trace import Trace
from brightgrey.recordings.units.signals import Units
from brightgrey.simulation import response

DT, F_TANH, TOP = 1e-3, 10.0, 40.0
VALUES = {
    "J1": 0.012,
    "J2": 0.008,
    "c1": 75.0,
    "d1": 0.036,
    "M_C": 0.4,
    "f_v": 0.002,
    "M_S": 0.6,
    "omega_S": 2.5,
    "M_G": -0.3,
    "alpha": 0.02,
    "T_1": 1e-3,
    "T_d": 1.5e-3,
}
FULL = "two_mass+coulomb+viscous+stribeck+gravity+backlash+current_control+delay"


def model_of(structure=FULL, *, relative=0.1, units=("N m", "rad"), kind="velocity"):
    """Model with intervals from value / (1 + relative) to value (1 + relative)."""
    shown = Units(*units)
    declared = PAPER.check(PAPER.parse(structure)).parameters
    parameters, bounds = {}, {}
    for name, parameter in declared.items():
        unit, factor = shown.of(parameter.dimension)
        value = VALUES[name] * factor
        low, high = sorted((value / (1 + relative), value * (1 + relative)))
        parameters[name] = {"value": value, "unit": unit, "std": 0.0, "ci95": [low, high], "at_bound": None}
        bounds[name] = (
            sorted((value / 100, 100 * value)) if parameter.scale == "log" else [-10 * abs(value), 10 * abs(value)]
        )
    (f_unit, f_factor), (v_unit, v_factor) = shown.of((0, -1, 1)), shown.of((0, 1, -1))
    signals = [("torque", "input", units[0]), ("motion", kind, f"{units[1]}/s" if kind == "velocity" else units[1])]
    values = {name: VALUES[name] for name in declared}
    states = assemble(PAPER.parse(structure), values, F_TANH).states
    rest = {s.name: {"value": 0.0, "unit": shown.of(s.dimension)[0]} for s in states}
    return Model.check(
        {
            "schema": "brightgrey/model/1",
            "structure": structure.split("+"),
            "parameters": parameters,
            "signals": [
                {"name": n, "kind": k, "unit": u, "gain": 1.0, "sampling_time": DT, "hold": "linear"}
                for n, k, u in signals
            ],
            "settings": {
                "f_tanh": F_TANH * f_factor,
                "f_tanh_unit": f_unit,
                "speed_scale": TOP * v_factor,
                "speed_scale_unit": v_unit,
                "level": "accurate",
                "substeps": 1,
                "hold": "linear",
                "sampling_time": DT,
                "bounds": bounds,
                "fixed": {},
            },
            "initial_state": [{"recording": "a.csv", "state": rest}],
            "fit": {"train": {"motion": {"rss": 3.0, "rmse": 0.05, "fit_percent": 99.5}}, "test": None},
            "criterion": {"name": "BIC", "value": -123.4},
            "evidence": None,
            "ties": None,
            "outcome": {"kind": "converged", "text": "made for a test"},
            "seed": 0,
            "version": "0",
        }
    )


def independent(model):
    """Correlation of errors that have nothing to do with each other."""
    names = list(model.parameters)
    return {(a, b): float(a == b) for a in names for b in names}


def trace_of(model, *, samples=2000, noise=0.02, name="a.csv", test=False):
    """Motion under a torque that reverses and shakes, as the model moves, with noise; in the model's units."""
    rng = np.random.default_rng(1)
    t = DT * np.arange(samples)
    u = 4.0 * np.sin(2 * np.pi * 1.5 * t) + 2.0 * np.sign(np.sin(2 * np.pi * 6.7 * t)) + 0.5 * rng.normal(size=samples)
    u[:20] = 0.0
    settings = model.settings_si()
    kinds = [s.kind for s in model.outputs]
    system = assemble(model.structure, model.values_si(), settings.f_tanh, kinds)
    y = response(system, u, DT, system.rest(), settings).y[:, :, 0]
    y = y * np.array([s.factor for s in model.outputs])[:, None]
    measured = y + noise * y.std() * rng.normal(size=y.shape)
    return Trace(name, t, u * model.input.factor, measured, y, model.input, model.outputs, test)
