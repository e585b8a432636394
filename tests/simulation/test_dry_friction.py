"""Dry friction with an exact sign (f_tanh infinite): twin, known solutions, rest, breakaway, energy."""

import math
from dataclasses import replace

import numpy as np
import pytest

from brightgrey.errors import SettingsError
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER, Structure, assemble
from brightgrey.kit.structure import Placed
from brightgrey.simulation import Settings, response, shared_cores
from brightgrey.simulation.plain import plain_response
from brightgrey.simulation.reference import UnsettledError, compare_solvers

OUTPUTS = ("position", "velocity", "acceleration")
LEVELS, HOLDS = ("accurate", "fast"), ("linear", "zoh")
DT = E.dt
RUBBING = [s for s in PAPER.structures() if {"coulomb", "stribeck"} & set(s.names)]
FURTHER = {"M_C": 0.3, "M_S": 0.3, "omega_S": 1.0}


def structure_of(text, *further):
    """Structure of the paper's grammar, with further friction that it does not allow."""
    placed = PAPER.parse(text).placed
    return Structure((*placed, *map(Placed.parse, further)))


def torque_for(values, samples):
    """Slide and reverse, rest below breakaway for a third, then break away by a ramp and come to rest."""
    most = sum(values.get(name, 0.0) for name in ("M_C", "M_S"))
    third = samples // 3
    k = np.arange(third)
    slide = (2.0 * most + 1.0) * np.sin(2.5 * np.pi * k / third)
    rest = 0.5 * most * np.sin(0.1 * k)
    ramp = 1.6 * most * np.minimum(k / (0.4 * third), 1.0) * np.cos(np.pi * k / third)
    return np.concatenate([slide, rest, ramp, np.zeros(samples - 3 * third)]) - values.get("M_G", 0.0)


def drive(text, seed, samples, *further):
    structure = structure_of(text, *further)
    values = random_values(PAPER.parse(text).parameters, np.random.default_rng(seed))
    values |= {name: FURTHER[name.partition("@")[0]] for name in structure.parameters if "@" in name}
    values |= {name: max(values[name], 0.2) for name in ("M_C", "M_S") if name in values}
    return structure, values, torque_for(values, samples)


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize(
    ("text", "further", "hold"),
    [
        ("one_mass+coulomb+viscous+stribeck", (), "linear"),
        ("one_mass+coulomb+gravity+current_control+delay", (), "zoh"),
        ("two_mass+coulomb+stribeck", ("coulomb@2",), "linear"),
        ("three_mass+coulomb+viscous+stribeck+delay", ("stribeck@3",), "linear"),
        ("two_mass+coulomb+backlash+delay", ("coulomb@2",), "zoh"),
        ("two_mass+coulomb+stribeck+backlash+current_control", (), "linear"),
    ],
)
def test_kernel__dry_friction__equals_plain(text, further, hold, level):
    structure, values, u = drive(text, 3, 36 if "backlash" in text else 90, *further)
    system, how = assemble(structure, values, math.inf, OUTPUTS), Settings(math.inf, 10.0, level, hold)
    x0 = system.rest(u=u[0])
    fast, plain = response(system, u, DT, x0, how).y[:, :, 0], plain_response(system, u, DT, x0, how)
    for row, size in enumerate((np.max, np.max, lambda x: np.sqrt(np.mean(x**2)))):
        assert size(np.abs(fast[row] - plain[row])) <= 1e-8 * size(np.abs(plain[row])), OUTPUTS[row]
    assert (fast[1, 5:] == 0.0).any()


@pytest.mark.parametrize("number", range(0, len(RUBBING), 40), ids=lambda i: str(RUBBING[i]))
def test_levels__random_drives_that_rest_for_a_third__keep_their_accuracy(number):
    structure, values, u = drive(str(RUBBING[number]), number, 450)
    try:
        known = compare_solvers(structure, values, u, DT, f_tanh=math.inf, outputs=OUTPUTS[:2], both=False)
    except UnsettledError as why:
        pytest.skip(str(why))
    if known.chaotic:
        pytest.skip("chaotic by measurement")
    peak = np.abs(known.y).max(axis=1)
    system = assemble(structure, values, math.inf, OUTPUTS[:2])
    for level, allowed in (("accurate", 1e-4), ("fast", 5e-3)):
        y = response(system, u, DT, system.rest(u=u[0]), Settings(math.inf, float(peak[1]), level)).y[..., 0]
        assert (np.abs(y - known.y).max(axis=1) / peak <= allowed).all(), level


@pytest.mark.parametrize("level", LEVELS)
def test_dry_friction__zoh_torque_jumps_beyond_breakaway__accelerates_at_that_sample(level):
    system = assemble(PAPER.parse("one_mass+coulomb"), {"J1": 0.01, "M_C": 0.3}, math.inf, OUTPUTS)
    u = np.repeat([0.0, 0.25, 0.4, -0.35], 5)
    _, v, a = response(system, u, DT, system.rest(u=0.0), Settings(math.inf, 2.0, level, "zoh")).y[..., 0]
    assert not v[:11].any()
    assert not a[:10].any()
    np.testing.assert_allclose(a[[10, 14]], 10.0)
    np.testing.assert_allclose(v[15], 10.0 * 5 * DT)


@pytest.mark.parametrize("level", LEVELS)
def test_dry_friction__ramp__breaks_away_when_it_passes_coulomb_friction(level):
    J, M_C, rate = 0.01, 0.3, 7.3
    t = np.arange(100) * DT
    system = assemble(PAPER.parse("one_mass+coulomb"), {"J1": J, "M_C": M_C}, math.inf, OUTPUTS)
    q, v, a = response(system, rate * t, DT, system.rest(u=0.0), Settings(math.inf, 10.0, level)).y[..., 0]
    since = np.maximum(t - M_C / rate, 0.0)
    for found, known in ((q, since**3 / 6.0), (v, since**2 / 2.0), (a, since)):
        np.testing.assert_allclose(found, rate / J * known, rtol=0.0, atol=1e-10 * rate / J * known[-1])
    assert (v[since == 0.0] == 0.0).all()


@pytest.mark.parametrize("level", LEVELS)
def test_dry_friction__coasts__stops_for_good(level):
    J, M_C, v0 = 0.01, 0.3, -1.234
    t = np.arange(200) * DT
    system = assemble(PAPER.parse("one_mass+coulomb"), {"J1": J, "M_C": M_C}, math.inf, OUTPUTS)
    q, v, a = response(system, 0.0 * t, DT, [0.0, v0], Settings(math.inf, 2.0, level)).y[..., 0]
    until = np.minimum(t, -v0 * J / M_C)
    np.testing.assert_allclose(v, v0 + M_C / J * until, atol=1e-12)
    np.testing.assert_allclose(q, v0 * until + 0.5 * M_C / J * until**2, atol=1e-12)
    stopped = t > until[-1]
    assert (v[stopped] == 0.0).all()
    assert (a[stopped] == 0.0).all()
    assert np.ptp(q[stopped]) == 0.0


@pytest.mark.parametrize("text", ["one_mass+coulomb+stribeck+gravity", "three_mass+coulomb+backlash+current_control"])
def test_dry_friction__below_breakaway_for_100_s__does_not_move(text):
    structure = PAPER.parse(text)
    values = random_values(structure.parameters, np.random.default_rng(1)) | {"M_C": 0.5}
    values |= {"M_G": 0.1, "M_S": 0.2} if "M_G" in values else {}
    most = values["M_C"] + values.get("M_S", 0.0)
    dt = 0.05
    u = 0.9 * most * np.sin(2.0 * np.pi * np.arange(2_000) * dt / 7.0) - values.get("M_G", 0.0)
    system = assemble(structure, values, math.inf, OUTPUTS)
    y = response(system, u, dt, system.rest(u=u[0]), Settings(math.inf, 10.0)).y[..., 0]
    assert not y.any()


def test_dry_friction__two_masses__rest_in_turn():
    """The load keeps its place while the motor still swings against the shaft, and the reverse."""
    structure = structure_of("two_mass+coulomb", "coulomb@2")
    values = {"J1": 0.01, "J2": 0.01, "c1": 40.0, "d1": 0.02, "M_C": 0.3, "M_C@2": 0.3}
    system = assemble(structure, values, math.inf)
    n = len(system.states)
    every = replace(system, C=np.eye(n), D=np.zeros((n, 1)), outputs=system.state_names, derivative_rows=(-1,) * n)
    u = 0.9 * np.sin(2.0 * np.pi * np.arange(1500) * DT / 0.4)
    y = response(every, u, DT, every.rest(u=0.0), Settings(math.inf, 5.0)).y[..., 0]
    v1, v2 = (y[every.outputs.index(name)] == 0.0 for name in ("v1", "v2"))
    assert (v1 & ~v2).any()
    assert (v2 & ~v1).any()


@pytest.mark.parametrize("seed", range(4))
def test_dry_friction__any_motion__takes_energy_only(seed):
    structure, values, u = drive("one_mass+coulomb+viscous+stribeck+gravity", seed, 300)
    system = assemble(structure, values, math.inf, OUTPUTS)
    _, v, a = response(system, u, DT, system.rest(u=u[0]), Settings(math.inf, 10.0)).y[..., 0]
    friction = values["J1"] * a - u - values["M_G"]
    assert (friction * v).max() <= 1e-9 * np.abs(friction * v).max()


@pytest.mark.parametrize("seed", range(8))
def test_dry_friction__sharper_sign__comes_to_it_in_proportion_to_its_width(seed):
    """Down to 1e-4 of the largest speed, which is as narrow as a width is estimated."""
    structure, values, u = drive("two_mass+coulomb+stribeck", seed, 300)

    def velocity(gain):
        system = assemble(structure, values, gain)
        return response(system, u, DT, system.rest(u=u[0]), Settings(gain, 10.0)).y[0, :, 0]

    exact = velocity(math.inf)
    off = [np.abs(velocity(gain) - exact).max() for gain in (1e2, 1e3)]
    assert off[1] < 0.2 * off[0]


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("hold", HOLDS)
def test_dry_friction__groups_and_cores__same_motion(level, hold):
    structure, values, u = drive("two_mass+coulomb+stribeck+backlash", 2, 400)
    sets = {name: value * (1.0 + 1e-7 * np.arange(40)) for name, value in values.items()}
    system, how = assemble(structure, sets, math.inf), Settings(math.inf, 10.0, level, hold)
    x0 = system.rest(u=u[0])
    each, led = (response(system, u, DT, x0, how, group=group).y[0] for group in (1, 20))
    with shared_cores(2):
        np.testing.assert_array_equal(response(system, u, DT, x0, how).y[0], each)
    np.testing.assert_array_equal(led[:, ::20], each[:, ::20])
    np.testing.assert_allclose(led, each, atol=1e-3 * np.abs(each).max())


def test_settings__euler__needs_a_smoothed_sign():
    with pytest.raises(SettingsError, match="finite f_tanh"):
        Settings(math.inf, 1.0, "euler")
    with pytest.raises(SettingsError, match="speed_scale"):
        Settings(1.0, math.inf)
