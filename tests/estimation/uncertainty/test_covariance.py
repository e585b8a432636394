"""Intervals against the scatter that they claim to predict."""

import numpy as np
import pytest
from scipy.signal import lfilter

from brightgrey.estimation.noise.autoregression import autoregression
from brightgrey.estimation.uncertainty.covariance import noise_models, sandwich_covariance, weakest

SAMPLES, RUNS = 1500, 120
T = np.linspace(0.0, 1.0, SAMPLES)
SLOW = np.stack(
    [
        *(np.ones(SAMPLES), np.sin(12 * T), np.exp(-3 * T), T, np.cos(12 * T)),
        *(np.sign(np.sin(20 * T)), np.sin(100 * T), np.sin(40 * T * T)),
    ],
    axis=1,
)
J = SLOW[:, :3]


@pytest.mark.parametrize(("columns", "pole"), [(3, 0.95), (8, 0.0), (8, 0.5), (8, 0.9), (8, 0.95)])
def test_intervals_cover(pole, columns):
    # Issue B asks for a coverage of 91 to 98 %; the intervals of one draw hang together, so that the mean over
    # 120 draws is sure to about 1.5 %.
    rng = np.random.default_rng([7, columns, int(100 * pole)])
    J = SLOW[:, :columns]
    noise = lfilter([1.0], [1.0, -pole], rng.standard_normal((RUNS, SAMPLES + 500)), axis=1)[:, 500:]
    project = np.linalg.solve(J.T @ J, J.T)
    inside = np.zeros(columns)
    for e in noise:
        x = project @ e
        found = sandwich_covariance(e - J @ x, J, [SAMPLES])
        inside += np.abs(x) <= found.quantile * np.sqrt(np.diag(found.covariance))
    assert 0.91 <= inside.mean() / RUNS <= 0.98, inside / RUNS


def test_noise_is_freed_from_what_the_fit_took():
    pole, rng = 0.95, np.random.default_rng(3)
    noise = lfilter([1.0], [1.0, -pole], rng.standard_normal((100, SAMPLES + 500)), axis=1)[:, 500:]
    project = np.linalg.solve(SLOW.T @ SLOW, SLOW.T)
    before, after = [], []
    for e in noise:
        r = e - SLOW @ (project @ e)
        before.append(autoregression(r))
        after.append(noise_models(r, SLOW, [SAMPLES])[0])
    low, corrected = (np.mean([m.variance / sum(m.a) ** 2 for m in models]) for models in (before, after))
    true = 1.0 / (1.0 - pole) ** 2
    assert low < 0.8 * true
    assert corrected == pytest.approx(true, rel=0.15)


def test_units_of_the_parameters_only_scale():
    e = np.random.default_rng(1).standard_normal(SAMPLES)
    s = np.array([1e-6, 1.0, 1e6])
    plain = sandwich_covariance(e, J, [SAMPLES]).covariance
    np.testing.assert_allclose(sandwich_covariance(e, J * s, [SAMPLES]).covariance * np.outer(s, s), plain, rtol=1e-6)


def test_stretches_are_not_correlated_with_each_other():
    e = np.random.default_rng(1).standard_normal(SAMPLES)
    once = sandwich_covariance(e, J, [SAMPLES]).covariance
    twice = sandwich_covariance(np.tile(e, 2), np.tile(J, (2, 1)), [SAMPLES, SAMPLES]).covariance
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


@pytest.mark.parametrize("samples", [60, 300, 2000])
@pytest.mark.parametrize("turn", [0.0, 1e-3, 0.03, 0.7, np.pi])
def test_signals_without_noise_have_a_colour(turn, samples):
    # Their poles are of size 1 to rounding, which another machine rounds differently.
    t = np.arange(samples)
    for x in (np.cos(turn * t), np.cos(turn * t + 1.0) + 3.0, 600.0 - (1.0 + turn) * t, np.sign(np.cos(turn * t))):
        with np.errstate(all="raise"):
            model = autoregression(x)
            assert np.isfinite(model.autocovariance(samples)).all()
            assert 0.0 < model.effective_samples_mean(samples) <= samples
            assert 0.0 < model.effective_samples_variance(samples) <= samples
            assert np.isfinite(model.variance_of_sums(x[:, None])).all()


def test_silence_has_no_colour():
    model = autoregression(np.zeros(100))
    assert not model.autocovariance(100).any()
    assert model.effective_samples_mean(100) == model.effective_samples_variance(100) == 100.0
