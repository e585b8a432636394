"""Smoothing of recordings that are examined."""

import numpy as np
import pytest

from brightgrey.recordings.checks.examined import Examined
from support.recordings import make_recording

DT = 1e-3


@pytest.mark.parametrize("width", [2.0, 16.0])
def test_smooth__derivatives_of_a_parabola_far_from_zero__are_exact(width):
    """A sampled derivative of a Gaussian leaves a part of the signal itself, which over dt² is more than the slope."""
    t = DT * np.arange(2000)
    q = 100.0 + 3.0 * t + 0.5 * 40.0 * t**2
    examined = Examined(make_recording(np.sin(t), q, dt=DT, kind="position"))
    inner = slice(int(4 * width), len(t) - int(4 * width))
    np.testing.assert_allclose(examined.smooth(q, width, 1), 3.0 + 40.0 * t[inner], rtol=1e-6)
    np.testing.assert_allclose(examined.smooth(q, width, 2), 40.0, rtol=1e-4)


def test_motion__position_of_a_swing__has_its_acceleration():
    t, omega = DT * np.arange(4000), 2.0 * np.pi
    q = 5.0 * np.sin(omega * t)
    motion = Examined(make_recording(np.cos(t), q, dt=DT, kind="position")).motion()
    np.testing.assert_allclose(motion.acceleration, -(omega**2) * motion.position, atol=1e-3 * omega**2 * 5.0)
