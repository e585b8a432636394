"""Models of random drives, made without an identification."""

import numpy as np

from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER
from brightgrey.model.model import Model
from brightgrey.recordings.units.signals import Units

KINDS = {
    "position": ("rad", "mm"),
    "velocity": ("rad/s", "mm/s"),
    "velocity-differenced": ("rad/s", "mm/s"),
    "acceleration": ("rad/s²", "mm/s²"),
}


def model(structure, values, *, kinds=("velocity",), hold="linear", linear_axis=False, dt=None):
    """Model of `structure` with SI `values`; a linear axis is the same in N and mm."""
    experiment = PAPER_EXPERIMENT
    force = "N" if linear_axis else "N m"
    signals = [("torque", "input", force), *((kind, kind, KINDS[kind][linear_axis]) for kind in kinds)]
    units = Units(force, "mm" if linear_axis else "rad")
    dt = dt or experiment.dt
    (f_unit, f_factor), (v_unit, v_factor) = units.of((0, -1, 1)), units.of((0, 1, -1))
    parameters = {}
    for name, declared in PAPER.check(PAPER.parse(structure)).parameters.items():
        unit, factor = units.of(declared.dimension)
        parameters[name] = {"value": values[name] * factor, "unit": unit, "std": None, "ci95": None, "at_bound": None}
    return Model.check(
        {
            "schema": "brightgrey/model/1",
            "structure": structure.split("+"),
            "parameters": parameters,
            "signals": [
                {"name": n, "kind": k, "unit": u, "gain": 1.0, "sampling_time": dt, "hold": hold} for n, k, u in signals
            ],
            "settings": {
                "f_tanh": experiment.f_tanh * f_factor,
                "f_tanh_unit": f_unit,
                "speed_scale": experiment.speed * v_factor,
                "speed_scale_unit": v_unit,
                "level": "accurate",
                "substeps": 1,
                "hold": hold,
                "sampling_time": dt,
                "bounds": {},
                "fixed": {},
            },
            "initial_state": [],
            "fit": {"train": {}, "test": None},
            "criterion": None,
            "evidence": None,
            "ties": None,
            "outcome": {"kind": "converged", "text": "made for a test"},
            "seed": 0,
            "version": "0",
        }
    )


def drawn(structure, seed, **options):
    """Model of `structure` with random plausible values."""
    values = random_values(PAPER.parse(structure).parameters, np.random.default_rng(seed))
    return model(structure, values, **options)


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
        yield drawn(structure, [seed, i], kinds=kinds, hold=hold, linear_axis=i % 3 == 0)
