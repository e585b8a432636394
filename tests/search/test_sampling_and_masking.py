"""How data were taken is met with the right words, and what a recording cannot show is not called needless."""

import numpy as np
import pytest

from brightgrey.kit import PAPER
from brightgrey.simulation.reference import reference
from support.searches import decided, task_of_arrays

DT, F_TANH = 0.002, 5.0
RIGID = {"J1": 0.02, "M_C": 0.5, "f_v": 0.03}
TRUTH = "one_mass+coulomb+viscous"
T = DT * np.arange(500)
REVERSING = 3.0 * np.sin(2.0 * np.pi * 2.0 * T + 0.7 * np.sin(40.0 * T)) * np.minimum(1.0, 20.0 * T)


def cards(y, u, effects, *, kind="velocity", hold="linear", unit_given=True):
    """Evidence for every effect by name."""
    options = {"kind": kind, "unit": "rad/s", "input_unit_given": unit_given}
    found = decided(task_of_arrays(u, y, dt=DT, f_tanh=F_TANH, hold=hold, **options), effects).evidence
    return {c.effect: c for c in found.cards}, found


def speed(values, u, text=TRUTH, *, noise=0.02, **settings):
    y = reference(text, values, u, DT, f_tanh=F_TANH, **settings).reshape(-1)
    return y + noise * np.random.default_rng(2).standard_normal(y.size)


FRICTION = ("coulomb", "viscous", "stribeck", "gravity")


def test_evidence__zero_order_hold__delay_is_sampling():
    y = speed(RIGID, REVERSING, hold="zoh")
    found, _ = cards(y, REVERSING, (*FRICTION, "delay", "current_control"))
    assert {e for e, c in found.items() if c.verdict == "needed"} == {"coulomb", "viscous"}
    late = [found[e] for e in ("delay", "current_control")]
    assert all(c.verdict == "not decidable" for c in late)
    assert any("sampling" in c.reason for c in late)
    told_so, _ = cards(y, REVERSING, (*FRICTION, "delay", "current_control"), hold="zoh")
    assert {e for e, c in told_so.items() if c.verdict == "needed"} == {"coulomb", "viscous"}
    assert not any("sampling" in c.reason for c in told_so.values())


@pytest.mark.long
def test_evidence__differenced_velocity__delay_is_sampling():
    q = reference(TRUTH, RIGID, REVERSING, DT, f_tanh=F_TANH, outputs=["position"]).reshape(-1)
    q = np.round(q / 1e-4) * 1e-4
    y = np.diff(q, prepend=0.0) / DT
    found, _ = cards(y, REVERSING, (*FRICTION, "delay"))
    assert {e for e, c in found.items() if c.verdict == "needed"} == {"coulomb", "viscous"}
    assert found["delay"].verdict == "not decidable"
    assert "sampling" in found["delay"].reason
    told_so, _ = cards(y, REVERSING, (*FRICTION, "delay"), kind="velocity-differenced")
    assert {e for e, c in told_so.items() if c.verdict == "needed"} == {"coulomb", "viscous"}


def test_evidence__scaled_torque__same_verdicts_scaled_values():
    y = speed(RIGID, REVERSING)
    right, own = cards(y, REVERSING, FRICTION)
    scaled, other = cards(y, 1.7 * REVERSING, FRICTION, unit_given=False)
    assert {e: c.verdict for e, c in right.items()} == {e: c.verdict for e, c in scaled.items()}
    (one,), (two,) = own.minimal, other.minimal
    assert one.structure == two.structure == PAPER.parse(TRUTH)
    for name in RIGID:
        assert two.values[name] == pytest.approx(1.7 * one.values[name], rel=1e-3)


def test_evidence__far_from_standstill__stribeck_not_decidable():
    """Also where it is there: the drive runs between 8 and 30 rad/s, far above omega_S."""
    t = DT * np.arange(1200)
    u = 1.2 + 0.8 * np.sin(2.0 * np.pi * 2.0 * t) * (t > 0.6)
    values = RIGID | {"M_S": 0.4, "omega_S": 1.0}
    for text, own in ((TRUTH, RIGID), (f"{TRUTH}+stribeck", values)):
        y = speed(own, u, text)[400:]
        assert y.min() > 5.0
        found, _ = cards(y, u[400:], ("coulomb", "viscous", "stribeck"))
        assert found["stribeck"].verdict == "not decidable"


def test_evidence__no_reversal__backlash_not_decidable():
    """Also where it is there: the load speeds up all the time, and the shaft stays wound up one way."""
    t = DT * np.arange(400)
    u = (2.0 + 0.4 * np.sin(2.0 * np.pi * 8.0 * t)) * np.minimum(t / 0.2, 1.0)
    values = {"J1": 0.012, "J2": 0.012, "c1": 30.0, "d1": 0.05}
    for text, own in (("two_mass", values), ("two_mass+backlash", values | {"alpha": 0.01})):
        y = speed(own, u, text, noise=0.01)
        found, _ = cards(y, u, ("two_mass", "viscous", "backlash"))
        assert found["backlash"].verdict == "not decidable"
        assert found["two_mass"].verdict == "needed"


def test_evidence__backlash_crossed__decided():
    values = {"J1": 0.012, "J2": 0.012, "c1": 30.0, "d1": 0.05, "f_v": 0.06}
    y = speed(values, REVERSING, "two_mass+viscous", noise=0.003)
    found, _ = cards(y, REVERSING, ("two_mass", "viscous", "backlash"))
    assert found["backlash"].verdict == "not needed"
    y = speed(values, REVERSING, "two_mass+viscous", noise=0.01)  # hides a gap of a hundred-thousandth of the way
    found, _ = cards(y, REVERSING, ("two_mass", "viscous", "backlash"))
    assert found["backlash"].verdict == "not decidable"
    assert "it would from ±" in found["backlash"].reason
    y = speed(values | {"alpha": 0.02}, REVERSING, "two_mass+viscous+backlash", noise=0.01)
    found, _ = cards(y, REVERSING, ("two_mass", "viscous", "backlash"))
    assert found["backlash"].verdict == "needed"
