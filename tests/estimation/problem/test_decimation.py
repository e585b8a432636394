"""Descents leave out samples where input and noise allow it."""

from dataclasses import replace

import numpy as np
import pytest

from brightgrey.estimation.problem.decimation import POLICY, decimated, decimated_together
from support.searches import simulated_task

DT = 1e-3
T = DT * np.arange(2 * POLICY.least_samples + 1)
SLOW = 3.0 * np.sin(2.0 * np.pi * 1.0 * T)
VALUES = {"J1": 0.02, "f_v": 0.03}


@pytest.fixture(scope="module")
def recording():
    """A slow motion of two to three times as many samples as have to be kept, and noise of a twentieth of it."""
    return simulated_task("one_mass+viscous", VALUES, SLOW, 1.0, dt=DT, f_tanh=50.0).recordings[0]


@pytest.mark.parametrize(("count", "factor"), [(1, 2), (2, 4), (4, 8), (9, 8)])
def test_decimated_together__slow_motion__keeps_least_number_of_samples_of_all_recordings(recording, count, factor):
    coarse = decimated_together([recording] * count, VALUES["J1"])
    assert [r.dt for r in coarse] == pytest.approx([factor * DT] * count)
    assert sum(r.samples for r in coarse) >= POLICY.least_samples
    assert min(r.samples for r in coarse) >= POLICY.least_of_each


def test_decimated_together__few_samples_or_fast_input__same_recordings(recording):
    short = replace(recording, t=recording.t[:-2], u=recording.u[:-2], y=recording.y[:, :-2])
    fast = (replace(recording, u=SLOW + 3.0 * np.sin(2.0 * np.pi * 400.0 * T)),) * 4
    assert decimated_together([short], VALUES["J1"]) == (short,)
    assert decimated_together(fast, VALUES["J1"]) == fast


def test_decimated__held_input__same_impulse():
    held = simulated_task("one_mass+viscous", VALUES, SLOW, 0.01, dt=DT, f_tanh=50.0).recordings[0]
    held = replace(held, hold="zoh")
    coarse = decimated(held, 5)
    assert coarse.samples == (held.samples - 1) // 5 + 1
    assert coarse.u[:-1].sum() * coarse.dt == pytest.approx(held.u[: 5 * (coarse.samples - 1)].sum() * DT)


def test_decimated__differenced_speed__difference_over_the_longer_interval():
    (recording,) = simulated_task("one_mass+viscous", VALUES, SLOW, 0.01, dt=DT, f_tanh=50.0).recordings
    angle = np.cumsum(recording.y[0]) * DT
    differenced = np.diff(angle, prepend=0.0) / DT
    (signal,) = recording.outputs
    whole = replace(recording, y=differenced[None], outputs=(replace(signal, kind="velocity-differenced"),))
    coarse = decimated(whole, 4)
    assert coarse.y[0, 1:] == pytest.approx(np.diff(angle[: coarse.samples * 4 : 4]) / coarse.dt)
