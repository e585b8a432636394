"""The commissioning sheet: closed forms, and intervals that agree with those of the parameters."""

import numpy as np
import pytest

from brightgrey.report.quantities.assembled_model import AssembledModel
from brightgrey.report.quantities.propagation import intervals, parameter_draws
from brightgrey.report.text.commissioning_sheet import commissioning_sheet
from support.models import TOP, VALUES, independent, model_with_intervals, random_model


def entries(model, correlation=None):
    return {entry.name: entry for entry in commissioning_sheet(AssembledModel(model), correlation or {})}


def test_sheet__full_model__agrees_with_closed_forms():
    J1, J2, c, d = (VALUES[n] for n in ("J1", "J2", "c1", "d1"))
    found = entries(model_with_intervals())
    value = {name: entry.value for name, entry in found.items()}
    assert value["total inertia"] == pytest.approx(J1 + J2)
    assert value["inertia ratio, load to motor"] == pytest.approx(J2 / J1)
    # Friction and current control move these by less than their damping does: a part in a thousand.
    assert value["resonance frequency"] == pytest.approx(np.sqrt(c / J1 + c / J2) / (2 * np.pi), rel=2e-3)
    assert value["antiresonance frequency"] == pytest.approx(np.sqrt(c / J2) / (2 * np.pi), rel=1e-9)
    assert value["antiresonance, damping ratio"] == pytest.approx(d / (2 * np.sqrt(c * J2)), rel=1e-9)
    assert value["friction torque at standstill"] == pytest.approx(VALUES["M_C"] + VALUES["M_S"])
    turning = VALUES["M_C"] + VALUES["f_v"] * TOP + VALUES["M_S"] * np.exp(-TOP / VALUES["omega_S"])
    assert value["friction torque at 40.0 rad/s"] == pytest.approx(turning)
    assert value["constant torque on the drive"] == VALUES["M_G"]
    assert value["backlash at the load (whole gap)"] == pytest.approx(2 * VALUES["alpha"])
    assert value["dead time of the input"] == VALUES["T_d"]
    assert value["total delay of the input"] == pytest.approx(VALUES["T_d"] + VALUES["T_1"])


def test_sheet__linear_axis__has_its_words_and_units():
    found = entries(model_with_intervals("two_mass+coulomb+backlash", units=("N", "mm")))
    assert found["total mass"].unit == "N s²/mm"
    assert found["total mass"].value == pytest.approx(1e-3 * (VALUES["J1"] + VALUES["J2"]))
    assert found["friction force at standstill"].unit == "N"
    assert found["backlash at the load (whole gap)"].value == pytest.approx(2e3 * VALUES["alpha"])
    assert found["backlash at the load (whole gap)"].unit == "mm"


def test_sheet__friction_that_differs_by_direction__is_given_for_both():
    model = random_model("one_mass+viscous+directional_viscous", 3)
    found, top = entries(model), model.settings_si().speed_scale
    f_v, f_d = (model.values_si()[name] for name in ("f_v", "f_d"))
    by_direction = {name.rpartition(", ")[2]: entry.value for name, entry in found.items() if "ward" in name}
    assert by_direction == pytest.approx({"forward": (f_v + f_d) * top, "backward": (f_v - f_d) * top})


def test_sheet__load_of_the_position__says_where_its_resonance_holds():
    found = entries(random_model("one_mass+ground_spring", 3))
    assert found["resonance frequency"].note == ""
    found = entries(random_model("two_mass+pendulum", 3, kinds=("position",)))
    assert {e.note for name, e in found.items() if name.startswith("resonance") and name.endswith("frequency")} == {
        "at position 0; elsewhere it is another one"
    }


def test_sheet__one_mass__lists_nothing_else():
    assert [e.name for e in commissioning_sheet(AssembledModel(model_with_intervals("one_mass")), {})] == [
        "total inertia"
    ]


def test_sheet__single_parameter__keeps_its_interval():
    model = model_with_intervals("one_mass+coulomb+gravity")
    found = entries(model, independent(model))
    for name, parameter in (("total inertia", "J1"), ("friction torque at standstill", "M_C")):
        assert found[name].interval == pytest.approx(model.parameters[parameter].ci95)
    assert found["constant torque on the drive"].interval == model.parameters["M_G"].ci95


@pytest.mark.parametrize("rho", [-1.0, 0.0, 0.6, 1.0])
def test_intervals__of_a_sum__depend_on_the_correlation(rho):
    model = model_with_intervals("two_mass", relative=0.02)
    correlation = independent(model) | {("J1", "J2"): rho, ("J2", "J1"): rho}

    def total(sets):
        return (sets["J1"] + sets["J2"])[None]

    ((low, high),) = intervals(AssembledModel(model), correlation, total)
    a, b = 0.02 * VALUES["J1"], 0.02 * VALUES["J2"]
    half = np.sqrt(a * a + b * b + 2 * rho * a * b)
    assert (high - low) / 2 == pytest.approx(half, rel=0.03)  # first order: off by the relative error itself
    assert intervals(AssembledModel(model), {}, total) == [None]


def test_parameter_draws__have_the_intervals_of_the_parameters():
    model = model_with_intervals("two_mass+coulomb", relative=0.1)
    drawn = parameter_draws(AssembledModel(model), independent(model), 4000)
    for name, values in drawn.items():
        # A quantile of 4000 draws at 2.5 % is off by 4 % of half the interval (standard deviation); three of them.
        half = 0.1 * VALUES[name]
        np.testing.assert_allclose(np.percentile(values, (2.5, 97.5)), model.parameters[name].ci95, atol=0.13 * half)
    assert parameter_draws(AssembledModel(model), {}, 10) == {}
