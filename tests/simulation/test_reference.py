"""The reference solvers against closed formulas, against each other and against the construction kit."""

import math
from dataclasses import replace

import numpy as np
import pytest

from brightgrey.errors import BrightgreyError, SettingsError, StructureError
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER, Structure, assemble
from brightgrey.simulation.reference import UnsettledError, compare_solvers, reference
from brightgrey.simulation.reference.adaptive import DriveEquations, Phase
from brightgrey.simulation.reference.plant import Plant

DT = 1e-3
T = np.arange(200) * DT
ALL = list(PAPER.structures())
METHODS = pytest.mark.parametrize("method", ["fixed", "events"])

# What both methods reach on smooth, short problems: their tolerances, times a few.
EXACT = {"rtol": 1e-8, "atol": 1e-9}


def solve(structure, values, u, method, f_tanh=1.0, **options):
    return reference(structure, values, u, DT, f_tanh=f_tanh, method=method, **options)


@METHODS
def test_reference__viscous_friction__step_response(method):
    values = {"J1": 0.3, "f_v": 2.0}
    kinds = ("position", "velocity", "acceleration")
    q, v, a = solve("one_mass+viscous", values, np.full(200, 5.0), method, outputs=kinds)
    rate = 2.0 / 0.3
    expected = 2.5 * (1.0 - np.exp(-rate * T))
    np.testing.assert_allclose(v, expected, **EXACT)
    np.testing.assert_allclose(q, 2.5 * T - expected / rate, **EXACT)
    np.testing.assert_allclose(a, 2.5 * rate * np.exp(-rate * T), **EXACT)


@METHODS
def test_reference__two_masses__swing_at_their_resonance(method):
    J1, J2, c = 0.012, 0.008, 75.0
    values = {"J1": J1, "J2": J2, "c1": c, "d1": 0.0}
    omega = np.sqrt(c * (1 / J1 + 1 / J2))
    x0 = np.array([0.02, -0.03, 0.0, 0.0])
    q1, q2 = solve("two_mass", values, np.zeros(200), method, x0=x0, outputs=("q1", "q2"))
    np.testing.assert_allclose(q1 - q2, 0.05 * np.cos(omega * T), atol=1e-9)
    np.testing.assert_allclose(J1 * q1 + J2 * q2, 0.0, atol=1e-12)  # nothing pushes the whole


@METHODS
def test_reference__current_loop_of_ten_microseconds__step_response(method):
    u = np.where(T >= 0.05, 1.0, 0.0)
    v, T_motor = solve("one_mass+current_control", {"J1": 1.0, "T_1": 1e-5}, u, method, hold="zoh", outputs=("v1", "T"))
    since = np.clip(T - 0.05, 0.0, None)
    np.testing.assert_allclose(T_motor, -np.expm1(-since / 1e-5), **EXACT)
    np.testing.assert_allclose(v, since + 1e-5 * np.expm1(-since / 1e-5), **EXACT)


@METHODS
def test_reference__current_loop__starts_at_the_first_input(method):
    (v,) = solve("one_mass+current_control", {"J1": 2.0, "T_1": 0.02}, np.full(200, 3.0), method)
    np.testing.assert_allclose(v, 1.5 * T, **EXACT)


@METHODS
def test_reference__coulomb_far_from_standstill__constant_torque(method):
    # tanh(10 v) is 1 to the last digit while v > 2
    values = {"J1": 0.5, "M_C": 3.0, "M_G": 1.0}
    (v,) = solve("one_mass+coulomb+gravity", values, np.zeros(200), method, f_tanh=10.0, x0=np.array([0.0, 8.0]))
    np.testing.assert_allclose(v, 8.0 - 2.0 / 0.5 * T, **EXACT)


@METHODS
def test_reference__torque_below_breakaway__creeps(method):
    # Below breakaway the balance is M_C tanh(f v) = u, reached with the time constant J/(f M_C) = 0.5 ms.
    (v,) = solve("one_mass+coulomb", {"J1": 0.01, "M_C": 2.0}, np.ones(200), method, f_tanh=10.0)
    np.testing.assert_allclose(v[50:], np.arctanh(0.5) / 10.0, **EXACT)


@METHODS
def test_reference__mirrored_torque__mirrored_motion(method):
    values = {"J1": 0.02, "M_C": 0.5, "M_S": 0.4, "omega_S": 3.0, "f_v": 0.01}
    u = 3.0 * np.sin(40.0 * T)
    one, other = (solve("one_mass+coulomb+viscous+stribeck", values, s * u, method, f_tanh=2.0) for s in (1, -1))
    np.testing.assert_array_equal(one, -other)
    assert np.min(one) < 0.0 < np.max(one)


@METHODS
@pytest.mark.parametrize("hold", ["linear", "zoh"])
@pytest.mark.parametrize("samples", [3.0, 2.4, 0.3])
def test_reference__delay__shifts_the_input(method, hold, samples):
    u = np.random.default_rng(2).normal(size=200)
    T_d = samples * DT
    (v,) = solve("one_mass+delay", {"J1": 0.5, "T_d": T_d}, u, method, hold=hold)
    # v is the integral of the delayed input: exact on a grid of tenths of a sample that holds all knots.
    fine = (np.arange(1990) + 0.5) * DT / 10 - T_d
    held = u[np.clip(np.floor(fine / DT).astype(int), 0, None)]
    delayed = np.interp(fine, T, u) if hold == "linear" else held
    expected = np.append(0.0, np.cumsum(delayed)[9::10]) * DT / 10 / 0.5
    np.testing.assert_allclose(v, expected, atol=1e-12)


BACKLASH = {"J1": 0.02, "J2": 0.01, "c1": 40.0, "d1": 0.02, "alpha": 0.05}


@METHODS
def test_reference__open_gap__free_flight(method):
    # The twist differs from lambda: tau = 0.02 relaxes with c/d = 2000 1/s, and no mass feels any torque.
    x0 = np.array([-0.02, 0.0, 0.3, 0.1, -0.04])
    names = ("q1", "q2", "v1", "v2", "lambda1")
    q1, q2, v1, v2, gap = solve("two_mass+backlash", BACKLASH, np.zeros(200), method, x0=x0, outputs=names)
    free = -0.02 + 0.2 * T - 0.02 * np.exp(-2000.0 * T)
    flying = free < -1e-9  # contact where lambda = 0, after 0.1 s
    assert 100 <= flying.sum() <= 101
    for found, expected in ((q1, -0.02 + 0.3 * T), (q2, 0.1 * T), (v1, 0.3), (v2, 0.1), (gap, free)):
        np.testing.assert_allclose(found[flying], np.broadcast_to(expected, 200)[flying], atol=1e-10)


@METHODS
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_reference__impact__rebounds_with_known_speeds(method, side):
    """From the middle of the gap: contact lasts until c tau + d tau' = 0, the speeds after it are known."""
    v = 0.4
    x0 = np.array([0.0, 0.05, side * v, 0.0, -0.05])
    v1, v2, gap = solve("two_mass+backlash", BACKLASH, np.zeros(400), method, x0=x0, outputs=("v1", "v2", "lambda1"))
    J1, J2, c, d = (BACKLASH[k] for k in ("J1", "J2", "c1", "d1"))
    both = 1 / J1 + 1 / J2
    sigma, omega0 = 0.5 * d * both, np.sqrt(c * both)
    omega = np.sqrt(omega0**2 - sigma**2)
    # tau = v/omega e^(-sigma t) sin(omega t); c tau + d tau' = 0 where tan(omega t) = -d omega/(c - d sigma)
    until = (np.pi - np.arctan2(d * omega, c - d * sigma)) / omega
    rate = v * np.exp(-sigma * until) * (np.cos(omega * until) - sigma / omega * np.sin(omega * until))
    contact = 0.05 / v
    t = np.arange(400) * DT
    after = (t > contact + until) & (np.abs(gap + 0.05) < 0.0499)
    assert after.sum() > 20
    impulse = side * (v - rate) / both
    np.testing.assert_allclose(v1[after], side * v - impulse / J1, atol=1e-9)
    np.testing.assert_allclose(v2[after], impulse / J2, atol=1e-9)
    resting = (t > contact) & (t < contact + until)
    assert np.all(gap[resting] == (0.0 if side > 0 else -0.1))


def test_reference__gap_of_no_width__same_bits_as_no_gap():
    values = {"J1": 0.012, "J2": 0.008, "c1": 75.0, "d1": 0.036}
    u = np.sin(60.0 * T)
    for method in ("fixed", "events"):
        one = solve("two_mass", values, u, method)
        other = solve("two_mass+backlash", values | {"alpha": 0.0}, u, method)
        np.testing.assert_array_equal(one, other)


@METHODS
def test_reference__exact_friction_under_a_ramp__breaks_away_at_its_instant(method):
    # Mass 1 holds until u = 30 t passes M_C + M_S = 2.5 at t = 0.0833, and the torque beyond that accelerates it.
    values = {"J1": 0.1, "M_C": 2.5, "f_v": 0.0}
    v, a = solve("one_mass+coulomb+viscous", values, 30.0 * T, method, math.inf, outputs=("v1", "acceleration"))
    since = np.clip(T - 2.5 / 30.0, 0.0, None)
    assert np.all(v[since == 0.0] == 0.0)
    np.testing.assert_allclose(v, 30.0 * since**2 / 2.0 / 0.1, atol=1e-12)
    np.testing.assert_allclose(a, 30.0 * since / 0.1, atol=1e-10)


@METHODS
def test_reference__exact_friction__stops_and_is_held_against_gravity(method):
    values = {"J1": 0.5, "M_C": 3.0, "M_G": -1.0}
    x0 = np.array([0.0, -0.3])
    q, v = solve("one_mass+coulomb+gravity", values, np.zeros(200), method, math.inf, x0=x0, outputs=("q1", "v1"))
    stop = 0.3 / (2.0 / 0.5)
    left = np.clip(stop - T, 0.0, None)
    np.testing.assert_allclose(v, -4.0 * left, atol=1e-12)
    np.testing.assert_allclose(q, -2.0 * (stop**2 - left**2), atol=1e-12)
    assert np.all(v[stop + DT <= T] == 0.0)


@METHODS
def test_reference__exact_friction_and_reversing_torque__drives_straight_on(method):
    # From -5 rad/s, a torque of 4 against a friction of 1 brakes with 5/J and then accelerates with 3/J.
    (v,) = solve(
        "one_mass+coulomb", {"J1": 0.1, "M_C": 1.0}, np.full(200, 4.0), method, math.inf, x0=np.array([0, -5.0])
    )
    np.testing.assert_allclose(v, np.where(T < 0.1, 50.0, 30.0) * (T - 0.1), atol=1e-11)


@pytest.mark.parametrize(("method", "seconds"), [("events", 100), ("fixed", 2)])
def test_reference__exact_friction_below_breakaway__does_not_move(method, seconds):
    values = {"J1": 0.02, "J2": 0.01, "c1": 40.0, "d1": 0.02, "M_C": 1.0, "M_S": 0.5, "omega_S": 2.0}
    torque = np.full(2 * seconds, 0.9 * 1.5)
    options = {"f_tanh": math.inf, "method": method, "outputs": ("q1", "q2", "v1", "v2", "acceleration")}
    assert np.all(reference("two_mass+coulomb+stribeck", values, torque, 0.5, **options) == 0.0)


SAMPLE = [
    *("one_mass+coulomb+viscous+stribeck+gravity+current_control+delay", "two_mass+coulomb+viscous+stribeck"),
    *("two_mass+coulomb+viscous+backlash+current_control+delay", "three_mass+stribeck+delay"),
    *("three_mass+coulomb+gravity+backlash", "four_mass+viscous+current_control"),
    "four_mass+coulomb+viscous+stribeck+gravity+backlash+current_control+delay",
]


@pytest.mark.parametrize("hold", ["linear", "zoh"])
@pytest.mark.parametrize("name", SAMPLE)
def test_compare_solvers__random_drives__methods_agree(name, hold):
    values = random_values(Structure.parse(name).parameters, np.random.default_rng(len(name)))
    found = compare_solvers(name, values, E.torque()[:1000:2], E.dt, f_tanh=E.f_tanh, hold=hold)
    assert not found.chaotic  # drawn so; the long test counts the chaotic ones
    assert np.max(found.difference) < 1e-6


@pytest.mark.parametrize("name", [*SAMPLE[:2], *SAMPLE[3:5]])
def test_compare_solvers__exact_friction__methods_agree(name):
    values = random_values(Structure.parse(name).parameters, np.random.default_rng(len(name)))
    found = compare_solvers(name, values, E.torque()[:500], E.dt, f_tanh=math.inf)
    assert not found.chaotic
    assert np.max(found.difference) < 1e-6


def test_reference__impact_on_a_mass_that_sticks__breaks_it_away():
    """Mass 2 flies through the gap for 1/60 s; its impact of d v = 1.2 N m and the torque exceed the friction."""
    values = BACKLASH | {"d1": 0.4, "M_C": 1.0}
    x0 = np.array([0.0, 0.05, 0.0, -3.0, -0.05])
    one, other = (
        solve("two_mass+coulomb+backlash", values, np.full(100, -0.5), method, math.inf, x0=x0, outputs=("v1", "v2"))
        for method in ("fixed", "events")
    )
    np.testing.assert_allclose(one, other, atol=1e-9)
    assert np.all(one[0, :17] == 0.0)
    assert one[0, 17] < 0.0


def test_reference__steeper_smoothed_sign__converges_to_exact_friction():
    """With the gain f the error falls as 1/f, where a mass creeps at rest as log(f)/f."""
    values = random_values(Structure.parse("two_mass+coulomb+stribeck").parameters, np.random.default_rng(3))
    u = E.torque()[:900]
    (exact,) = reference("two_mass+coulomb+stribeck", values, u, E.dt, f_tanh=math.inf)
    errors = []
    for gain in (1e3, 1e4, 1e5):
        (v,) = reference("two_mass+coulomb+stribeck", values, u, E.dt, f_tanh=gain / np.max(np.abs(exact)))
        errors.append(np.max(np.abs(v - exact)) / np.max(np.abs(exact)))
    shrinks = np.divide(errors[:2], errors[1:])
    assert np.all((shrinks > 7.0) & (shrinks < 11.0))
    assert errors[-1] < 1e-4


@pytest.mark.long
@pytest.mark.parametrize("f_tanh", [E.f_tanh, math.inf])
@pytest.mark.parametrize("part", range(8))
def test_compare_solvers__every_structure__methods_agree(part, f_tanh):
    chaotic = 0
    for i, structure in list(enumerate(ALL))[part::8]:
        values = random_values(structure.parameters, np.random.default_rng([11, i]))
        found = compare_solvers(structure, values, E.torque(), E.dt, f_tanh=f_tanh)
        chaotic += found.chaotic
        assert found.chaotic or np.max(found.difference[:2]) < 1e-6, f"{structure} {values}"
    assert chaotic <= 0.2 * len(ALL[part::8])


def test_solve_adaptive__stiff_drive__implicit_solver_agrees():
    """Radau against both: a light motor whose friction is as steep as 6e4 1/s."""
    from brightgrey.simulation.reference import adaptive as events
    from brightgrey.simulation.reference.plant import cut

    name = "two_mass+coulomb+stribeck"
    values = {"J1": 1e-4, "J2": 0.02, "c1": 20.0, "d1": 0.01, "M_C": 1.5, "M_S": 0.9, "omega_S": 4.0}
    u = 4.0 * np.sin(25.0 * T[:120])
    plant = Plant.of(name, values, 2.5)
    segments = cut(u, DT, 0.0, "linear")
    radau = events.solve_adaptive(plant, segments, plant.initial(None, 0.0), rtol=1e-8, implicit=True).output("v1")
    for method in ("fixed", "events"):
        (v,) = solve(name, values, u, method, f_tanh=2.5)
        assert np.max(np.abs(v - radau)) < 1e-6 * np.max(np.abs(v))


CHAOTIC = "four_mass+stribeck+gravity+backlash+delay"


def test_reference__chaotic_drive__measured_and_refused():
    index = sorted(map(str, ALL)).index(CHAOTIC)
    values = random_values(Structure.parse(CHAOTIC).parameters, np.random.default_rng([7, index]))
    found = compare_solvers(CHAOTIC, values, E.torque(), E.dt, f_tanh=E.f_tanh, both=False)
    assert found.chaotic
    assert np.max(found.growth[:2]) > 1e-5
    assert np.all(np.isnan(found.difference))
    with pytest.raises(UnsettledError, match="still changes"):
        reference(CHAOTIC, values, E.torque(), E.dt, f_tanh=E.f_tanh)


@METHODS
def test_reference__input_on_the_last_mass__is_the_drive_seen_from_its_other_end(method):
    values = {"J1": 0.012, "J2": 0.008, "c1": 75.0, "d1": 0.036, "M_C": 0.3, "f_v@2": 0.02, "T_1": 1e-3}
    other = {"J2": 0.012, "J1": 0.008, "c1": 75.0, "d1": 0.036, "M_C@2": 0.3, "f_v": 0.02, "T_1": 1e-3}
    u = 2.0 * np.sin(40.0 * T)
    found = solve(
        "two_mass+coulomb+viscous@2+current_control", values, u, method, 50.0, outputs=("v1", "v2"), actuator=2
    )
    seen = solve("two_mass+coulomb@2+viscous+current_control", other, u, method, 50.0, outputs=("v2", "v1"))
    np.testing.assert_allclose(found, seen, **EXACT)


@pytest.mark.parametrize("from_the_end", [False, True])
@pytest.mark.parametrize("structure", ALL[::9], ids=str)
def test_construction_kit__right_hand_side__equals_newtons_law(structure, from_the_end):
    """x' of the assembled state space equals Newton's law, in contact and in the gap."""
    rng = np.random.default_rng(1)
    values = random_values(structure.parameters, rng)
    actuator = structure.masses if from_the_end else 1
    system = assemble(structure, values, 2.5, ("acceleration",), actuator)
    plant = Plant.of(str(structure), values, 2.5, actuator)
    assert system.state_names == plant.state_names
    n = plant.masses
    drive = DriveEquations(plant, None, 1e-9, np.zeros(1))
    for _ in range(20):
        x, u = rng.normal(size=len(system.states)), float(rng.normal())
        phase = Phase(None, slides=(None,) * n)
        has_gap = plant.alpha is not None
        y = np.concatenate([x[:1], x[: n - 1] - x[1:n], x[n : 2 * n], x[2 * n + has_gap :]])
        if has_gap:
            pick = rng.integers(3)
            x[2 * n] = (0.0, -2.0 * plant.alpha, -plant.alpha)[pick]
            phase = Phase((1, -1, 0)[pick], x[2 * n], slides=(None,) * n)
            if phase.side and drive.contact_guard(y, 0.0, phase) < 0.0:
                phase = replace(phase, side=0)
        expected = np.array(drive.rates(y.tolist(), u, phase))
        found = system.derivative(x, u)
        scale = np.max(np.abs(system.A), axis=1) * 10.0 + np.abs(found)
        rows = [*range(n, 2 * n), *([] if plant.T_1 is None else [len(x) - 1])]
        assert np.all(np.abs(found[rows] - expected[n:]) <= 1e-11 * scale[rows])
        np.testing.assert_allclose(system.output(x, u), found[n], atol=1e-11 * scale[n])


@pytest.mark.parametrize(
    ("structure", "values", "options", "error", "message"),
    [
        ("one_mass+colomb", {"J1": 1.0}, {}, StructureError, "coulomb"),
        ("coulomb", {"M_C": 1.0}, {}, StructureError, "exactly one"),
        ("one_mass+backlash", {"J1": 1.0, "alpha": 0.1}, {}, StructureError, "one mass"),
        ("one_mass", {}, {}, SettingsError, "no value for parameter J1"),
        ("one_mass", {"J1": 1.0, "M_C": 1.0}, {}, SettingsError, "unknown parameter"),
        ("one_mass", {"J1": 0.0}, {}, SettingsError, "J1 = 0"),
        ("one_mass", {"J1": 1.0}, {"x0": np.zeros(3)}, SettingsError, "2 finite numbers: q1, v1"),
        ("one_mass", {"J1": 1.0}, {"actuator": 2}, SettingsError, "has masses 1 to 1"),
        ("one_mass", {"J1": 1.0}, {"hold": "foh"}, SettingsError, "zoh"),
        ("one_mass", {"J1": 1.0}, {"method": "event"}, SettingsError, "events"),
        ("one_mass", {"J1": 1.0}, {"outputs": ("speed",)}, SettingsError, "velocity"),
        ("one_mass", {"J1": 1.0}, {"f_tanh": 0.0}, SettingsError, "f_tanh = 0"),
        ("one_mass", {"J1": 1.0}, {"f_tanh": math.nan}, SettingsError, "f_tanh = nan"),
        ("one_mass+coulomb", {"J1": 1.0, "M_C": -1.0}, {"f_tanh": math.inf}, SettingsError, "must not be negative"),
        ("two_mass+backlash", BACKLASH | {"d1": 0.0}, {}, SettingsError, "d1 must be positive"),
        ("two_mass+backlash", BACKLASH, {"x0": np.array([0, 0, 0, 0, 0.1])}, SettingsError, "outside"),
        ("one_mass+viscous", {"J1": 1e-6, "f_v": -1.0}, {"x0": np.ones(2)}, UnsettledError, "finite"),
    ],
)
def test_reference__wrong_use__names_what_is_allowed(structure, values, options, error, message):
    options = {"f_tanh": 1.0} | options
    with pytest.raises(error, match=message) as caught:
        reference(structure, values, np.zeros(20), DT, **options)
    assert isinstance(caught.value, BrightgreyError)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("u", [np.zeros(1), np.array([0.0, np.nan]), np.zeros((2, 2))])
def test_reference__input_no_row_of_numbers__refused(u):
    with pytest.raises(SettingsError, match="row of at least two"):
        reference("one_mass", {"J1": 1.0}, u, DT, f_tanh=1.0)
