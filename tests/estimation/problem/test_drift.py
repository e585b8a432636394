"""Drift as a nuisance: a torque from its negative to itself over the recording."""

import numpy as np
import pytest

from brightgrey.estimation.problem.drift import DRIFT, DRIFT_DEFAULTS
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem, predict_many
from brightgrey.kit import Structure
from brightgrey.recordings import Recording, Signal
from brightgrey.simulation import Settings

DT, SAMPLES = 0.01, 801
KINDS = ("position", "velocity", "acceleration")


def recording(u, samples=SAMPLES):
    t = DT * np.arange(samples)
    units = {"position": "rad", "velocity": "rad/s", "acceleration": "rad/s²"}
    outputs = tuple(Signal(kind, kind, units[kind]) for kind in KINDS)
    y = np.array([np.sin(t), np.cos(t), -np.sin(t)])
    return Recording("drift", t, u[:samples], y, Signal("torque", "input", "N m"), outputs)


@pytest.mark.parametrize(
    ("structure", "values"),
    [
        ("two_mass+coulomb+viscous", {"J1": 0.5, "J2": 0.3, "c1": 40.0, "d1": 0.1, "M_C": 0.2, "f_v": 0.3}),
        ("one_mass+viscous+current_control", {"J1": 0.8, "f_v": 0.5, "T_1": 0.03}),
    ],
)
def test_drift__in_the_values__equals_a_ramp_of_the_input(structure, values):
    """Current control and dead time come before the drive: the drift passes through them as the input does."""
    t = DT * np.arange(SAMPLES)
    u, drift = np.sin(2.0 * t), np.array([0.0, 0.15, -0.4])
    settings = Settings(50.0, 2.0, "accurate")
    many = {name: np.full(3, value) for name, value in values.items()}
    at_rest = {"q1": 0.0, "q2": 0.0, "v1": 0.0, "v2": 0.0, "T": 0.0}
    found = predict_many(Structure.parse(structure), many | {DRIFT: drift}, recording(u), settings, initial=at_rest)
    for k, torque in enumerate(drift):
        ramp = u + torque * (2.0 * t / t[-1] - 1.0)
        one = {name: value[:1] for name, value in many.items()}
        known = predict_many(Structure.parse(structure), one, recording(ramp), settings, initial=at_rest)[..., 0]
        size = np.abs(known).max(axis=1, keepdims=True)
        assert np.all(np.abs(found[..., k] - known) <= 2e-4 * size), torque  # two simulations, each within 1e-4


def test_problem__long_recordings__have_a_drift_each():
    u = np.sin(2.0 * DT * np.arange(SAMPLES))
    short = int(DRIFT_DEFAULTS.shortest / DT) - 1
    structure = Structure.parse("one_mass+viscous")
    both = (recording(u), recording(u, short), recording(u))
    names = [n.name for n in SimulationErrorProblem.of(structure, both, drift=True).nuisances]
    assert [n for n in names if n.startswith(DRIFT)] == [f"{DRIFT}#1", f"{DRIFT}#3"]
    assert not any(n.name.startswith(DRIFT) for n in SimulationErrorProblem.of(structure, both).nuisances)
