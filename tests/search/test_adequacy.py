"""Thresholds of adequacy, and how often the decision refutes the truth."""

import numpy as np
import pytest
from scipy import stats

from brightgrey.kit import PAPER
from brightgrey.search.adequacy import Deviance, Round
from brightgrey.search.border import assess
from brightgrey.search.lattice import Lattice
from brightgrey.search.policy import SELECTION

LATTICE = Lattice.of(PAPER, exclude=("two_mass", "stribeck", "current_control"))
FREE = LATTICE.everything.bit_count()


def circumstances(error_floor=0.0):
    return Round(LATTICE, 1, 12, error_floor)


@pytest.mark.parametrize("free", [1, 5, 11])
def test_threshold__few_samples__quantile_of_chi_squared(free):
    quantile = stats.chi2.isf(0.02, 12 - free)
    assert circumstances().threshold(Deviance(100.0, free), 100.0) == pytest.approx(quantile)


def test_threshold__largest_structure__one_degree_of_freedom():
    """The best structure is adequate by itself; another that has as many parameters is given one."""
    assert circumstances().threshold(Deviance(100.0, 12), 100.0) == pytest.approx(stats.chi2.isf(0.02, 1))


def test_threshold__many_samples__material_difference():
    """With 20,000 samples half a per cent of the sum of squares is a deviance of 100: beyond chance, and no matter."""
    assert circumstances().threshold(Deviance(2e4, 9), 2e4) == pytest.approx(0.005 * 2e4)


def test_threshold__error_floor__counts_where_it_is_largest():
    assert circumstances(50.0).threshold(Deviance(100.0, 5), 100.0) == 50.0
    assert circumstances(5.0).threshold(Deviance(100.0, 5), 100.0) > 5.0


def test_largest_threshold__all_structures__none_is_beyond():
    found = circumstances()
    limits = [found.threshold(Deviance(500.0, free), 500.0) for free in range(1, 13)]
    assert max(limits) == found.largest_threshold(500.0) == limits[0]


def deviances(rng, truth, draws, samples=200):
    """Residual sums of squares of all structures, by mask; each atom is a regressor, the noise has variance 1."""
    X = rng.normal(size=(samples, 1 + len(LATTICE.atoms)))
    noise = rng.standard_normal((samples, draws))
    columns = {m: [0, *(b.bit_length() for b in LATTICE.bits(m))] for m in LATTICE.masks()}
    y = X[:, columns[truth]].sum(axis=1)[:, None] + noise
    bases = {m: np.linalg.qr(X[:, c])[0] for m, c in columns.items()}
    return {m: np.sum(y**2, axis=0) - np.sum((Q.T @ y) ** 2, axis=0) for m, Q in bases.items()}


def table_of(found, draw):
    """Table of one draw."""
    return {m: Deviance(float(d[draw]), 1 + m.bit_count()) for m, d in found.items()}


@pytest.mark.parametrize("names", ["one_mass", "one_mass+coulomb+viscous", "one_mass+gravity+viscous+delay"])
def test_assess__linear_regression__truth_is_refuted_as_often_as_the_level_says(names):
    """Two per cent of 1,000 draws, within an interval that holds in 998 of 1,000 tests."""
    draws, truth = 1000, LATTICE.mask(PAPER.parse(names))
    found = deviances(np.random.default_rng(len(names)), truth, draws)
    known = Round(LATTICE, 1, 1 + FREE, 0.0)
    borders = [assess(table_of(found, k), known) for k in range(draws)]
    refuted = sum(all(m & ~truth for m in border.minimal) for border in borders)
    assert refuted <= stats.binom.ppf(0.999, draws, SELECTION.false_alarm_level)
    few = sum(any(truth & ~m and not m & ~truth for m in border.minimal) for border in borders)
    assert few == 0  # each effect of the truth explains as much as 200 samples of noise


def test_assess__linear_regression__truth_is_minimal_but_for_the_level():
    """Noise of variance 1 calls for no more than the truth: minimal alone in all draws but about two per cent."""
    draws, truth = 1000, LATTICE.mask(PAPER.parse("one_mass+coulomb+viscous"))
    found = deviances(np.random.default_rng(7), truth, draws)
    known = Round(LATTICE, 1, 1 + FREE, 0.0)
    alone = sum(assess(table_of(found, k), known).minimal == (truth,) for k in range(draws))
    assert alone >= stats.binom.ppf(0.001, draws, 1.0 - SELECTION.false_alarm_level)
