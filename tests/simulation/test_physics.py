"""Physics that every simulation has to keep, over random legal structures.

Tolerances are those of the level `accurate`, 1e-4 of a signal's peak, carried through the quantity compared.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from brightgrey.effects import registry
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER, Structure, assemble
from brightgrey.simulation import Settings, response
from support.states import all_states

ALL = list(PAPER.structures())
TORQUE = E.torque()
DT = E.dt
ACCURATE = 1e-4
SETTINGS = Settings(E.f_tanh, E.speed)
GAPS = [i for i, s in enumerate(ALL) if "backlash" in s.names]
RUBBING = [i for i, s in enumerate(ALL) if any(p.effect.law and p.effect.law.dissipative for p in s.placed)]
DELAYED = [i for i, s in enumerate(ALL) if "delay" in s.names]
ANY = st.integers(0, len(ALL) - 1)
SEEDS = st.integers(0, 2**32 - 1)  # of the parameter values
drawn = settings(max_examples=15, deadline=None, derandomize=True)


def drive(number, seed=0, **fixed):
    structure = ALL[number]
    rng = np.random.default_rng([number, seed])
    values = random_values(structure.parameters, rng)
    return structure, {**values, **{k: v for k, v in fixed.items() if k in values}}, rng


def run(s, u, x0, settings=SETTINGS, dt=DT, **options):
    r = response(s, u, dt, x0, settings, **options)
    assert (r.diverged == -1).all()
    return dict(zip(s.outputs, r.y[..., 0], strict=True))


def close(found, known, share=ACCURATE):
    """Compare within a share of the peak."""
    np.testing.assert_allclose(found, known, rtol=0.0, atol=share * np.abs(known).max() + 1e-300)


def state_of(s, values, y, k):
    return np.array([y[name][k] for name in s.state_names])


def twists(structure, y):
    n = structure.masses
    d = [y[f"q{k}"] - y[f"q{k + 1}"] for k in range(1, n)]
    if "lambda1" in y:
        d[0] = d[0] - y["lambda1"]
    return d


def energy(structure, values, y):
    """Kinetic energy, springs, and gravity's potential."""
    n = structure.masses
    kinetic = sum(0.5 * values[f"J{i}"] * y[f"v{i}"] ** 2 for i in range(1, n + 1))
    springs = sum(0.5 * values[f"c{k}"] * d**2 for k, d in enumerate(twists(structure, y), 1))
    return kinetic + springs - values.get("M_G", 0.0) * y["q1"]


def moving(structure, s, values, rng):
    """Start with masses in motion at different speeds and twisted shafts; inside the gap if there is one."""
    x = np.zeros(len(s.states))
    for i, state in enumerate(s.states):
        if state.name.startswith("v"):
            x[i] = 20.0 * rng.uniform(-1, 1)
        elif state.name.startswith("q"):
            x[i] = 0.02 * rng.uniform(-1, 1)
        elif state.name == "T":
            x[i] = 4.0 * rng.uniform(-1, 1)
        else:
            x[i] = -2.0 * values["alpha"] * rng.uniform()
    return x


@drawn
@given(number=ANY, seed=SEEDS)
def test_energy__no_input__never_grows(number, seed):
    structure, values, rng = drive(number, seed)
    s = all_states(structure, values)
    x0 = moving(structure, s, values, rng)
    fine = 1e-4
    y = run(s, np.zeros(3000), x0, dt=fine)
    total = energy(structure, values, y)
    if "T" in y:
        # The loop's stored torque goes on driving mass 1 and does this work, by the trapezium rule; its error
        # is h^3/12 of the second derivative in each step.
        power = y["T"] * y["v1"]
        work = np.concatenate([[0.0], np.cumsum(0.5 * fine * (power[1:] + power[:-1]))])
        total = total - work
        slack = fine**2 / 12.0 * np.sum(np.abs(np.diff(power, 2))) / fine
    else:
        slack = 0.0
    # 1e-4 of the peak of speed and position leaves twice that on each energy.
    peak = np.abs(energy(structure, {**values, "M_G": 0.0}, y)).max()
    peak += abs(values.get("M_G", 0.0)) * np.ptp(y["q1"])
    assert np.diff(total).max() <= 2 * ACCURATE * peak + slack
    assert (total - np.minimum.accumulate(total)).max() <= 2 * ACCURATE * peak + slack


@drawn
@given(number=st.sampled_from(RUBBING), seed=SEEDS)
def test_friction__any_motion__takes_energy_only(number, seed):
    """Power balance at mass 1: what friction takes is what is left of all other torques."""
    structure, values, _ = drive(number, seed)
    s = all_states(structure, values)
    y = run(s, TORQUE, s.rest(u=TORQUE[0]))
    v1 = y["v1"]
    shaft = sum(values[f"J{i}"] * y[f"v{i}'"] for i in range(2, structure.masses + 1))  # moves all the others
    t = np.arange(len(TORQUE)) * DT
    delayed = np.interp(t - values.get("T_d", 0.0), t, TORQUE)
    motor = y.get("T", delayed)
    friction = values["J1"] * y["v1'"] + shaft - motor - values.get("M_G", 0.0)
    power = friction * v1
    assert power.max() <= ACCURATE * np.abs(power).max()


@drawn
@given(number=st.sampled_from(GAPS), seed=SEEDS)
def test_backlash__torque__pushes_only_at_the_ends_of_the_gap(number, seed):
    structure, values, _ = drive(number, seed)
    s = all_states(structure, values)
    y = run(s, TORQUE, s.rest(u=TORQUE[0]))
    gap, width = y["lambda1"], 2.0 * values["alpha"]
    torque = sum(values[f"J{i}"] * y[f"v{i}'"] for i in range(2, structure.masses + 1))
    assert gap.max() <= 0.0
    assert gap.min() >= -width * (1 + 1e-15)
    at_top, at_bottom = gap == 0.0, gap <= -width
    inside = (gap < -1e-9 * width) & (gap > -width * (1 - 1e-9))
    slack = 1e-9 * np.abs(torque).max()
    assert torque[at_top].min(initial=0.0) >= -slack
    assert torque[at_bottom].max(initial=0.0) <= slack
    assert np.abs(torque[inside]).max(initial=0.0) <= slack
    assert at_top.any()


@drawn
@given(number=ANY, seed=SEEDS)
def test_backlash__mirrored_input__mirrored_motion(number, seed):
    structure, values, _ = drive(number, seed)
    s = all_states(structure, values)
    x0 = s.rest(u=TORQUE[0])
    opposite = {**values, "M_G": -values["M_G"]} if "M_G" in values else values
    other = all_states(structure, opposite)
    x1 = -x0
    if "lambda1" in s.state_names:
        # Left: shaft relaxed at lambda = -alpha. Twist q1 - q2 is mirrored about -alpha, lambda with it.
        i = s.state_names.index("lambda1")
        x0[i] = -0.5 * values["alpha"]
        x1[i] = -2.0 * values["alpha"] - x0[i]
        x0[0] += x0[i]
        x1[0] = -x0[0] - 2.0 * values["alpha"]  # q1 takes the shift, so q2.. stay mirrored about 0
    y = run(s, TORQUE[:900], x0)
    pushed = run(s, TORQUE[:900] * (1.0 + 1e-9), x0)
    # Mirror images are computed by the same operations up to rounding, which contacts amplify.
    growth = max(np.abs(pushed[name] - y[name]).max() / (np.abs(y[name]).max() or 1.0) for name in s.state_names)
    assume(growth <= 1e-5)
    z = run(other, -TORQUE[:900], x1)
    for name in s.state_names:
        shift = -2.0 * values["alpha"] if name in ("lambda1", "q1") and "alpha" in values else 0.0
        close(z[name], shift - y[name], 1e-6)


@drawn
@given(number=st.sampled_from(GAPS), seed=SEEDS)
def test_backlash__no_width__equals_no_backlash(number, seed):
    structure, values, _ = drive(number, seed, alpha=0.0)
    without = Structure(tuple(p for p in structure.placed if p.name != "backlash"))
    plain = all_states(without, {k: v for k, v in values.items() if k != "alpha"})
    y = run(plain, TORQUE, plain.rest(u=TORQUE[0]))
    peak = np.abs(y["q1"]).max()
    for alpha, share in ((0.0, ACCURATE), (1e-9 * peak, 2 * ACCURATE)):
        s = all_states(structure, {**values, "alpha": alpha})
        z = run(s, TORQUE, s.rest(u=TORQUE[0]))
        for name in ("q1", "v1"):
            close(z[name], y[name], share)


@pytest.mark.parametrize(
    "effect", [e for e in registry().values() if any(q.size for q in e.parameters)], ids=lambda e: e.name
)
@pytest.mark.parametrize("number", [0, 3])
def test_effect__size_zero__vanishes(effect, number):
    """A hundred-millionth stands for nothing, where a lag of zero would be divided by."""
    without = PAPER.parse("two_mass+coulomb+viscous" if effect.name not in ("coulomb", "viscous") else "two_mass")
    structure = Structure.of([*without.names, effect.name])
    values = random_values(structure.parameters, np.random.default_rng(number))
    values |= {q.symbol: 1e-8 * values[q.symbol] for q in effect.parameters if q.size}
    s, rest = (assemble(a, {n: values[n] for n in a.parameters}, E.f_tanh) for a in (structure, without))
    y, known = (response(a, TORQUE, DT, a.rest(u=TORQUE[0]), SETTINGS).y for a in (s, rest))
    np.testing.assert_allclose(y, known, rtol=0, atol=2.0 * ACCURATE * np.abs(known).max())


@pytest.mark.parametrize("masses", ["two_mass", "three_mass", "four_mass"])
def test_mass_chain__no_damping__keeps_momentum_and_energy(masses):
    structure = PAPER.parse(masses)
    values = random_values(structure.parameters, np.random.default_rng(7))
    values |= {k: 1e-12 * values[k] for k in values if k.startswith("d")}
    s = all_states(structure, values)
    rng = np.random.default_rng(8)
    y = run(s, np.zeros(1800), moving(structure, s, values, rng))
    momentum = sum(values[f"J{i}"] * y[f"v{i}"] for i in range(1, structure.masses + 1))
    size = sum(values[f"J{i}"] * np.abs(y[f"v{i}"]).max() for i in range(1, structure.masses + 1))
    np.testing.assert_allclose(momentum, momentum[0], rtol=0, atol=1e-10 * size)
    total = energy(structure, values, y)
    np.testing.assert_allclose(total, total[0], rtol=2 * ACCURATE)


def test_two_mass__frequency_response__resonance_and_antiresonance():
    J1, J2, c = 0.012, 0.008, 75.0
    values = {"J1": J1, "J2": J2, "c1": c, "d1": 1e-12}
    structure = PAPER.parse("two_mass")
    s = all_states(structure, values)
    resonance, antiresonance = np.sqrt(c * (1 / J1 + 1 / J2)), np.sqrt(c / J2)
    linear = assemble(structure, values, 1.0).linearise(np.zeros(4))
    assert np.abs(np.linalg.eigvals(linear.A)).max() == pytest.approx(resonance, rel=1e-9)
    # Zeros of torque to speed: where the system pencil loses rank.
    at = 1j * antiresonance
    transfer = (linear.C @ np.linalg.solve(at * np.eye(4) - linear.A, linear.B) + linear.D)[0, 0]
    beside = (linear.C @ np.linalg.solve(0.9 * at * np.eye(4) - linear.A, linear.B))[0, 0]
    assert abs(transfer) <= 1e-6 * abs(beside)
    t = np.arange(1800) * DT
    y = run(s, np.zeros(1800), np.array([0.02, -0.03, 0.0, 0.0]))
    close(y["q1"] - y["q2"], 0.05 * np.cos(resonance * t))
    # Driven at the antiresonance with mass 2 swinging against the torque, mass 1 stands still.
    fine = 1e-4
    wave = np.sin(antiresonance * np.arange(3000) * fine)
    still = run(s, wave, np.array([0.0, 0.0, 0.0, -antiresonance / c]), dt=fine)
    # Straight lines between the samples leave (w h)^2/8 of the torque, which adds up over the wave's periods.
    bend = (antiresonance * fine) ** 2 / 8.0 * antiresonance * fine * len(wave)
    assert np.abs(still["v1"]).max() <= (ACCURATE + bend) * np.abs(still["v2"]).max()


@drawn
@given(number=st.sampled_from(DELAYED), seed=SEEDS, hold=st.sampled_from(["linear", "zoh"]))
def test_delay__input__is_shifted(number, seed, hold):
    structure, values, _ = drive(number, seed)
    how = replace(SETTINGS, hold=hold)
    without = Structure(tuple(p for p in structure.placed if p.name != "delay"))
    rest = {k: v for k, v in values.items() if k != "T_d"}
    plain = all_states(without, rest)
    shifted = np.concatenate([np.full(7, TORQUE[0]), TORQUE[:-7]])
    y = run(plain, shifted, plain.rest(u=TORQUE[0]), how)
    s = all_states(structure, {**values, "T_d": 7 * DT})
    z = run(s, TORQUE, s.rest(u=TORQUE[0]), how)
    for name in ("q1", "v1"):
        close(z[name], y[name], 1e-6)
    # A fraction of a sample: on a grid four times as fine the same input has its knots at the delay's end.
    grid = np.arange(4 * 1000) / 4.0
    fine = np.interp(grid, np.arange(len(TORQUE)), TORQUE) if hold == "linear" else TORQUE[grid.astype(int)]
    fine = np.concatenate([np.full(9, TORQUE[0]), fine[:-9]])
    y = run(plain, fine, plain.rest(u=TORQUE[0]), how, dt=DT / 4)
    s = all_states(structure, {**values, "T_d": 2.25 * DT})
    z = run(s, TORQUE[:1000], s.rest(u=TORQUE[0]), how)
    for name in ("q1", "v1"):
        close(z[name], y[name][::4], 2 * ACCURATE)


@drawn
@given(number=ANY, seed=SEEDS)
def test_acceleration__is_the_derivative_of_velocity(number, seed):
    structure, values, _ = drive(number, seed)
    s = assemble(structure, values, E.f_tanh, ("velocity", "acceleration"))
    fine = 1e-5
    u = np.interp(np.arange(3000) * fine, np.arange(30) * DT, 5.0 * np.sin(np.arange(30) * 0.4))
    y = run(s, u, s.rest(u=u[0]), dt=fine)
    v, a = y["velocity"], y["acceleration"]
    area = np.concatenate([[0.0], np.cumsum(0.5 * fine * (a[1:] + a[:-1]))])
    # Trapezium at 10 us; a jump of a at a contact leaves half a step's worth.
    jumps = 0.5 * fine * np.abs(np.diff(a)).max() * 4
    np.testing.assert_allclose(area, v - v[0], rtol=0, atol=ACCURATE * np.abs(v).max() + jumps)
