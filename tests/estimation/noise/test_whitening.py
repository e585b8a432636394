"""Whitening and generalised least squares on linear regressions with noise of known colour."""

import numpy as np
import pytest
from scipy.signal import lfilter

from brightgrey.estimation.noise.whitening import Whitening

SAMPLES = 600


def least_squares(y, X):
    """Residual, simulated minus measured, of the regression of y on the columns of X."""
    return X @ np.linalg.lstsq(X, y, rcond=None)[0] - y


def regressors(rng, count=6):
    """Slow and fast columns, as derivatives of a simulation are."""
    t = np.linspace(0.0, 1.0, SAMPLES)
    return np.stack([np.cos((0.5 + 2.5 * k) * np.pi * t + rng.uniform(0, 6)) for k in range(count)], axis=1)


def noise(rng, pole):
    white = rng.standard_normal(SAMPLES + 300)
    return lfilter([1.0], [1.0, -pole], white)[300:]


def test_whiten__coloured_noise__becomes_white_with_variance_1():
    rng = np.random.default_rng(3)
    X = regressors(rng)[:, :2]
    e = noise(rng, 0.9)
    white = Whitening.of(least_squares(e, X), X, [SAMPLES]).whiten(e)[20:]
    assert white.std() == pytest.approx(1.0, abs=0.1)
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.15


def test_whiten__two_segments__each_has_its_own_filter():
    rng = np.random.default_rng(4)
    quiet, loud = 0.1 * noise(rng, 0.5), 10.0 * noise(rng, 0.0)
    e, X = np.concatenate([quiet, loud]), np.ones((2 * SAMPLES, 1))
    white = Whitening.of(least_squares(e, X), X, [SAMPLES, SAMPLES]).whiten(e)
    for part in np.split(white, 2):
        assert part[20:].std() == pytest.approx(1.0, abs=0.1)


def test_explain__change_within_the_columns__leaves_nothing():
    rng = np.random.default_rng(6)
    columns = regressors(rng)
    X = columns[:, :3]
    whitening = Whitening.of(least_squares(noise(rng, 0.5), X), X, [SAMPLES])
    inside, outside = X @ np.array([1.0, 2.0, -1.0]), columns[:, 5]
    assert whitening.explain(X, inside)[0] < 1e-9 * whitening.explain(X, outside)[0]


def test_gls_rss__parameter_held_at_its_bound__does_not_fit():
    rng = np.random.default_rng(8)
    X = regressors(rng)[:, :3]
    residual = least_squares(noise(rng, 0.5) + X[:, 2], X)
    whitening = Whitening.of(residual, X, [SAMPLES])
    moved = residual + 5.0 * X[:, 2]
    assert whitening.gls_rss(moved, X[:, :2]) > 2.0 * whitening.gls_rss(residual, X)


def test_gls_rss__derivatives_that_vanish__are_left_out():
    y, X = np.random.default_rng(7).standard_normal(SAMPLES), np.zeros((SAMPLES, 2))
    whitening = Whitening.of(least_squares(y, X), X, [SAMPLES])
    assert whitening.basis(X).shape == (SAMPLES, 0)
    assert whitening.gls_rss(least_squares(y, X), X) == pytest.approx(SAMPLES, rel=0.01)
