"""Balance of torques beside a fit: what it gives for known drives, and where it says nothing."""

from dataclasses import replace

import numpy as np
import pytest

from brightgrey.estimation.diagnostics.second_opinion import contradictions, second_opinion
from brightgrey.kit import Structure
from brightgrey.recordings import Signal
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

DT = 0.001
F_TANH = 200.0
T = DT * np.arange(4000)
TORQUE = 2.0 * np.sign(np.sin(2.0 * np.pi * 1.2 * T + 0.4)) * np.minimum(1.0, 20.0 * T) + 0.6 * np.sin(2.0 * np.pi * T)
RIGID = {"J1": 0.02, "M_C": 0.3, "f_v": 0.02, "M_G": -0.2}
STIFF = {"J1": 0.01, "J2": 0.01, "c1": 300.0, "d1": 0.02, "M_C": 0.3, "f_v": 0.02, "M_G": -0.2}


def recording_of(structure, values, *, noise=0.02, kind="velocity", name="v"):
    (v,) = reference(structure, values, TORQUE, DT, f_tanh=F_TANH)
    y = v if kind == "velocity" else DT * np.cumsum(v)
    y = y + noise * np.random.default_rng(1).normal(size=y.size)
    return make_recording(TORQUE, y, dt=DT, kind=kind, names=("u", name))


def opinions_of(structure, values, recording):
    return {o.parameters: o for o in second_opinion(Structure.parse(structure), values, [recording], F_TANH)}


@pytest.mark.parametrize(
    ("structure", "values", "inertia"),
    [
        ("one_mass+coulomb+viscous+gravity", RIGID, ("J1",)),
        ("one_mass+coulomb+viscous+gravity+current_control+delay", RIGID | {"T_1": 0.004, "T_d": 0.003}, ("J1",)),
        ("two_mass+coulomb+viscous+gravity", STIFF, ("J1", "J2")),
    ],
)
def test_opinion__known_drive__is_that_drive(structure, values, inertia):
    found = opinions_of(structure, values, recording_of(structure, values))
    assert list(found) == [inertia, ("M_C",), ("f_v",), ("M_G",)]
    for opinion in found.values():
        assert opinion.regressed == pytest.approx(opinion.fitted, rel=0.05, abs=4.0 * opinion.std)
        assert not opinion.contradicts
    assert found[inertia].regressed == pytest.approx(0.02, rel=0.02)


def test_opinion__position__same_as_of_speed():
    structure = "one_mass+coulomb+viscous+gravity"
    found = opinions_of(structure, RIGID, recording_of(structure, RIGID, noise=1e-4, kind="position", name="q"))
    assert found["J1",].regressed == pytest.approx(0.02, rel=0.02)
    assert found["M_C",].regressed == pytest.approx(0.3, rel=0.05)


def test_opinion__effect_at_two_masses__one_term_of_their_sum():
    structure = "two_mass+coulomb+coulomb@2+viscous+gravity"
    values = STIFF | {"M_C": 0.2, "M_C@2": 0.1}
    found = opinions_of(structure, values, recording_of(structure, values))
    assert found["M_C", "M_C@2"].fitted == pytest.approx(0.3)
    assert found["M_C", "M_C@2"].regressed == pytest.approx(0.3, rel=0.05)


def test_opinion__wrong_sign_in_fit__contradicted():
    structure = "one_mass+coulomb+viscous+gravity"
    made = recording_of(structure, RIGID)
    found = second_opinion(Structure.parse(structure), RIGID | {"M_G": 0.05}, [made], F_TANH)
    (told,) = contradictions(found)
    assert told.kind == "contradicted"
    assert told.parameters == ("M_G",)
    assert "gives a constant load the opposite sign" in told.text
    assert contradictions(second_opinion(Structure.parse(structure), RIGID, [made], F_TANH)) == []


def test_opinion__shaft_too_soft_for_the_motion__none():
    soft = STIFF | {"c1": 0.5}
    structure = "two_mass+coulomb+viscous+gravity"
    assert opinions_of(structure, soft, recording_of(structure, soft)) == {}


@pytest.mark.parametrize(
    "signal",
    [Signal("a", "acceleration", "rad/s²"), Signal("v", "speed", "rad/s"), Signal("v", "velocity", "rad/s", mass=2)],
)
def test_opinion__output_without_motion_of_mass_1__none(signal):
    structure = "two_mass+coulomb+viscous+gravity"
    made = recording_of(structure, STIFF)
    made = replace(made, y=np.abs(made.y) if signal.kind == "speed" else made.y, outputs=(signal,))
    assert opinions_of(structure, STIFF, made) == {}
