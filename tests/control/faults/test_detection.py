"""Fault detection on recordings of the reference solver."""

from dataclasses import replace

import numpy as np
import pytest

from brightgrey.control.faults.detection import FaultCase, detect_faults, fault_groups
from brightgrey.control.filters.extended_kalman import Noise
from brightgrey.effects import registry
from brightgrey.errors import SettingsError
from brightgrey.kit import Structure
from support.drives import SETTINGS, recorded, values_of

PLAIN = "two_mass+coulomb+viscous"
GAP = "two_mass+coulomb+viscous+backlash"
EVERYTHING = "two_mass+coulomb+viscous+stribeck+gravity+backlash+current_control+delay"
FACTORS = {"friction": 1.5, "load": 1.3, "backlash": 2.0}
OFF = {"J1": 1.01, "c1": 0.985, "d1": 1.02, "f_v": 0.99}  # what the model does not know of the drive


def case_of(text, seed, std=0.01, torque=0.0, **changed):
    known = {name: value * OFF.get(name, 1.0) for name, value in values_of(text).items()}
    std_of = {name: std * value for name, value in known.items()}
    return FaultCase(known, recorded(text, seed, torque=torque, **changed), Noise(1e-3, np.array([0.02])), std_of)


def found_in(text, *cases):
    results = detect_faults(Structure.parse(text), SETTINGS, cases)
    return [{finding.subject: finding for finding in found} for found in results]


def broken(text, subject):
    groups_of = fault_groups(Structure.parse(text))
    names = next(names for fault, names in groups_of.items() if fault.subject == subject)
    return {name: FACTORS[subject] * values_of(text)[name] for name in names}


def test_fault_groups__of_all_effects__are_the_declared_faults():
    declared = {p.fault.subject for effect in registry().values() for p in effect.parameters if p.fault}
    found = fault_groups(Structure.parse(EVERYTHING))
    assert {fault.subject for fault in found} == declared
    assert found[next(f for f in found if f.subject == "load")] == ("J2",)


@pytest.mark.parametrize(
    ("text", "faults"),
    [
        pytest.param(PLAIN, (None, "friction", "load"), marks=pytest.mark.long),
        (GAP, (None, "friction", "load", "backlash")),
    ],
)
def test_detect_faults__one_fault__reports_this_fault_only(text, faults):
    cases = [case_of(text, 11, **(broken(text, guilty) if guilty else {})) for guilty in faults]
    for guilty, found in zip(faults, found_in(text, *cases), strict=True):
        assert [f.subject for f in found.values() if f.verdict == "changed"] == ([guilty] if guilty else [])
        for finding in found.values():
            expected = FACTORS[guilty] if finding.subject == guilty else 1.0
            assert finding.ci95[0] < expected * 1.02, guilty
            assert finding.ci95[1] > expected * 0.98, guilty


def test_detect_faults__gap_without_effect__is_not_decidable():
    """Its width is a thousandth of the shaft's twist: nothing in the speed tells it."""
    (found,) = found_in(GAP, case_of(GAP, 12, alpha=1e-5))
    assert found["backlash"].verdict == "not decidable"
    assert found["load"].verdict == found["friction"].verdict == "as before"


@pytest.mark.parametrize(
    ("factor", "std", "verdict", "words"),
    [
        (1.3, 0.11, "not decidable", "A change by 50 % is neither shown nor excluded"),
        pytest.param(
            *(1.15, 0.05, "as before", "is not shown to have changed by 10 % or more, and has not changed by 50 %"),
            marks=pytest.mark.long,
        ),
    ],
)
def test_detect_faults__interval_without_one__never_said_to_be_as_before(factor, std, verdict, words):
    (found,) = found_in(PLAIN, case_of(PLAIN, 11, std=std, J2=factor * values_of(PLAIN)["J2"]))
    assert found["load"].ci95[0] > 1.0
    assert found["load"].verdict == verdict
    assert words in found["load"].text
    assert found["friction"].text.startswith("Friction is as before")


def test_detect_faults__gap_that_has_become_smaller__has_not_grown():
    (found,) = found_in(GAP, case_of(GAP, 11, alpha=0.5 * values_of(GAP)["alpha"]))
    assert found["backlash"].ci95[1] < 0.8
    assert found["backlash"].verdict == "as before"
    assert found["backlash"].text.startswith("Backlash has not grown")


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_detect_faults__drive_at_rest__is_not_decidable(noise):
    still = recorded(GAP, 14, noise=0.0)
    y = noise * np.random.default_rng(14).normal(size=still.y.shape)
    case = FaultCase(values_of(GAP), replace(still, u=0.0 * still.u, y=y), Noise(1e-3, np.array([0.02])))
    (found,) = detect_faults(Structure.parse(GAP), SETTINGS, [case])
    assert {f.verdict for f in found} == {"not decidable"}


def test_detect_faults__unrecorded_disturbance__raises_no_alarm():
    quiet, disturbed = found_in(GAP, case_of(GAP, 13), case_of(GAP, 13, torque=0.05))
    width = {name: [np.log(f[name].ci95[1] / f[name].ci95[0]) for f in (quiet, disturbed)] for name in quiet}
    assert width["backlash"][1] > width["backlash"][0]
    assert not [f.text for f in disturbed.values() if f.verdict == "changed"]


def test_detect_faults__confidence_out_of_range__is_refused():
    text = "one_mass+coulomb"
    with pytest.raises(SettingsError, match="confidence"):
        detect_faults(Structure.parse(text), SETTINGS, [], confidence=2.0)
