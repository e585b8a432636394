"""Intervals against the scatter that they claim to predict."""

import numpy as np
import pytest
from scipy.signal import lfilter

from brightgrey.estimation.uncertainty import covariance, weakest

SAMPLES, RUNS = 1500, 400
T = np.linspace(0.0, 1.0, SAMPLES)
J = np.stack([np.ones(SAMPLES), np.sin(12 * T), np.exp(-3 * T)], axis=1)


@pytest.mark.parametrize(
    "pole",
    [
        0.0,
        0.8,
        pytest.param(
            0.95,
            marks=pytest.mark.xfail(
                strict=True, reason="residuals slower than the taper sees: measured coverage 85 to 89 %"
            ),
        ),
    ],
)
def test_standard_deviations_predict_the_scatter(pole):
    # Issue B asks for a coverage of 91 to 98 %; 3 times 400 trials tell it to within 1 %.
    rng = np.random.default_rng(7)
    noise = lfilter([1.0], [1.0, -pole], rng.standard_normal((RUNS, SAMPLES + 500)), axis=1)[:, 500:]
    project = np.linalg.solve(J.T @ J, J.T)
    inside = np.zeros(3)
    for e in noise:
        x = project @ e
        std = np.sqrt(np.diag(covariance(e - J @ x, J, [SAMPLES])))
        inside += np.abs(x) <= 1.96 * std
    assert 0.91 <= inside.mean() / RUNS <= 0.98, inside / RUNS


def test_units_of_the_parameters_only_scale():
    e = np.random.default_rng(1).standard_normal(SAMPLES)
    s = np.array([1e-6, 1.0, 1e6])
    plain = covariance(e, J, [SAMPLES])
    np.testing.assert_allclose(covariance(e, J * s, [SAMPLES]) * np.outer(s, s), plain, rtol=1e-6)


def test_stretches_are_not_correlated_with_each_other():
    e = np.random.default_rng(1).standard_normal(SAMPLES)
    once = covariance(e, J, [SAMPLES])
    twice = covariance(np.tile(e, 2), np.tile(J, (2, 1)), [SAMPLES, SAMPLES])
    np.testing.assert_allclose(twice, once / 2, rtol=5e-3)  # degrees of freedom differ by 3 of 1500


def test_weakest_direction_is_named():
    rng = np.random.default_rng(2)
    a, b = rng.standard_normal((2, SAMPLES))
    condition, direction = weakest(np.stack([a, b, -1e3 * a], axis=1))
    assert condition > 1e9
    assert abs(direction[1]) < 1e-6
    assert abs(direction[0]) == pytest.approx(abs(direction[2]))
    condition, direction = weakest(np.stack([a, 0 * a], axis=1))
    assert condition == np.inf
    assert direction.tolist() == [0.0, 1.0]
