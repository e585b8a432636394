"""Noise models of smooth noise: residuals of a position are nearly integrated, so that tiny differences decide."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from brightgrey.estimation.noise.autoregression import POLICY, Autoregression, autoregression, noise_models
from brightgrey.estimation.noise.whitening import Whitening

N = 20_000


def integrated_twice(pole, seed):
    """White noise of variance 1 through two poles, and the innovations."""
    white = np.random.default_rng(seed).normal(size=N)
    return lfilter([1.0], np.polymul([1.0, -pole], [1.0, -pole]), white)


def slow_columns(count):
    """Derivatives by parameters, as slow as a motion."""
    t = np.linspace(0.0, 1.0, N)
    return np.array([np.sin((k + 1) * np.pi * t) for k in range(count)]).T * 1e4


@pytest.mark.parametrize("pole", [0.9, 0.99, 0.999, 0.9999])
def test_autocovariance__near_the_unit_root__is_that_of_the_closed_form(pole):
    c = Autoregression((1.0, -pole), 1.0).autocovariance(3)
    np.testing.assert_allclose(c, pole ** np.arange(3) / (1.0 - pole**2), rtol=1e-9)


@pytest.mark.parametrize("line", [0.0, 0.01, 1.0])
def test_autocovariance__model_with_a_sharp_line__solves_the_yule_walker_equations(line):
    """The lags go beyond a block of those that are found at once; the line has hardly decayed there."""
    signal = np.cos(line * np.arange(N)) + 0.01 * integrated_twice(0.9, 1)
    model = autoregression(signal)
    c = model.autocovariance(POLICY.lags_at_once + 300)
    assert c[0] == pytest.approx(np.mean(signal**2), rel=0.05)
    symmetric = np.concatenate([c[model.order : 0 : -1], c])
    left = np.convolve(model.a, symmetric)[model.order : len(symmetric)]
    assert left[0] == pytest.approx(model.variance, abs=1e-9 * c[0])
    np.testing.assert_allclose(left[1:], 0.0, atol=1e-9 * c[0])


@pytest.mark.parametrize("pole", [0.9, 0.99, 0.999])
@pytest.mark.parametrize("columns", [1, 6])
def test_noise_models__smooth_noise_after_a_fit__keep_the_innovations(pole, columns):
    """A fit absorbs a few directions of 20,000: the innovations stay, whatever their share of the power is."""
    noise, jacobian = integrated_twice(pole, 1), slow_columns(columns)
    residual = noise - jacobian @ np.linalg.lstsq(jacobian, noise)[0]
    (found,) = noise_models(residual, jacobian, [N])
    assert found.variance == pytest.approx(1.0, rel=0.05)  # five standard deviations of a variance of 20,000 samples
    white = lfilter(found.a, [1.0], noise)[found.order :]
    assert white.var() == pytest.approx(1.0, rel=0.05)


def test_autoregression__innovations_of_1e12_of_the_power__are_found():
    """Steps of 50 nm in an error of 2.5 mm, as on a linear axis."""
    noise = integrated_twice(0.9999, 2)
    assert np.mean(noise**2) > 1e9
    assert autoregression(noise).variance == pytest.approx(1.0, rel=0.05)


@pytest.mark.parametrize("share", [1e-6, 1e-2])
def test_whitening__error_floor_far_below_the_noise__costs_its_share(share):
    """Errors of a simulation that are far smaller than smooth noise do not hide it."""
    noise = integrated_twice(0.999, 3)
    floor = share * float(np.mean(noise**2))
    whitening = Whitening.of(noise, np.zeros((N, 0)), [N], [floor])
    assert whitening.floor_deviance == pytest.approx(share * N, rel=0.2)
    white = whitening.whiten(noise)
    assert white @ white + whitening.floor_deviance == pytest.approx(N, rel=0.05)


def test_whitening__no_noise_at_all__floor_counts_as_white():
    rng = np.random.default_rng(4)
    whitening = Whitening.of(1e-9 * rng.normal(size=N), np.zeros((N, 0)), [N], [1.0])
    assert whitening.floor_deviance == pytest.approx(N, rel=0.01)
    error = rng.normal(size=N)
    assert np.square(whitening.whiten(error)).sum() == pytest.approx(N, rel=0.05)


def test_variance_of_sums__of_an_estimated_model__scatters_as_its_coefficients_do():
    """The variance of the logarithm is that of a first-order step, here by differences of the coefficients."""
    a, n, step = np.array([1.0, -1.2, 0.5]), 500, 1e-6
    model = Autoregression(tuple(a.tolist()), 2.0)
    weights = np.random.default_rng(0).normal(size=(n, 3)).cumsum(axis=0)
    variance, log_variance = model.variance_of_sums(weights)
    slopes = []
    for k in (1, 2):
        ends = [a + sign * step * np.eye(3)[k] for sign in (1.0, -1.0)]
        up, down = (Autoregression(tuple(end.tolist()), 2.0).variance_of_sums(weights)[0] for end in ends)
        slopes.append((up - down) / (2.0 * step * variance))
    covariance = np.linalg.inv(toeplitz(model.autocovariance(2) / model.variance)) / n
    expected = 2.0 / n + np.einsum("ki,kl,li->i", slopes, covariance, slopes)
    np.testing.assert_allclose(log_variance, expected, rtol=1e-5)  # as exact as a difference is


def exact_solution(rows, right):
    """Solution of linear equations in rational numbers."""
    m = [[*row, r] for row, r in zip(rows, right, strict=True)]
    for i in range(len(m)):
        pivot = next(k for k in range(i, len(m)) if m[k][i])
        m[i], m[pivot] = m[pivot], m[i]
        m[i] = [x / m[i][i] for x in m[i]]
        m = [row if k == i else [x - row[i] * y for x, y in zip(row, m[i], strict=True)] for k, row in enumerate(m)]
    return [row[-1] for row in m]


@pytest.mark.parametrize(("pole", "order"), [(0.5, 1), (0.9, 2), (0.99, 3), (0.99, 4), (0.9, 8)])
def test_inverse_form__smooth_noise__is_that_of_rational_arithmetic(pole, order):
    """The innovations of the last two have a part of 1e-13 and less of the power."""
    model = Autoregression(tuple(np.poly([pole] * order).tolist()), 1.0)
    a = [Fraction(c) for c in model.a]
    rows = [
        [sum(a[j] for j in range(order + 1) if abs(i - j) == k) for k in range(order + 1)] for i in range(order + 1)
    ]
    c = exact_solution(rows, [Fraction(int(i == 0)) for i in range(order + 1)])
    x = [Fraction(3 * i * i - 7 * i + 2) for i in range(order)]
    inverse = exact_solution([[c[abs(i - j)] for j in range(order)] for i in range(order)], x)
    exact = float(sum(one * other for one, other in zip(x, inverse, strict=True)))
    (found,) = model._inverse_form(np.array(x, float)[:, None])
    assert found == pytest.approx(exact, rel=1e-4)
