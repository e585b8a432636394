"""Assembled state spaces against the paper's equations written out by hand."""

import numpy as np
import pytest

from brightgrey.effects import registry
from brightgrey.errors import SettingsError
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import OUTPUTS, PAPER, Structure, assemble, function_set

REAL_AXES = (
    "two_mass+viscous+directional_viscous+coulomb@2+viscous@2+directional_viscous@2",
    "one_mass+ground_spring+pendulum",
    "three_mass+backlash@2+stribeck@3+pendulum@2",
    "three_mass+cubic_spring@2",
)
ALL = [*PAPER.structures(), *map(function_set().parse, REAL_AXES)]
J1, J2, J3, c1, c2, d1, d2 = 2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0
TWO = {"J1": J1, "J2": J2, "c1": c1, "d1": d1}
THREE = {**TWO, "J3": J3, "c2": c2, "d2": d2}
EXACT = {"rtol": 1e-14, "atol": 1e-14}


def system_of(text, values, outputs=OUTPUTS, f_tanh=2.0):
    return assemble(Structure.parse(text), values, f_tanh, outputs)


def test_two_mass__equals_equations_7_to_10():
    s = system_of("two_mass", TWO)
    A = [
        [0, 0, 1, 0],
        [0, 0, 0, 1],
        [-c1 / J1, c1 / J1, -d1 / J1, d1 / J1],
        [c1 / J2, -c1 / J2, d1 / J2, -d1 / J2],
    ]
    np.testing.assert_allclose(s.A, A, **EXACT)
    np.testing.assert_allclose(s.B, [[0], [0], [1 / J1], [0]], **EXACT)
    np.testing.assert_allclose(s.C, [[1, 0, 0, 0], [0, 0, 1, 0], A[2]], **EXACT)
    np.testing.assert_allclose(s.D, [[0], [0], [1 / J1]], **EXACT)
    assert s.state_names == ("q1", "q2", "v1", "v2")


def test_three_mass__equals_equations_7_to_10():
    s = system_of("three_mass", THREE)
    M = np.diag([J1, J2, J3])
    C = np.array([[c1, -c1, 0], [-c1, c1 + c2, -c2], [0, -c2, c2]])
    D = np.array([[d1, -d1, 0], [-d1, d1 + d2, -d2], [0, -d2, d2]])
    inverse = np.linalg.inv(M)
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ C, -inverse @ D]])
    np.testing.assert_allclose(s.A, A, **EXACT)
    np.testing.assert_allclose(s.B[:, 0], [0, 0, 0, 1 / J1, 0, 0], **EXACT)
    np.testing.assert_allclose(s.C, [np.eye(6)[0], np.eye(6)[3], A[3]], **EXACT)
    np.testing.assert_allclose(s.D[:, 0], [0, 0, 1 / J1], **EXACT)


def test_friction_and_gravity__equation_11__show_in_the_acceleration():
    own = {"M_C": 1.5, "f_v": 0.3, "M_S": 0.7, "omega_S": 4.0, "M_G": -0.9}
    s = system_of("two_mass+coulomb+viscous+stribeck+gravity", {**TWO, **own})
    for v in (-3.0, 0.05, 6.0):
        friction = -0.3 * v - np.tanh(2.0 * v) * (1.5 + 0.7 * np.exp(-abs(v) / 4.0))
        x, u = np.array([0.1, -0.2, v, 0.4]), 2.5
        expected = (friction - 0.9) / J1
        np.testing.assert_allclose(s.f(x, u), [0, 0, expected, 0], **EXACT)
        shaft = c1 * (x[0] - x[1]) + d1 * (x[2] - x[3])
        acceleration = (u - shaft) / J1 + expected
        np.testing.assert_allclose(s.output(x, u), [x[0], x[2], acceleration], rtol=1e-13)
        np.testing.assert_allclose(s.g(x, u), [0, 0, expected], **EXACT)


def test_backlash__equals_the_five_steps():
    alpha = 0.2
    s = system_of("three_mass+backlash", {**THREE, "alpha": alpha})
    plain = system_of("three_mass", THREE)
    assert s.state_names == ("q1", "q2", "q3", "v1", "v2", "v3", "lambda1")  # step 1
    expected = np.zeros((7, 7))
    expected[:6, :6] = plain.A  # step 2: the rest stays as it was
    expected[3, 6], expected[4, 6] = c1 / J1, -c1 / J2  # step 3
    np.testing.assert_allclose(s.A, expected, **EXACT)
    # Step 4, eq. (5) and (15): the gap's rate, and the damper's share of it in both speeds.
    for gap, turn in [(0.0, 1.0), (0.0, -1.0), (-0.1, 1.0), (-2 * alpha, 1.0), (-2 * alpha, -1.0)]:
        x = turn * np.array([0.3, -0.1, 0.5, 1.0, -2.0, 0.7, 0.0])
        x[6] = gap
        rate = x[3] - x[4] + c1 / d1 * (x[0] - x[1] - gap)
        kept = min(0.0, rate) if gap == 0.0 else max(0.0, rate) if gap == -2 * alpha else rate
        f = [0, 0, 0, d1 / J1 * kept, -d1 / J2 * kept, 0, kept]
        np.testing.assert_allclose(s.f(x, 0.0), f, rtol=1e-13, atol=1e-13)
        # Step 5: outputs that are accelerations carry it too. Eq. (3): M_B = c tau + d tau'.
        torque = c1 * (x[0] - x[1] - gap) + d1 * (x[3] - x[4] - kept)
        assert s.output(x, 4.0)[2] == pytest.approx((4.0 - torque) / J1, rel=1e-12, abs=1e-12)
        if kept == rate:
            assert torque == pytest.approx(0.0, abs=1e-12)


def test_backlash__gap_of_no_width__no_rate():
    s = system_of("two_mass+backlash", {**TWO, "alpha": 0.0})
    assert not s.f(np.array([0.3, 0.0, 1.0, -1.0, 0.0]), 0.0).any()
    assert not s.f(np.array([-0.3, 0.0, -1.0, 1.0, 0.0]), 0.0).any()


def test_current_control__equals_equation_16():
    T_1 = 0.004
    plain = system_of("two_mass", TWO)
    s = system_of("two_mass+current_control", {**TWO, "T_1": T_1})
    A = np.block([[plain.A, plain.B], [np.zeros((1, 4)), -np.eye(1) / T_1]])
    np.testing.assert_allclose(s.A, A, **EXACT)
    np.testing.assert_allclose(s.B[:, 0], [0, 0, 0, 0, 1 / T_1], **EXACT)
    np.testing.assert_allclose(s.C, np.hstack([plain.C, plain.D]), **EXACT)
    assert not s.D.any()
    assert s.state_names == ("q1", "q2", "v1", "v2", "T")
    np.testing.assert_array_equal(s.rest(position=0.5, speed=2.0, u=3.0), [0.5, 0.5, 2, 2, 3])


def test_delay__changes_nothing_but_the_dead_time():
    plain, s = system_of("two_mass", TWO), system_of("two_mass+delay", {**TWO, "T_d": 0.003})
    for name in ("A", "B", "C", "D"):
        np.testing.assert_array_equal(getattr(s, name), getattr(plain, name))
    assert (plain.dead_time, s.dead_time) == (0.0, 0.003)


@pytest.mark.parametrize("number", [*range(0, 448, 9), 448, 449, 450])
def test_linearise__equals_finite_differences(number):
    structure = ALL[number]
    rng = np.random.default_rng(number)
    s = assemble(structure, random_values(structure.parameters, rng), 2.5, OUTPUTS)
    x, u = rng.normal(size=len(s.states)), float(rng.normal())
    x[[name.startswith("lambda") for name in s.state_names]] = -1e-4  # inside any gap drawn: f_lambda is smooth
    linear = s.linearise(x, u)
    for j, step in enumerate(1e-6 * np.eye(len(x))):
        h = 2.0 * step[j]
        for exact, of in ((linear.A, s.derivative), (linear.C, s.output)):
            difference = (of(x + step, u) - of(x - step, u)) / h
            # Rounding: 1e-16 of the largest addend over the step; truncation is step^2 f_tanh^2.
            np.testing.assert_allclose(difference, exact[:, j], atol=1e-8 * np.abs(linear.A).max(), rtol=1e-6)
    for exact, of in ((linear.B, s.derivative), (linear.D, s.output)):
        difference = (of(x, u + 0.5) - of(x, u - 0.5)) / 1.0
        np.testing.assert_allclose(difference, exact[:, 0], atol=1e-9 * np.abs(linear.A).max(), rtol=1e-9)


@pytest.mark.parametrize("number", [*range(4, 448, 37), 448, 449, 450])
def test_assemble__batch__equals_its_members(number):
    structure = ALL[number]
    sets = [random_values(structure.parameters, np.random.default_rng([number, k])) for k in range(5)]
    together = {name: np.array([values[name] for values in sets]) for name in structure.parameters}
    batch = assemble(structure, together, 2.5, OUTPUTS)
    assert batch.batch == (5,)
    for k, values in enumerate(sets):
        single = assemble(structure, values, 2.5, OUTPUTS)
        for name in ("A", "B", "C", "D"):
            np.testing.assert_array_equal(getattr(batch, name)[..., k], getattr(single, name))
        np.testing.assert_array_equal(np.broadcast_to(batch.dead_time, 5)[k], single.dead_time)
        for many, one in zip(batch.elements, single.elements, strict=True):
            for a, b in zip((many.H, many.G, many.K, *many.p), (one.H, one.G, one.K, *one.p), strict=True):
                np.testing.assert_array_equal(np.broadcast_to(np.asarray(a), (*np.shape(b), 5))[..., k], b)


def test_assemble__states__in_the_order_of_the_design():
    for structure in ALL:
        values = dict.fromkeys(structure.parameters, 1.0)
        n = structure.masses
        names = [f"{q}{i + 1}" for q in "qv" for i in range(n)]
        tail = assemble(structure, values, 1.0).state_names[2 * n :]
        assert assemble(structure, values, 1.0).state_names[: 2 * n] == tuple(names)
        assert tail in ((), ("lambda1",), ("lambda2",), ("T",), ("lambda1", "T"))
        assert len(tail) == sum(p.effect.has_states and not p.effect.masses for p in structure.placed)


def test_assemble__wrong_values_or_outputs__refused():
    with pytest.raises(SettingsError, match="no value for parameter d1"):
        system_of("two_mass", {k: v for k, v in TWO.items() if k != "d1"})
    with pytest.raises(SettingsError, match="Did you mean 'J1'"):
        system_of("two_mass", {**TWO, "j1": 1.0})
    with pytest.raises(SettingsError, match="Did you mean 'velocity'"):
        system_of("two_mass", TWO, outputs=("velocitty",))
    with pytest.raises(SettingsError, match="actuator at mass 3: 'two_mass' has masses 1 to 2"):
        assemble(Structure.parse("two_mass"), TWO, 1.0, actuator=3)


def test_assemble__every_effect_with_a_law__is_covered():
    seen = {e.name.split("@")[0] for s in ALL for e in assemble(s, dict.fromkeys(s.parameters, 1.0), 1.0).elements}
    assert seen == {name for name, effect in registry().items() if effect.law is not None}
