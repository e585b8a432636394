"""Skew of one output against the others."""

from dataclasses import replace

import numpy as np
import pytest

from brightgrey.estimation.problem.clock_skew import SkewOptions, skewed, skews_of
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.kit import PAPER
from brightgrey.simulation import Settings
from support.recordings import make_recording

DT = 1e-3
T = DT * np.arange(200)


def outputs(sets=1):
    wave = np.sin(2.0 * np.pi * 8.0 * T)
    return np.repeat(np.array([wave, wave])[:, :, None], sets, axis=2)


def test_skewed__one_output__comes_late_by_its_own_time_in_every_set():
    skews = np.array([0.0, 2.4e-3, 7e-3])
    y = skewed(outputs(3), {"skew1": skews}, DT)
    np.testing.assert_array_equal(y[0], outputs(3)[0])
    later = np.sin(2.0 * np.pi * 8.0 * (T[:, None] - skews))
    np.testing.assert_allclose(y[1, 10:], later[10:], atol=2e-5)


def test_skewed__early__goes_on_in_a_straight_line_behind_its_end():
    line = (3.0 * T)[None, :, None]
    y = skewed(np.concatenate([line, line]), {"skew1": np.array([-4.5e-3])}, DT)
    np.testing.assert_allclose(y[1, 5:, 0], 3.0 * (T[5:] + 4.5e-3))


def test_skewed__begin__holds_the_first_value():
    y = skewed(outputs() + 1.0, {"skew1": np.array([5e-3])}, DT)
    np.testing.assert_allclose(y[1, :4], 1.0)


def test_skews_of__every_output_but_the_first__within_a_part_of_the_shortest_recording():
    recordings = [
        make_recording(np.ones(n), np.zeros((3, n)), dt=DT, kind=("position", "velocity", "acceleration"))
        for n in (401, 201)
    ]
    first, second = skews_of(recordings, SkewOptions(largest=0.1))
    assert (first.name, second.name) == ("skew1", "skew2")
    assert first.high == -first.low == pytest.approx(0.02)


def test_problem__with_skews__costs_are_those_of_its_residuals():
    u = np.sin(2.0 * np.pi * 3.0 * T)
    recording = make_recording(u, np.zeros((2, T.size)), dt=DT, kind=("position", "velocity"))
    problem = SimulationErrorProblem.of(PAPER.parse("one_mass+viscous"), [recording])
    faulty = replace(problem, skews=skews_of([recording]))
    values = {"J1": np.full(2, 0.02), "f_v": np.full(2, 0.05), "skew1": np.array([0.0, 3e-3])}
    settings = Settings(2.5, 10.0, "accurate")
    residuals = faulty.residuals(values, settings)
    np.testing.assert_allclose(residuals[: T.size, 0], residuals[: T.size, 1])
    costs = faulty.costs(values, settings, np.full(2, np.inf))
    np.testing.assert_allclose(costs, np.square(residuals).sum(axis=0))
    assert costs[1] != pytest.approx(costs[0], rel=1e-3)
    assert [n.name for n in faulty.nuisances] == ["position(0)", "skew1"]
