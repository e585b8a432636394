"""Models made without an identification, of known and of random drives, and traces of them."""

from dataclasses import replace

import numpy as np

from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER, assemble, function_set
from brightgrey.model.model import Model
from brightgrey.model.trace import Trace
from brightgrey.recordings.units.signals import Units
from brightgrey.simulation import response
from support import drives

DT, F_TANH, TOP = 1e-3, 10.0, 40.0
VALUES = {
    **drives.VALUES,
    "M_C": 0.4,
    "f_v": 0.002,
    "omega_S": 2.5,
    "M_G": -0.3,
    "c_cubic": 2e4,
    "G": 0.5,
    "k": 1.2,
    "phi_0": 0.4,
}
FULL = "two_mass+coulomb+viscous+stribeck+gravity+backlash+current_control+delay"
KINDS = {
    "position": ("rad", "mm"),
    "velocity": ("rad/s", "mm/s"),
    "velocity-differenced": ("rad/s", "mm/s"),
    "acceleration": ("rad/s²", "mm/s²"),
}


def make_model(
    structure, parameters, outputs, units, *, dt, f_tanh, speed, hold="linear", bounds=(), actuator=1, **parts
):
    """Model of `structure`; `parameters` and `bounds` in `units`, `f_tanh` and `speed` in SI.

    `outputs` lists name, kind and unit of each output. `parts` replace whole parts of model.json.
    """
    v_unit, v_factor = units.of((0, 1, -1))
    signals = [("torque", "input", units.input), *outputs]
    data = {
        "schema": "brightgrey/model/2",
        "structure": structure.split("+"),
        "parameters": parameters,
        "signals": [
            {"name": n, "kind": k, "unit": u, "gain": 1.0, "sampling_time": dt, "hold": hold}
            | {"mass": actuator if k == "input" else 1}
            for n, k, u in signals
        ],
        "settings": {
            "friction_width": v_factor / f_tanh,
            "friction_width_unit": v_unit,
            "speed_scale": speed * v_factor,
            "speed_scale_unit": v_unit,
            "level": "accurate",
            "substeps": 1,
            "hold": hold,
            "sampling_time": dt,
            "bounds": dict(bounds),
            "fixed": {},
        },
        "initial_state": [],
        "fit": {"train": {}, "test": None},
        "criterion": None,
        "evidence": None,
        "ties": None,
        "certificate": None,
        "outcome": {"kind": "converged", "text": "made for a test"},
        "seed": 0,
        "version": "0",
    }
    return Model.check(data | parts)


def model_with_intervals(structure=FULL, *, relative=0.1, units=("N m", "rad"), kind="velocity"):
    """Model of the known drive with intervals from value / (1 + relative) to value (1 + relative), at rest at first."""
    shown = Units(*units)
    parsed = function_set().check(function_set().parse(structure))
    parameters, bounds = {}, {}
    for name, parameter in parsed.parameters.items():
        unit, factor = shown.of(parameter.dimension)
        value = VALUES[name] * factor
        low, high = sorted((value / (1 + relative), value * (1 + relative)))
        parameters[name] = {"value": value, "unit": unit, "std": 0.0, "ci95": [low, high], "at_bound": None}
        positive = sorted((value / 100, 100 * value))
        bounds[name] = positive if parameter.scale == "log" else [-10 * abs(value), 10 * abs(value)]
    states = assemble(parsed, {name: VALUES[name] for name in parsed.parameters}, F_TANH).states
    rest = {s.name: {"value": 0.0, "unit": shown.of(s.dimension)[0]} for s in states}
    output = ("motion", kind, f"{units[1]}/s" if kind == "velocity" else units[1])
    return make_model(
        structure,
        parameters,
        [output],
        shown,
        dt=DT,
        f_tanh=F_TANH,
        speed=TOP,
        bounds=bounds,
        initial_state=[{"recording": "a.csv", "state": rest}],
        fit={"train": {"motion": {"rss": 3.0, "rmse": 0.05, "fit_percent": 99.5}}, "test": None},
        criterion={"name": "BIC", "value": -123.4},
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


def model_with_values(structure, values, *, kinds=("velocity",), hold="linear", linear_axis=False, dt=None, actuator=1):
    """Model of `structure` with SI `values` and without intervals; a linear axis is the same in N and mm."""
    units = Units("N", "mm") if linear_axis else Units("N m", "rad")
    parameters = {}
    for name, declared in function_set().check(function_set().parse(structure)).parameters.items():
        unit, factor = units.of(declared.dimension)
        parameters[name] = {"value": values[name] * factor, "unit": unit, "std": None, "ci95": None, "at_bound": None}
    outputs = [(kind, kind, KINDS[kind][linear_axis]) for kind in kinds]
    e = PAPER_EXPERIMENT
    options = {"dt": dt or e.dt, "f_tanh": e.f_tanh, "speed": e.speed, "hold": hold, "actuator": actuator}
    return make_model(structure, parameters, outputs, units, **options)


def random_model(structure, seed, **options):
    """Model of `structure` with random plausible values."""
    values = random_values(function_set().parse(structure).parameters, np.random.default_rng(seed))
    return model_with_values(structure, values, **options)


def random_structures(count, seed):
    """Random structures of the paper's grammar, every effect at least once."""
    rng = np.random.default_rng(seed)
    everything = sorted(map(str, PAPER.structures()))
    effects = {name for structure in everything for name in structure.split("+")}
    while True:
        found = [everything[i] for i in rng.choice(len(everything), count, replace=False)]
        if {name for structure in found for name in structure.split("+")} == effects:
            return found


def random_models(count, seed):
    """Models of random structures: all kinds of outputs, both holds, rotation and translation in turn."""
    kinds = ("position", "velocity", "acceleration")
    for i, structure in enumerate(random_structures(count, seed)):
        hold = ("linear", "zoh")[i % 2]
        yield random_model(structure, [seed, i], kinds=kinds, hold=hold, linear_axis=i % 3 == 0)


def first_period(run):
    """First of the two periods of a verification run: the drive slides, stops, reverses and rattles in each."""
    half = run.u.size // 2
    return replace(run, u=run.u[:half], y=run.y[:, :half], y_fine=run.y_fine[:, :half])
