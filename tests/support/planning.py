"""A small drive with one open question, as a search would leave it, and a folder that holds it."""

import json

import numpy as np

from brightgrey import identify, recording_from
from brightgrey.effects import Scales
from brightgrey.model.model import load_model
from brightgrey.planning.design import PlanningEffort
from brightgrey.planning.drive import PlannedDrive
from brightgrey.search.undecided.question import UNDECIDED_SCHEMA, Known, OpenQuestions, OutputNoise, Question
from brightgrey.simulation.reference import reference

STRUCTURE = "one_mass+coulomb+viscous"
VALUES = {"J1": 0.02, "M_C": 1.0, "f_v": 0.02}
DT = 2e-3
T = DT * np.arange(400)
TORQUE = 3.0 * np.sin(2.0 * np.pi * 3.0 * T) * np.minimum(1.0, 10.0 * T)
FRICTION_SCALE = 2.5  # s/rad
QUICK = PlanningEffort(3, 2, 4, 8, finalists=4, relaxed_log2=1)


def small_recording(seed=0):
    """Torque and noisy speed of the drive by the reference solver."""
    (v,) = reference(STRUCTURE, VALUES, TORQUE, DT, f_tanh=FRICTION_SCALE)
    y = v + 0.02 * np.random.default_rng(seed).standard_normal(v.size)
    columns = {"t": T, "torque": TORQUE, "speed": np.round(y, 3)}
    return recording_from(
        columns, input="torque", outputs=["speed:velocity"], units={"torque": "N m", "speed": "rad/s", "t": "s"}
    )


def known(values=VALUES, information=1e3):
    """Estimates with a covariance that does not couple them."""
    matrix = tuple(tuple(information if i == k else 0.0 for k in range(3)) for i in range(3))
    return Known(STRUCTURE, values, tuple(values), matrix)


def questions():
    """Viscous friction in one direction only is the question: a third of the other one's."""
    values = {**VALUES, "M_S": 0.2, "omega_S": 2.0}
    size = Question(
        ("stribeck",), "size", f"{STRUCTURE}+stribeck", values, known(), (0.0, 0.0, 0.0), 0.0, 2, 7.8, (1.0, 2.0)
    )
    ranges = {"J1": (1e-3, 1.0), "M_C": (1e-2, 10.0), "f_v": (1e-4, 1.0), "M_S": (1e-2, 10.0), "omega_S": (0.1, 50.0)}
    reached = {
        "torque": 3.0, "rms_torque": 2.0, "speed": 12.0, "acceleration": 200.0, "jerk": 5e4, "travel": 4.0,
        "duration": DT * 400,
    }  # fmt: skip
    return OpenQuestions(
        UNDECIDED_SCHEMA,
        DT,
        400,
        400.0,
        0.005,
        0.1,
        (OutputNoise(50.0, (1.0,), 1.0),),
        known(),
        (size,),
        {},
        reached,
        Scales(3.0, 12.0, 200.0, 4.0, DT, DT * 400, 0.02, 1.0, 0.02, 0.0),
        ranges,
    )


def small_run(folder):
    """Folder of a fit of the drive, with the open question."""
    identify(small_recording(), STRUCTURE, f_tanh=FRICTION_SCALE, check=False, starts=2).write(folder)
    (folder / "undecided.json").write_text(questions().text())
    assert json.loads((folder / "undecided.json").read_text())["schema"] == UNDECIDED_SCHEMA
    return folder


def known_drive(folder=None):
    """The drive as a plan knows it."""
    result = identify(small_recording(), STRUCTURE, f_tanh=FRICTION_SCALE, check=False, starts=2)
    return PlannedDrive(load_model(folder / "model.json") if folder else result.model, questions())
