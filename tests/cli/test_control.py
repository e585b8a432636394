"""Commands analyse, control and watch, and their wrong use."""

import json
from dataclasses import replace

import pytest

from brightgrey.api.control import analyse, design
from brightgrey.control.linear.margins import Compensator
from brightgrey.model.model import load_model
from brightgrey.recordings import Units
from support.models import model_with_values

pytest.importorskip("control", reason="python-control is not installed")


def test_analyse__controller__prints_poles_and_margins(call, drive):
    done = call("analyse", drive.out / "model.json", "--controller", "0.5 10 / 1 0", "--json")
    assert done.code == 0, done.err
    found = json.loads(done.out)
    assert found["stability"] == "stable"
    assert found["poles"][0][0] == pytest.approx(-drive.truth["f_v"] / drive.truth["J1"], rel=0.2)
    assert found["margins"]["stable"]
    assert "phase margin" in call("analyse", drive.out / "model.json", "--controller", "0.5 10 / 1 0").out


def test_control__torque__prints_suggested_gains(call, drive):
    done = call("control", drive.out / "model.json", "--torque", "2", "--json")
    assert done.code == 0, done.err
    found = json.loads(done.out)
    assert found["cascade"]["speed_margins"]["forward"]["phase"] >= 45.0
    assert found["state_control"]["margins"]["stable"]
    said = call("control", drive.out / "model.json", "--torque", "2").out
    assert "reset time" in said
    assert f"speed gain {found['cascade']['speed']:.4g} N m s/rad" in said


def test_gains__of_a_recording_in_volts_and_millimetres__are_shown_in_its_units(drive):
    found = design(load_model(drive.out / "model.json"), torque=2.0)
    shown = replace(found, units=Units("V", "mm"))
    _, (_, speed, unit), _ = shown.cascade_gains()
    assert (unit, speed) == ("V s/mm", pytest.approx(1e-3 * found.cascade.speed_gain))
    *_, (name, integral, unit) = shown.feedback_gains()
    assert (name, unit) == ("integral of the speed error", "V/mm")
    assert integral == pytest.approx(1e-3 * found.state_feedback.integral)


@pytest.mark.parametrize("sampling_time", [0.02, 0.1])
def test_design__slow_controller__slows_the_state_feedback_until_it_is_well_damped(drive, sampling_time):
    found = design(load_model(drive.out / "model.json"), torque=2.0, sampling_time=sampling_time)
    for loop in (found.state_feedback.margins(found.delay), found.observer_margins):
        assert loop.stable
        assert loop.sensitivity <= 2.0
    assert any("slowed down to a settling time" in note for note in found.notes)


def test_control__controller_faster_than_the_recording__says_what_was_not_seen(call, drive, tmp_path):
    slow = json.loads((drive.out / "model.json").read_text(encoding="utf-8"))
    slow["settings"]["sampling_time"] = 0.05
    (tmp_path / "slow.json").write_text(json.dumps(slow), encoding="utf-8")
    done = call("control", tmp_path / "slow.json", "--torque", "2", "--dt", "0.001")
    assert "The recording shows nothing above 10 Hz, half its sampling rate" in done.out


def test_control__torque_below_friction_and_load__says_what_they_take(call, drive):
    done = call("control", drive.out / "model.json", "--torque", "0.01")
    assert done.code == 2
    assert "a torque of 0.01 N m does not move this drive: friction and load take" in done.err


@pytest.fixture
def arm(tmp_path):
    values = {"J1": 0.06, "f_v": 0.05, "M_C": 0.1, "G": 1.0, "k": 1.0, "phi_0": 0.0}
    path = tmp_path / "arm.json"
    path.write_text(model_with_values("one_mass+coulomb+viscous+pendulum", values, kinds=("position",)).text())
    return path


@pytest.mark.long
def test_control__position_dependent_load__gives_a_cascade_and_says_why_no_state_feedback(call, arm):
    done = call("control", arm, "--torque", "5", "--json")
    assert done.code == 0, done.err
    found = json.loads(done.out)
    assert found["state_control"] is None
    assert list(found["cascade"]["position_margins"]) == ["forward at 0 rad", "forward at 3.14 rad"]
    assert all(m["stable"] for m in found["cascade"]["position_margins"].values())
    said = call("control", arm, "--torque", "5").out
    assert "no constant torque keeps a speed" in said
    assert "friction and load take 2" in call("control", arm, "--torque", "0.5").err  # the arm held level


SECOND = {"J2": 0.06, "c1": 300.0, "d1": 0.1, "f_v": 0.01}


@pytest.mark.parametrize(
    ("structure", "values", "places"),
    [
        ("one_mass+coulomb+pendulum", {"M_C": 0.1, "G": 1.0, "k": 1.0, "phi_0": 0.0}, 2),  # a pole on the axis
        ("one_mass+ground_spring", {"c_g": 1.0}, 1),
        pytest.param(
            "two_mass+viscous+backlash+pendulum@2",
            {**SECOND, "alpha": 0.02, "G@2": 1.0, "k@2": 1.0, "phi_0@2": 0.0},
            4,
            marks=pytest.mark.long,
        ),
        pytest.param(
            "two_mass+viscous+pendulum+pendulum@2",
            {**SECOND, "G": 1.0, "k": 1.0, "phi_0": 0.0, "G@2": 1.0, "k@2": 1.0, "phi_0@2": 0.0},
            2,
            marks=pytest.mark.long,
        ),
    ],
)
def test_design__loads_that_depend_on_the_position__have_a_stable_cascade(structure, values, places):
    found = design(model_with_values(structure, {"J1": 0.02, **values}, kinds=("position",)), torque=5.0)
    assert len(set(found.places)) == len(found.places) == places
    assert all(m.stable for m in (*found.cascade.speed_margins, *found.cascade.position_margins))
    assert found.state_feedback is found.observer_gain is found.noise is found.observer_margins is None


@pytest.mark.long
def test_design__friction_and_load_behind_a_gap__cascade_and_state_feedback_are_stable():
    """In the open gap the load coasts: nothing has to balance it."""
    structure = "two_mass+coulomb+viscous+coulomb@2+viscous@2+gravity@2+backlash"
    beside = {"M_C": 0.1, "f_v": 0.01, "M_C@2": 0.2, "f_v@2": 0.02, "M_G@2": 0.3, "alpha": 0.01}
    found = design(model_with_values(structure, {"J1": 0.02, **SECOND, **beside}), torque=5.0)
    assert {a.operating_point.contact_mode.contact for a in found.analyses} == {"forward", "gap"}
    assert all(m.stable for m in (*found.cascade.speed_margins, *found.cascade.position_margins))


@pytest.mark.parametrize("position", [0.0, 1.0, 2.0, 2.5, 3.0, -2.0, -3.0])
def test_analyse__speed_control_with_an_integral_of_an_arm__is_stable_in_every_pose(position):
    """The position stays wherever it is: the pole at 0 is no matter of rounding."""
    values = {"J1": 0.06, "f_v": 0.05, "G": 1.0, "k": 1.0, "phi_0": 0.0}
    model = model_with_values("one_mass+viscous+pendulum", values, kinds=("velocity",))
    assert analyse(model, position=position).margins(Compensator.of([39.0, 39.0 / 0.00615], [1.0, 0.0])).stable


def test_analyse__position_dependent_load__holds_at_the_position_asked_for(call, arm):
    hanging, upright = (call("analyse", arm, "--position", q).out for q in ("0", "3.1416"))
    assert "stable at speed" in hanging
    assert "position 0 (SI)" in hanging
    assert "unstable at speed" in upright
    assert "position 3.142 (SI)" in upright


def test_watch__healthy_drive__reports_no_change(call, drive):
    model = drive.out / "model.json"
    done = call("watch", model, drive.folder / "b.csv", "--baseline", drive.folder / "a.csv", "--json")
    assert done.code == 0, done.err
    verdicts = {f["subject"]: f["verdict"] for f in json.loads(done.out)["findings"]}
    assert set(verdicts) == {"friction", "load"}
    assert "changed" not in verdicts.values()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("analyse", "--controller", "1 2"), "NUMERATOR / DENOMINATOR"),
        (("analyse", "--controller", "1 0 / 1"), "degree"),
        (("analyse", "--contact", "gapp"), "Did you mean 'gap'"),
        (("analyse", "--contact", "gap"), "this model has no gap"),
        (("control", "--torque", "-1"), "allowed is 1e-30"),
    ],
)
def test_commands__wrong_option__ends_with_one_line(call, drive, options, says):
    done = call(options[0], drive.out / "model.json", *options[1:])
    assert done.code == 2
    assert says in done.err
    assert len(done.err.splitlines()) == 1


@pytest.mark.parametrize(
    "options",
    [("--torque", "5", "--dt", "1e300"), ("--torque", "5", "--dt", "1e-300"), ("--torque", "1e-300")],
)
def test_control__absurd_sizes__end_with_one_line(call, drive, options):
    done = call("control", drive.out / "model.json", *options, "--json")
    assert done.code == 2
    assert "allowed is" in done.err
    assert len(done.err.splitlines()) == 1
