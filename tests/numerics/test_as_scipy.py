"""The numerics that are loaded at every start give the numbers of scipy's slow packages."""

import numpy as np
import pytest
from scipy import optimize, signal, stats
from scipy.stats import qmc

from brightgrey.numerics import distributions
from brightgrey.numerics.bounded_least_squares import bounded_least_squares
from brightgrey.numerics.digital_filter import csd, lfilter
from brightgrey.numerics.sobol import sobol_points

LEVELS = np.array([1e-6, 0.01, 0.3, 0.95])
VALUES = np.array([0.1, 1.0, 7.0, 40.0])


@pytest.mark.parametrize(("dimensions", "exponent"), [(1, 1), (2, 3), (9, 7), (40, 5), (128, 4)])
def test_sobol_points__are_those_of_scipy_and_leave_the_generator_alike(dimensions, exponent):
    ours, theirs = np.random.default_rng(3), np.random.default_rng(3)
    expected = qmc.Sobol(dimensions, rng=theirs).random_base2(exponent)
    assert np.array_equal(sobol_points(dimensions, exponent, ours), expected)
    assert np.array_equal(sobol_points(dimensions, 2, ours), qmc.Sobol(dimensions, rng=theirs).random_base2(2))
    assert ours.random() == theirs.random()


@pytest.mark.parametrize(
    ("name", "function", "x", "shapes"),
    [
        ("chi2", "sf", VALUES, (5,)),
        ("chi2", "isf", LEVELS, (5,)),
        ("f", "sf", VALUES, (3, 17.5)),
        ("f", "isf", LEVELS, (3, 17.5)),
        ("ncx2", "sf", VALUES, (2, 4.0)),
        ("norm", "ppf", LEVELS, ()),
        ("norm", "isf", LEVELS, ()),
        ("t", "ppf", LEVELS, (12.3,)),
    ],
)
def test_distributions__give_the_same_bits_as_scipy(name, function, x, shapes):
    ours = getattr(getattr(distributions, name), function)(x, *shapes)
    assert np.array_equal(ours, getattr(getattr(stats, name), function)(x, *shapes))


def test_chi2_median__is_that_of_scipy():
    assert distributions.chi2.median(7.0) == stats.chi2.median(7.0)


def test_lfilter__without_recursion_gives_the_same_bits_as_scipy():
    x = np.random.default_rng(0).normal(size=(200, 3))
    b = (1.0, -0.7, 0.2)
    assert np.array_equal(lfilter(b, [1.0], x, axis=0), signal.lfilter(b, [1.0], x, axis=0))


def test_lfilter__with_a_lightly_damped_resonance_agrees_with_scipy():
    x = np.random.default_rng(0).normal(size=2000)
    b, a = np.array([0.3, 0.1, -0.2]), np.array([2.0, -3.9, 1.96])
    expected = signal.lfilter(b, a, x)
    assert lfilter(b, a, x) == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("segment", [64, 75])
def test_csd__agrees_with_scipy(segment):
    x, y = np.random.default_rng(0).normal(size=(2, 700))
    frequency, density = csd(x, y, fs=1e3, nperseg=segment)
    expected = signal.csd(x, y, fs=1e3, nperseg=segment)
    assert frequency == pytest.approx(expected[0])
    assert density == pytest.approx(expected[1], abs=1e-14)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_bounded_least_squares__agrees_with_scipy_inside_and_at_a_bound(sign):
    rng = np.random.default_rng(0)
    A = rng.normal(size=(50, 3))
    b = A @ np.array([1.0, sign, 2.0]) + 0.1 * rng.normal(size=50)
    low, high = np.array([0.0, 0.0, -np.inf]), np.full(3, np.inf)
    expected = optimize.lsq_linear(A, b, bounds=(low, high), method="bvls", tol=1e-14).x
    assert bounded_least_squares(A, b, low, high) == pytest.approx(expected, rel=1e-12, abs=1e-14)


def test_bounded_least_squares__any_bounds__agrees_with_scipy():
    rng = np.random.default_rng(1)
    for _ in range(100):
        A, b = rng.normal(size=(30, 5)), rng.normal(size=30)
        low = np.where(rng.random(5) < 0.6, -0.1 * rng.random(5), -np.inf)
        high = np.where(rng.random(5) < 0.6, 0.1 * rng.random(5), np.inf)
        expected = optimize.lsq_linear(A, b, bounds=(low, high), method="bvls", tol=1e-14).x
        assert bounded_least_squares(A, b, low, high) == pytest.approx(expected, rel=1e-9, abs=1e-12)
