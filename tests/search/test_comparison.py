"""Comparison of two fits on linear regressions with noise whose colour is known."""

import numpy as np
import pytest
from scipy.signal import lfilter

from brightgrey.estimation.noise.whitening import Whitening
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian
from brightgrey.kit import PAPER
from brightgrey.search.comparison import Judged, chance_of, power, significance, threshold

SAMPLES = 600
LEVEL = 0.02


def judged(y, X, count):
    """Least squares with the first `count` columns; residuals are simulated minus measured."""
    J = X[:, :count]
    values, *_ = np.linalg.lstsq(J, y, rcond=None)
    residual = J @ values - y
    descent = OptimumWithJacobian(values, float(residual @ residual), True, 1, 1, residual, J)
    return Judged(PAPER.parse("one_mass"), {}, descent, count, tuple(range(count)))


def regressors(rng, count=6):
    """Slow and fast columns, as derivatives of a simulation are."""
    t = np.linspace(0.0, 1.0, SAMPLES)
    return np.stack([np.cos((0.5 + 2.5 * k) * np.pi * t + rng.uniform(0, 6)) for k in range(count)], axis=1)


def noise(rng, pole):
    white = rng.standard_normal(SAMPLES + 300)
    return lfilter([1.0], [1.0, -pole], white)[300:]


def found(rng, pole, size=0.0):
    """Twice the log-likelihood ratio for the last two of six columns, which are there with `size`."""
    X = regressors(rng)
    y = X[:, :4] @ np.array([3.0, -2.0, 1.0, 1.0]) + noise(rng, pole) + size * X[:, 4:].sum(axis=1)
    small, big = judged(y, X, 4), judged(y, X, 6)
    whitening = Whitening.of(big.descent.residual, big.inside_jacobian, [SAMPLES])
    misfits = [whitening.gls_rss(fit.descent.residual, fit.inside_jacobian) for fit in (small, big)]
    return significance(*misfits, SAMPLES), whitening, small, X


@pytest.mark.parametrize("pole", [0.0, 0.5, 0.9])
def test_lr_test__no_effect__rate_of_false_alarms(pole):
    """Two per cent are asked for; an estimated colour may double that, not more (400 draws)."""
    rng = np.random.default_rng(int(100 * pole))
    alarms = sum(found(rng, pole)[0] > threshold(2, LEVEL) for _ in range(400))
    assert alarms <= 0.04 * 400 + 2.3 * np.sqrt(0.04 * 400)


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_lr_test_power__simulated__as_computed(pole):
    """Columns as large as a power of 80 % asks for are found in about so many draws."""
    rng = np.random.default_rng(5)
    hits, promised = 0, []
    for _ in range(150):
        _, whitening, small, X = found(rng, pole)
        unit = whitening.explain(small.descent.jacobian, X[:, 4:].sum(axis=1))[0]
        sizes = np.geomspace(0.01, 100.0, 200)
        size = sizes[np.argmax([power(s * s * unit, 2, LEVEL) >= 0.8 for s in sizes])]
        promised.append(power(size * size * unit, 2, LEVEL))
        hits += found(rng, pole, size)[0] > threshold(2, LEVEL)
    assert np.mean(promised) == pytest.approx(0.8, abs=0.05)
    assert hits / 150 == pytest.approx(0.8, abs=0.15)


@pytest.mark.parametrize("samples", [9, 40, 400])
def test_f_test__few_samples__rate_of_false_alarms(samples):
    """Three useless parameters beside five, as many times as it takes: each chance comes as often as it says."""
    rng = np.random.default_rng(3)
    A = rng.normal(size=(samples, 8))
    chances = []
    for _ in range(2000):
        e = rng.normal(size=samples)
        small, big = (np.linalg.lstsq(A[:, :k], e, rcond=None)[1][0] for k in (5, 8))
        chances.append(chance_of(small / big, 3, samples - 8))
    for level in (0.5, 0.1, 0.01):  # four standard deviations of a count
        assert np.mean(np.array(chances) < level) == pytest.approx(level, abs=4.0 * np.sqrt(level * (1 - level) / 2000))


def test_f_test__no_independent_samples__p_value_one():
    assert chance_of(1e6, 3, 0.0) == chance_of(1e6, 3, -5.0) == 1.0
