"""Meaning of channels by their units and names."""

from __future__ import annotations

import pytest

from brightgrey.recordings.inspection.meaning import index_of, meaning_of, unit_in_name

NAMES = {
    "Velocity actual value averaged": ("velocity", "actual", ""),
    "motor_torque_Nm": ("torque", "", "motor"),
    "rec.act_pos_se_deg(2,:)": ("position", "actual", "load"),
    "Drehmomentistwert": ("torque", "actual", ""),
    "Istdrehzahl Motor": ("velocity", "", "motor"),
    "ActPosition": ("position", "actual", ""),
    "Axis 1.SetVelo": ("", "setpoint", ""),
    "TorqueRef": ("torque", "setpoint", ""),
    "following error position": ("position", "error", ""),
    "link angle": ("position", "", "load"),
    "iq_soll": ("current", "setpoint", ""),
    "x_mm": ("position", "", ""),
    "q1": ("position", "", ""),
    "n": ("velocity", "", ""),
    "qd": ("velocity", "", ""),
    "u": ("voltage", "", ""),
    "state": ("", "", ""),
    "temperature": ("", "", ""),
    "": ("", "", ""),
}


@pytest.mark.parametrize(("name", "expected"), NAMES.items(), ids=str)
def test_meaning_of__name__says_quantity_role_and_side(name: str, expected: tuple[str, str, str]) -> None:
    meaning = meaning_of(name, None)
    assert (meaning.quantity, meaning.role, meaning.side) == expected
    assert bool(meaning.reason) == any(expected)


@pytest.mark.parametrize(
    ("unit", "quantity"),
    [
        ("rpm", "velocity"),
        ("mN m", "torque"),
        ("kN", "force"),
        ("mA", "current"),
        ("dV", "voltage"),
        ("g", "acceleration"),
    ],
)
def test_meaning_of__unit__says_the_quantity_before_the_name(unit: str, quantity: str) -> None:
    assert meaning_of("position", unit).quantity == quantity


def test_meaning_of__unit_that_is_unknown_or_a_part__leaves_it_to_the_name() -> None:
    assert meaning_of("torque", "HBUNLOS").quantity == "torque"
    assert meaning_of("torque", "%").quantity == "torque"


def test_unit_in_name__suffix__is_a_unit() -> None:
    assert unit_in_name("velocity_deg_per_s") == "deg/s"
    assert unit_in_name("rec.act_torque_abs_nm(2,:)") == "N m"
    assert unit_in_name("motor_torque") is None


def test_index_of__last_number__is_the_axis() -> None:
    assert [index_of(name) for name in ("act_pos(2,:)", "Joint_6", "torque")] == ["2", "6", ""]
