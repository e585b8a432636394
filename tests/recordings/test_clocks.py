"""Channels with different clocks on one clock: which one, how, and what it costs."""

from __future__ import annotations

import numpy as np
import pytest

from brightgrey.errors import RecordingError
from brightgrey.recordings.clocks import Channel, onto_one_clock, resampling_error, straight_lines


def wave(dt: float, start: float = 0.0, length: float = 2.0, frequency: float = 3.0) -> Channel:
    t = start + dt * np.arange(round(length / dt))
    return Channel(f"wave {dt:g}", start, dt, np.sin(2 * np.pi * frequency * t))


def test_onto_one_clock__one_clock__changes_nothing() -> None:
    u, y = wave(0.01), wave(0.01)
    t, values, notes = onto_one_clock([u, y], "linear", "file")
    np.testing.assert_array_equal(values, [u.values, y.values])
    np.testing.assert_array_equal(t, u.t)
    assert notes == []


def test_onto_one_clock__two_outputs__the_slowest_is_the_clock() -> None:
    t, values, notes = onto_one_clock([wave(0.01), wave(0.01), wave(0.02)], "linear", "file")
    np.testing.assert_allclose(np.diff(t), 0.02)
    np.testing.assert_allclose(values[1], values[2], atol=1e-12)  # picked, not filtered
    assert "replaced by straight lines at the 0.02 s of 'wave 0.02'" in notes[0]
    assert "'wave 0.01', sampled every 0.01 s, is picked" in notes[1]


@pytest.mark.parametrize("dt", [0.002, 0.007, 0.013, 0.02])
def test_onto_one_clock__input_interpolated__costs_what_the_note_says(dt: float) -> None:
    t, values, notes = onto_one_clock([wave(0.02, start=-0.003), wave(dt)], "linear", "file")
    error = np.std(values[0] - np.sin(2 * np.pi * 3.0 * t)) / np.std(values[0])
    cost = float(notes[-1].split("costs ")[1].split(" %")[0]) / 100
    assert 0.3 * cost < error < 1.5 * cost


def test_onto_one_clock__fast_input__keeps_its_integral() -> None:
    u = Channel("u", 0.0, 1e-3, np.random.default_rng(0).normal(size=1001))
    _, linear, _ = onto_one_clock([u, wave(0.01, length=1.01)], "linear", "file")
    assert np.trapezoid(linear[0], dx=0.01) == pytest.approx(np.trapezoid(u.values, dx=1e-3), abs=1e-3)
    _, held, notes = onto_one_clock([u, wave(0.01, length=1.0)], "zoh", "file")
    np.testing.assert_allclose(held[0], u.values[:1000].reshape(-1, 10).mean(axis=1), atol=1e-12)
    assert "averaged" in notes[-1]


def test_onto_one_clock__slow_input_that_is_held__keeps_its_last_value() -> None:
    u = Channel("u", 0.0, 0.1, np.arange(10.0))
    t, values, _ = onto_one_clock([u, wave(0.01, length=0.9)], "zoh", "file")
    np.testing.assert_array_equal(values[0], np.floor(t / 0.1 + 1e-9))


def test_onto_one_clock__no_time_in_common__is_refused() -> None:
    with pytest.raises(RecordingError, match=r"no time in common: 'wave 0\.01' from 0 to 1\.99 s"):
        onto_one_clock([wave(0.01), wave(0.02, start=5.0)], "linear", "file")


def test_straight_lines__straight_input__is_itself() -> None:
    old = np.linspace(0, 1, 101)
    t = np.linspace(0, 1, 8)
    np.testing.assert_allclose(straight_lines(old, 3.0 - 2.0 * old, t), 3.0 - 2.0 * t, atol=1e-9)


def test_resampling_error__sine__is_that_of_a_straight_line() -> None:
    u = wave(0.02, frequency=3.0)
    middle = u.t[:-1] + 0.01
    true = np.std(np.interp(middle, u.t, u.values) - np.sin(2 * np.pi * 3.0 * middle)) / np.std(u.values)
    assert resampling_error(u.t, u.values) == pytest.approx(true, rel=0.1)
