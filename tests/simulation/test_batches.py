"""Batches of parameter sets: what one set does must not depend on its neighbours, and must not spoil them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER, assemble
from brightgrey.simulation import Settings, response
from brightgrey.simulation.reference import UnsettledError, reference
from brightgrey.simulation.response import squares
from support.states import all_states

ALL = list(PAPER.structures())
TORQUE = E.torque()
DT = E.dt
SETTINGS = Settings(E.f_tanh, E.speed)
ANY = st.integers(0, len(ALL) - 1)
SEEDS = st.integers(0, 2**32 - 1)  # of the parameter values
drawn = settings(max_examples=15, deadline=None, derandomize=True)


@drawn
@given(number=ANY, seed=SEEDS)
def test_response__other_neighbours__same_bits(number, seed):
    structure = ALL[number]
    sets = [random_values(structure.parameters, np.random.default_rng([seed, k])) for k in range(17)]
    sets[5] |= {"T_d": 0.0} if "T_d" in sets[5] else {}
    u = TORQUE[:300]

    def outputs(members):
        values = {name: np.array([sets[k][name] for k in members]) for name in structure.parameters}
        s = assemble(structure, values, E.f_tanh, ("position", "velocity", "acceleration"))
        return response(s, u, DT, s.rest(u=u[0]), SETTINGS).y

    full = outputs(range(17))
    for members in ([5], [3, 1, 16], list(range(8, 16)), list(range(16, -1, -1))):
        np.testing.assert_array_equal(outputs(members), full[:, :, members])


@pytest.mark.parametrize("name", ["two_mass+coulomb+viscous+backlash", "three_mass+stribeck+backlash+delay"])
@pytest.mark.parametrize("group", [2, 4, 8, 16])
@pytest.mark.parametrize("level", ["fast", "accurate"])
def test_response__other_groups__same_bits(name, group, level):
    """A group's lanes go on together where its leader needs short steps; the others next to them must not notice."""
    structure = PAPER.parse(name)
    rng = np.random.default_rng(group)
    sets = [random_values(structure.parameters, rng) for _ in range(6)]
    u = TORQUE[:300]
    how = Settings(E.f_tanh, E.speed, level)

    def outputs(members):
        values = {
            n: np.concatenate([sets[k][n] * (1.0 + 1e-6 * np.arange(group)) for k in members])
            for n in structure.parameters
        }
        s = assemble(structure, values, E.f_tanh)
        return response(s, u, DT, s.rest(u=u[0]), how, group=group).y[0].reshape(len(u), -1, group)

    full = outputs(range(6))
    for members in ([2], [5, 2, 0], [1, 4]):
        np.testing.assert_array_equal(outputs(members), full[:, members])
    alone = {n: np.array([s[n] for s in sets]) for n in structure.parameters}
    s = assemble(structure, alone, E.f_tanh)
    leaders = response(s, u, DT, s.rest(u=u[0]), how).y[0]
    np.testing.assert_allclose(full[:, :, 0], leaders, rtol=0.0, atol=1e-9 * np.abs(leaders).max())


@pytest.mark.parametrize("group", [2, 6, 16, 18])
@pytest.mark.parametrize("level", ["fast", "accurate"])
def test_response__contacts_multiply_a_difference__group_rejoins(group, level):
    """A load that rattles undamped turns a change of 1e-6 into another motion, which gives no derivatives."""
    structure = PAPER.parse("two_mass+backlash")
    rattling = {"J1": 4.5e-3, "J2": 1e-2, "c1": 1e4, "d1": 3e-3, "alpha": 1e-3}
    sets = {name: value * (1.0 + 1e-6 * np.arange(group) / group) for name, value in rattling.items()}
    u, how = np.sin(2.0 * np.pi * 8.0 * DT * np.arange(600)), Settings(E.f_tanh, E.speed, level)
    s = all_states(structure, sets)
    each, found = (response(s, u, DT, s.rest(u=u[0]), how, group=g) for g in (1, group))
    each, y = each.y, found.y

    def off(y):
        """Largest difference of positions in the gap, of its width."""
        gap = y[s.outputs.index("lambda1")]
        return np.abs(gap - gap[:, :1]).max(axis=1) / (2.0 * rattling["alpha"])

    assert off(each)[-100:].max() > 0.5
    many = off(y) > 0.01
    assert not (many[1:] & many[:-1]).any()
    sample, who = found.rejoined.T
    assert len(sample)
    np.testing.assert_array_equal(y[:, sample, who], y[:, sample, 0])
    assert off(y)[: sample.min()].max() > 1e-4
    np.testing.assert_allclose(y[:, :, 0], each[:, :, 0], rtol=0.0, atol=1e-6 * np.abs(each[:, :, 0]).max())


@pytest.mark.parametrize("number", [447, 290, 200])
def test_response__steps_of_the_leader__differences_are_derivatives(number):
    structure = ALL[number]
    values = random_values(structure.parameters, np.random.default_rng([number, 0]))
    names = list(values)
    u = TORQUE[:500]
    moved = {n: np.array([v, *(v * (1 + 1e-6 * (m == n)) for m in names)]) for n, v in values.items()}
    s = assemble(structure, moved, E.f_tanh)
    y = response(s, u, DT, s.rest(u=u[0]), SETTINGS, group=len(names) + 1).y[0]
    forward = (y[:, 1:] - y[:, :1]) / 1e-6

    def solved(name, h):
        changed = {**values, name: values[name] * (1 + h)}
        return reference(structure, changed, u, DT, f_tanh=E.f_tanh)[0]

    try:
        careful = np.stack([(solved(n, 1e-4) - solved(n, -1e-4)) / 2e-4 for n in names], axis=1)
    except UnsettledError as why:
        pytest.skip(str(why))
    errors = np.linalg.norm(forward - careful, axis=0) / np.linalg.norm(careful, axis=0)
    assert np.median(errors) <= 2e-3, dict(zip(names, errors, strict=True))


@pytest.mark.parametrize("name", ["one_mass+coulomb+viscous+stribeck+delay", "three_mass+backlash+gravity+delay"])
@pytest.mark.parametrize("group", [1, 4])
@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_response__set_not_finite__only_its_group_is_lost(name, group, wrong):
    """Such a set must not take the dead time from the others, split their channels, or never end."""
    structure = PAPER.parse(name)
    rng = np.random.default_rng(5)
    drawn_sets = [random_values(structure.parameters, rng) for _ in range(12 // group)]
    good = {n: np.repeat([values[n] for values in drawn_sets], group) for n in structure.parameters}
    u, bad = TORQUE[:300], np.arange(12) == 5
    lost = np.arange(12) // group == 5 // group

    def simulated(system, x0):
        target, limits = np.zeros((1, len(u))), {"sums": np.zeros(12), "upper_limits": np.full(12, np.inf)}
        r = response(system, u, DT, x0, SETTINGS, group=group)
        return r, squares(system, u, DT, x0, SETTINGS, target, [1.0], **limits)

    def only_bad_is_lost(system, x0, what):
        r, less = simulated(system, x0)
        np.testing.assert_array_equal(r.diverged == 0, lost, err_msg=what)
        assert np.isnan(r.y[..., lost]).all(), what
        np.testing.assert_array_equal(r.y[..., ~lost], known.y[..., ~lost], err_msg=what)
        np.testing.assert_array_equal(less, np.where(bad, np.inf, sums), err_msg=what)

    system = assemble(structure, good, E.f_tanh)
    x0 = np.broadcast_to(system.rest(u=u[0]).reshape(len(system.states), -1), (len(system.states), 12))
    known, sums = simulated(system, x0)
    with np.errstate(invalid="ignore"):  # of infinite numbers on their way into matrices
        for parameter, values in good.items():
            if np.isnan(wrong) or parameter[0] != "J":  # an infinite mass stands still
                spoilt = {**good, parameter: np.where(bad, wrong, values)}
                only_bad_is_lost(assemble(structure, spoilt, E.f_tanh), x0, parameter)
        only_bad_is_lost(system, np.where(bad, wrong, x0), "start")
        every = assemble(structure, dict.fromkeys(good, np.full(12, wrong)), E.f_tanh)
        assert np.isnan(simulated(every, x0)[0].y).all()


@pytest.mark.parametrize("name", ["one_mass+viscous+delay", "two_mass+backlash+delay"])
def test_response__rates_beyond_measure__end_and_leave_the_neighbour(name):
    structure = PAPER.parse(name)
    good = random_values(structure.parameters, np.random.default_rng(6))
    sets = {n: np.array([v, 1e-18 * v if n == "J1" else v]) for n, v in good.items()}
    sets |= {n: sets[n] * np.array([1.0, 1e12]) for n in ("f_v", "c1") if n in sets}
    s, alone = assemble(structure, sets, E.f_tanh), assemble(structure, good, E.f_tanh)
    y = response(s, TORQUE[:50], DT, s.rest(u=TORQUE[0]), SETTINGS).y
    known = response(alone, TORQUE[:50], DT, alone.rest(u=TORQUE[0]), SETTINGS).y
    np.testing.assert_array_equal(y[..., 0], known[..., 0])


def test_response__system_diverges__reported_without_its_neighbour():
    structure = PAPER.parse("two_mass+coulomb+viscous")
    good = random_values(structure.parameters, np.random.default_rng(1))
    sets = {n: np.array([v, np.nan if n == "M_C" else v, v]) for n, v in good.items()}
    s = assemble(structure, sets, E.f_tanh)
    r = response(s, TORQUE, DT, s.rest(u=TORQUE[0]), SETTINGS)
    assert r.diverged[0] == r.diverged[2] == -1
    assert r.diverged[1] >= 0
    assert np.isfinite(r.y[..., [0, 2]]).all()
    assert np.isnan(r.y[:, r.diverged[1] :, 1]).all()
    # Negative friction: speed grows without limit until it is no number.
    s = assemble(PAPER.parse("one_mass+viscous"), {"J1": 1e-3, "f_v": -10.0}, E.f_tanh)
    r = response(s, TORQUE, DT, s.rest(u=TORQUE[0]), SETTINGS)
    first = int(r.diverged[0])
    assert 0 < first < len(TORQUE)
    assert np.isfinite(r.y[0, :first, 0]).all()
