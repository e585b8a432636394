"""Relations between channels, found in their numbers."""

from __future__ import annotations

import numpy as np
import pytest

from brightgrey.recordings.inspection.meaning import Meaning
from brightgrey.recordings.inspection.relations import (
    explained_by_motion,
    find_derivatives,
    find_setpoints,
    is_even_time,
    on_one_time,
)

DT = 1e-3
T = DT * np.arange(5000)
RNG = np.random.default_rng(0)
Q = np.sin(2 * np.pi * 0.7 * T) + 0.3 * np.sin(2 * np.pi * 1.9 * T)
V = np.gradient(Q, DT)
NAMES = {i: str(i + 1) for i in range(9)}


def test_find_derivatives__position_and_velocity_among_others__are_found() -> None:
    values = {0: RNG.normal(size=T.size), 1: Q + 1e-5 * RNG.normal(size=T.size), 2: V + 0.01 * RNG.normal(size=T.size)}
    meanings = dict.fromkeys(values, Meaning())
    find_derivatives(values, meanings, NAMES, DT)
    assert [meanings[i].quantity for i in values] == ["", "position", "velocity"]
    assert meanings[2].reason == "it is the derivative of '2'"


def test_find_derivatives__other_scale__is_none() -> None:
    values = {0: Q, 1: 57.3 * V}
    meanings = dict.fromkeys(values, Meaning())
    find_derivatives(values, meanings, NAMES, DT)
    assert not any(meaning.quantity for meaning in meanings.values())


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_find_setpoints__noise__tells_the_actual_value(order: tuple[int, int]) -> None:
    smooth, rough = order
    values = {smooth: Q, rough: Q + 0.02 * RNG.normal(size=T.size)}
    meanings = {0: Meaning("current"), 1: Meaning("current")}
    find_setpoints(values, meanings, NAMES)
    assert (meanings[smooth].role, meanings[rough].role) == ("setpoint", "actual")


def test_find_setpoints__delay__tells_the_actual_value_and_its_quantity() -> None:
    values = {0: np.interp(T - 0.02, T, Q), 1: Q}
    meanings = {0: Meaning(), 1: Meaning("position")}
    find_setpoints(values, meanings, NAMES)
    assert (meanings[0].quantity, meanings[0].role, meanings[1].role) == ("position", "actual", "setpoint")
    assert "it nearly equals '2'" in meanings[0].reason


def test_find_setpoints__unrelated_channels__stay_open() -> None:
    values = {0: Q, 1: V, 2: np.roll(Q, 700)}
    meanings = dict.fromkeys(values, Meaning("position"))
    find_setpoints(values, meanings, NAMES)
    assert not any(meaning.role for meaning in meanings.values())


@pytest.mark.parametrize(("quantity", "motion"), [("position", Q), ("velocity", V)])
def test_explained_by_motion__torque__is_large_and_noise_is_small(quantity: str, motion: np.ndarray) -> None:
    torque = 0.02 * np.gradient(V, DT) + 0.1 * V + 0.5 * np.sign(V)
    assert explained_by_motion(torque + 0.05 * RNG.normal(size=T.size), motion, quantity, DT) > 0.9
    assert explained_by_motion(RNG.normal(size=T.size), motion, quantity, DT) < 0.1
    assert explained_by_motion(np.ones(T.size), motion, quantity, DT) == 0.0


def test_is_even_time__counter_stamps_and_signals__are_told_apart() -> None:
    assert is_even_time(T)
    assert is_even_time(1297.0 + np.cumsum(np.where(np.arange(600) % 3 == 0, 0.012, 0.010)))
    assert not is_even_time(Q)
    assert not is_even_time(np.cumsum(RNG.exponential(size=500)))
    assert not is_even_time(np.zeros(50))


def test_on_one_time__clocks_of_their_own__pairs_equal_times() -> None:
    slow = T[1000::7] + 0.3 * DT
    times = {0: T, 1: slow}
    found = on_one_time({0: Q, 1: np.interp(slow, T, Q), 2: V}, times)
    np.testing.assert_allclose(found[0], found[1], atol=1e-5)
    assert found[2] is V


def test_on_one_time__no_common_time__leaves_them() -> None:
    found = on_one_time({0: Q, 1: V}, {0: T, 1: T + 100.0})
    assert found[0] is Q
    assert found[1] is V
