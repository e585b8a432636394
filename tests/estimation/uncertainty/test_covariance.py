"""Covariance of estimates, compared with the scatter that it predicts; noise models."""

import numpy as np
import pytest
from scipy.signal import lfilter

from brightgrey.estimation.noise.autoregression import autoregression, noise_models
from brightgrey.estimation.uncertainty.covariance import sandwich_covariance

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
def test_sandwich_covariance__intervals__cover_the_truth(pole, columns):
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


def test_noise_models__are_corrected_for_what_the_fit_absorbs():
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


def test_sandwich_covariance__other_units__is_proportional():
    e = np.random.default_rng(1).standard_normal(SAMPLES)
    s = np.array([1e-6, 1.0, 1e6])
    plain = sandwich_covariance(e, J, [SAMPLES]).covariance
    np.testing.assert_allclose(sandwich_covariance(e, J * s, [SAMPLES]).covariance * np.outer(s, s), plain, rtol=1e-6)


def test_sandwich_covariance__two_segments__are_independent():
    e = np.random.default_rng(1).standard_normal(SAMPLES)
    once = sandwich_covariance(e, J, [SAMPLES]).covariance
    twice = sandwich_covariance(np.tile(e, 2), np.tile(J, (2, 1)), [SAMPLES, SAMPLES]).covariance
    np.testing.assert_allclose(twice, once / 2, rtol=5e-3)  # degrees of freedom differ by 3 of 1500


@pytest.mark.parametrize("samples", [60, 300, 2000])
@pytest.mark.parametrize("turn", [0.0, 1e-3, 0.03, 0.7, np.pi])
def test_autoregression__signals_without_noise__is_finite(turn, samples):
    # Their poles are of size 1 to rounding, which another machine rounds differently.
    t = np.arange(samples)
    for x in (np.cos(turn * t), np.cos(turn * t + 1.0) + 3.0, 600.0 - (1.0 + turn) * t, np.sign(np.cos(turn * t))):
        with np.errstate(all="raise"):
            model = autoregression(x)
            assert np.isfinite(model.autocovariance(samples)).all()
            assert 0.0 < model.effective_samples_mean(samples) <= samples
            assert 0.0 < model.effective_samples_variance(samples) <= samples
            assert np.isfinite(model.variance_of_sums(x[:, None])).all()


def test_autoregression__zeros__is_zero():
    model = autoregression(np.zeros(100))
    assert not model.autocovariance(100).any()
    assert model.effective_samples_mean(100) == model.effective_samples_variance(100) == 100.0
