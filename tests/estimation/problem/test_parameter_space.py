"""Ranges and starts over the registry, and what the user may not ask for."""

import numpy as np
import pytest

from brightgrey.effects import Scales
from brightgrey.errors import SettingsError
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.kit import PAPER, function_set

SCALES = Scales(8.0, 40.0, 600.0, 14.0, 1e-3, 1.8, 0.02, 1.1, 0.007, 0.1)
EVERYTHING = "four_mass+coulomb+viscous+stribeck+gravity+backlash+current_control+delay"


@pytest.mark.parametrize("ladder", ["one_mass", "two_mass", "three_mass", "four_mass"])
@pytest.mark.parametrize("offset", [0.1, -0.1, 0.0])
def test_declared_start__lies_within_declared_bounds(ladder, offset):
    text = EVERYTHING.replace("four_mass", ladder)
    structure = PAPER.parse(text.replace("+backlash", "") if ladder == "one_mass" else text)
    scales = Scales(**{**vars(SCALES), "offset": offset})
    for name, parameter in structure.parameters.items():
        low, high = parameter.bounds(scales)
        assert low <= parameter.start(scales) <= high, name
        assert low < high, name
        assert parameter.scale == "linear" or low > 0.0, name


def test_gravity__starts_at_the_opposite_of_the_holding_input():
    # u = ... + offset holds the load, so the torque added to the mass is -offset.
    space = parameter_space(PAPER.parse("one_mass+gravity"), SCALES, {}, {})
    assert space.start[space.names.index("M_G")] == pytest.approx(-SCALES.offset)


def test_to_scaled__and_from_scaled__are_inverse():
    space = parameter_space(PAPER.parse(EVERYTHING), SCALES, {}, {})
    candidates = space.sample(64, np.random.default_rng(3))
    assert np.all(candidates >= space.low[:, None])
    assert np.all(candidates <= space.high[:, None])
    np.testing.assert_allclose(space.from_scaled(space.to_scaled(candidates)), candidates, rtol=1e-12)


def test_sample__depends_on_the_seed_only():
    space = parameter_space(PAPER.parse(EVERYTHING), SCALES, {}, {})

    def draw(seed):
        return space.sample(16, np.random.default_rng(seed))

    assert np.array_equal(draw(1), draw(1))
    assert not np.array_equal(draw(1), draw(2))


def test_parameter_space__bounds_and_fixed_values__replace_declared_ones():
    structure = PAPER.parse("one_mass+viscous+gravity")
    space = parameter_space(structure, SCALES, {"J1": (1e-4, 2e-4)}, {"f_v": 0.5})
    assert space.names == ("J1", "M_G")
    assert (space.low[0], space.high[0]) == (1e-4, 2e-4)
    assert 1e-4 <= space.start[0] <= 2e-4
    assert space.fixed == {"f_v": 0.5}


def test_recentred__angle_near_an_end_of_its_range__moves_by_a_turn_and_nothing_else_moves():
    structure = function_set().parse("one_mass+gravity+pendulum")
    space = parameter_space(structure, SCALES, {}, {})
    angle = space.names.index("phi_0")
    values = np.repeat(space.start[:, None], 5, axis=1)
    values[angle] = (-6.28, -3.2, 3.1, 3.5, 6.28)  # upright, an angle keeps its sign
    moved = space.from_scaled(space.recentred(space.to_scaled(values).T).T)
    np.testing.assert_allclose(moved[angle], values[angle] + 2.0 * np.pi * np.array([1, 0, 0, 0, -1]), rtol=1e-9)
    np.testing.assert_allclose(np.delete(moved, angle, 0), np.delete(values, angle, 0), rtol=1e-12)


@pytest.mark.parametrize(("low", "high", "repeats"), [(4.0, 6.0, False), (-6.3, 6.3, True), (-3.2, 3.2, False)])
def test_recentred__angle_with_given_bounds__repeats_where_two_turns_are_allowed(low, high, repeats):
    structure = function_set().parse("one_mass+pendulum")
    space = parameter_space(structure, SCALES, {"phi_0": (low, high)}, {})
    assert ("phi_0" in space.periods) == repeats
    at_bound = space.to_scaled(space.high)
    assert (space.recentred(at_bound) == at_bound).all() != repeats


@pytest.mark.parametrize(
    ("bounds", "fixed", "says"),
    [
        ({"J1": (3.0, 2.0)}, {}, ["J1", "3", "2"]),
        ({"J1": (-1.0, 2.0)}, {}, ["J1", "-1", "positive"]),
        ({"f_w": (1.0, 2.0)}, {}, ["f_w", "Did you mean 'f_v'"]),
        ({}, {"m_g": 1.0}, ["m_g", "Did you mean 'M_G'"]),
    ],
)
def test_parameter_space__wrong_arguments__are_refused_in_one_line(bounds, fixed, says):
    with pytest.raises(SettingsError) as raised:
        parameter_space(PAPER.parse("one_mass+viscous+gravity"), SCALES, bounds, fixed)
    text = str(raised.value)
    assert "\n" not in text
    assert all(word in text for word in says), text
