"""The wave over the position that explains most of a residual."""

import numpy as np
import pytest

from brightgrey.effects import registry
from brightgrey.estimation.diagnostics.torque_patterns import TORQUE_PATTERNS, MovedSegment, clearest_wave

DT = 1e-3
NUMBER = 2.0 * np.pi * 9.0 / 4.0  # nine periods over a travel of 4


def segment(rng, *, order=1, weight=1.0, noise=0.1, offset=0.0, phase=0.5, samples=4000, travel=4.0, dt=DT):
    """Residual of a rigid drive that lacks a sine of the position, with white noise of a part of its RMS."""
    t = dt * np.arange(samples)
    position = offset + 0.5 * travel * np.sin(2.0 * np.pi * 0.5 * t)
    left = np.sin(NUMBER * position + phase)
    for _ in range(2 - order):
        left = np.cumsum(left) * dt
    left = left + noise * left.std() * rng.standard_normal(samples)
    return MovedSegment(weight * left, weight, order, position, np.ones(samples), dt)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_clearest_wave__any_output__is_found(order):
    number, count = clearest_wave([[segment(np.random.default_rng(1), order=order, noise=0.01)]])
    assert number == pytest.approx(NUMBER, rel=0.03)
    assert count == 256


def test_clearest_wave__noisy_output_beside_a_precise_one__counts_by_its_weight():
    rng = np.random.default_rng(2)
    noisy = segment(rng, order=0, weight=1.0, noise=30.0)
    assert clearest_wave([[noisy, segment(rng, weight=1e3)]])[0] == pytest.approx(NUMBER, rel=0.03)


def test_clearest_wave__recordings_at_other_places__have_phases_of_their_own():
    rng = np.random.default_rng(3)
    parts = [[segment(rng, offset=offset, phase=phase)] for offset, phase in ((0.0, 0.0), (50.3, 2.0), (-7.0, 4.0))]
    assert clearest_wave(parts)[0] == pytest.approx(NUMBER, rel=0.03)


def test_clearest_wave__long_recording_beside_a_fast_one__is_found():
    rng = np.random.default_rng(4)
    fast = segment(rng, samples=200, dt=0.05, weight=0.02)
    assert clearest_wave([[fast], [segment(rng, samples=120_000)]])[0] == pytest.approx(NUMBER, rel=0.03)


@pytest.mark.parametrize("travel", [0.0, 1e-310])
def test_clearest_wave__no_motion__none(travel):
    assert clearest_wave([[segment(np.random.default_rng(5), travel=travel)]]) == (0.0, 1)


def test_patterns__effects_that_they_tell_to_try__exist():
    assert {name for pattern in TORQUE_PATTERNS for name in pattern.effects} <= registry().keys()
