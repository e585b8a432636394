"""Starts whose sizes balance the torques of a rigid drive."""

from dataclasses import replace

import numpy as np
import pytest

from brightgrey.estimation.optimisation.torque_regression import with_regressed_sizes, with_waves
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.kit import Structure
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

DT = 1e-3
F_TANH = 50.0
SETTINGS = Settings(f_tanh=F_TANH, speed_scale=40.0)
TRUE = {"J1": 0.02, "J2": 0.01, "c1": 300.0, "d1": 0.05, "M_C": 0.3, "f_v": 0.05, "M_G": -0.2, "G": 0.4, "k": 0.3}
TRUE |= {"phi_0": 0.2, "M_C@2": 0.2}


def recording_of(structure, kind="velocity", noise=2e-4):
    """Recording by the reference solver, with noise in parts of the peak."""
    t = DT * np.arange(3000)
    u = 2.0 * np.sin(2.0 * np.pi * 1.0 * t) + 1.0 * np.sin(2.0 * np.pi * 2.3 * t)
    values = {name: TRUE[name] for name in structure.parameters}
    (y,) = reference(structure, values, u, DT, f_tanh=F_TANH, outputs=[kind])
    y += noise * np.abs(y).max() * np.random.default_rng(1).standard_normal(y.size)
    return make_recording(u, y, dt=DT, kind=kind)


def regressed(structure, recording, fixed=(), **shown):
    """Sizes of samples, by name, whose other parameters are the true ones; and the samples as they were drawn."""
    problem = SimulationErrorProblem.of(structure, [recording])
    space = parameter_space(structure, scales(recording), {}, {name: TRUE[name] for name in fixed}, problem.nuisances)
    samples = space.sample(16, np.random.default_rng(2))
    for name in set(shown) & set(space.names):
        samples[space.names.index(name)] = shown[name]
    found = with_regressed_sizes(problem, space, SETTINGS, samples)
    return None if found is None else space.named(found), space.named(samples)


@pytest.mark.parametrize("kind", ["velocity", "position"])
def test_regressed_sizes__one_mass__are_those_of_the_drive(kind):
    structure = Structure.parse("one_mass+coulomb+viscous+pendulum")
    found, _ = regressed(structure, recording_of(structure, kind), k=TRUE["k"], phi_0=TRUE["phi_0"])
    assert found["J1"] == pytest.approx(TRUE["J1"], rel=0.01)
    for name in ("M_C", "f_v", "G"):  # the kernel smears reversals over its width
        assert found[name] == pytest.approx(TRUE[name], rel=0.1), name


def test_regressed_sizes__two_masses__add_up_to_those_of_the_drive_and_keep_their_ratios():
    structure = Structure.parse("two_mass+coulomb+coulomb@2+viscous")
    shown = {name: TRUE[name] for name in ("c1", "d1")}
    found, drawn = regressed(structure, recording_of(structure), J1=0.01, J2=0.005, M_C=0.1, **shown, **{"M_C@2": 0.2})
    assert found["J1"] + found["J2"] == pytest.approx(TRUE["J1"] + TRUE["J2"], rel=0.03)
    # The kernel is half a period of the resonance wide, and friction reverses within a few of its widths.
    assert found["M_C"] + found["M_C@2"] == pytest.approx(TRUE["M_C"] + TRUE["M_C@2"], rel=0.25)
    for one, other in (("J1", "J2"), ("M_C", "M_C@2")):
        assert found[one] / found[other] == pytest.approx(drawn[one] / drawn[other])
    assert all(np.array_equal(found[name], drawn[name]) for name in shown)


def test_regressed_sizes__a_known_size__is_taken_from_the_input():
    structure = Structure.parse("one_mass+coulomb+viscous+gravity")
    found, _ = regressed(structure, recording_of(structure), fixed=["M_C"])
    assert np.all(found["M_C"] == TRUE["M_C"])
    assert found["f_v"] == pytest.approx(TRUE["f_v"], rel=0.1)
    assert found["M_G"] == pytest.approx(TRUE["M_G"], rel=0.1)


def test_regressed_sizes__sensor_without_a_sign__are_none():
    structure = Structure.parse("one_mass+coulomb+viscous")
    r = recording_of(structure)
    unsigned = replace(r, y=np.abs(r.y), outputs=(replace(r.outputs[0], kind="speed"),))
    found, _ = regressed(structure, unsigned)
    assert found is None


def test_regressed_sizes__no_size_free__are_none():
    structure = Structure.parse("one_mass+coulomb+viscous")
    found, _ = regressed(structure, recording_of(structure), fixed=["J1", "M_C", "f_v"])
    assert found is None


@pytest.mark.parametrize(("kind", "noise"), [("velocity", 1e-3), ("position", 1e-5)])
@pytest.mark.parametrize("k", [0.05, 0.5, 7.0])  # half a period over the travel, 7 and 90 of them
def test_waves__load_over_the_position__are_found_for_any_number_of_periods(kind, noise, k):
    structure = Structure.parse("one_mass+coulomb+viscous+pendulum")
    t = DT * np.arange(6000)
    u = 0.8 + 1.2 * np.sin(2.0 * np.pi * 0.2 * t)
    true = {"J1": 0.02, "M_C": 0.2, "f_v": 0.05, "G": 0.15, "k": k, "phi_0": 0.7}
    (y,) = reference(structure, true, u, DT, f_tanh=F_TANH, outputs=[kind])
    travel = np.ptp(y) if kind == "position" else np.ptp(np.cumsum(y) * DT)
    y += noise * np.abs(y).max() * np.random.default_rng(1).standard_normal(y.size)
    recording = make_recording(u, y, dt=DT, kind=kind)
    problem = SimulationErrorProblem.of(structure, [recording])
    space = parameter_space(structure, scales(recording), {}, {}, problem.nuisances)
    drawn = space.sample(8, np.random.default_rng(2))
    found = space.named(with_waves(problem, space, SETTINGS, drawn))
    assert np.abs(found["k"] - k).min() < 0.5 * 2.0 * np.pi / travel  # a descent keeps the period then
    others = [name for name in space.names if name not in ("k", "phi_0")]
    assert all(np.array_equal(found[name], space.named(drawn)[name]) for name in others)


def test_waves__no_load_over_the_position__leave_samples_as_they_are():
    structure = Structure.parse("one_mass+coulomb+viscous")
    recording = recording_of(structure)
    problem = SimulationErrorProblem.of(structure, [recording])
    space = parameter_space(structure, scales(recording), {}, {}, problem.nuisances)
    drawn = space.sample(4, np.random.default_rng(2))
    assert np.array_equal(with_waves(problem, space, SETTINGS, drawn), drawn)
