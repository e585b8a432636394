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
    return Round(LATTICE, 1, {1: 12}, error_floor)


def excess(known, deviance, least):
    """Largest excess over the least deviance with which a structure is adequate."""
    return known.limit(deviance, least) - min(least.values())


def with_masses():
    """Two masses have six parameters more than one, three have six more again."""
    return Round(Lattice.of(PAPER, exclude=("four_mass",)), 2, {1: 8, 2: 14, 3: 20}, 0.0)


@pytest.mark.parametrize("free", [1, 5, 11])
def test_limit__few_samples__quantile_of_chi_squared(free):
    quantile = stats.chi2.isf(0.02, 12 - free)
    assert excess(circumstances(), Deviance(100.0, free, 1), {1: 100.0}) == pytest.approx(quantile)


def test_limit__largest_structure__one_degree_of_freedom():
    """The best structure is adequate by itself; another that has as many parameters is given one."""
    assert excess(circumstances(), Deviance(100.0, 12, 1), {1: 100.0}) == pytest.approx(stats.chi2.isf(0.02, 1))


def test_limit__no_mass_explains_more__parameters_beyond_its_own_masses_count():
    """Each further mass has a share of the level that is smaller by the number of frequencies."""
    shares = SELECTION.resonances ** -np.arange(3.0)
    quantile = stats.chi2.isf(0.02 / shares.sum(), 8 - 3)
    allowed = excess(with_masses(), Deviance(100.0, 3, 1), {1: 100.0, 2: 100.0, 3: 100.0})
    assert allowed == pytest.approx(quantile)


def test_limit__noise_that_a_further_mass_explains__is_allowed():
    quantile = stats.chi2.isf(0.02 / (1.0 + SELECTION.resonances), 20 - 10)
    assert excess(with_masses(), Deviance(150.0, 10, 2), {1: 900.0, 2: 130.0, 3: 100.0}) == pytest.approx(quantile)


def test_limit__structure_with_fewest_parameters__is_the_largest():
    known = with_masses()
    least = {1: 1e3, 2: 1e3, 3: 100.0}
    limits = [excess(known, Deviance(1e3, free, n), least) for n in (1, 2, 3) for free in range(2, known.most_free[n])]
    assert max(limits) == limits[0] == pytest.approx(known.largest_threshold(100.0))


def test_chance__best_of_several_effects__level_is_shared_among_them():
    assert circumstances().chance(2, among=4) == pytest.approx(stats.chi2.isf(0.005, 2))
    assert circumstances().chance(0, among=0) == pytest.approx(stats.chi2.isf(0.02, 1))


def test_limit__many_samples__material_difference():
    """With 20,000 samples half a per cent of the sum of squares is a deviance of 100: beyond chance, and no matter."""
    assert excess(circumstances(), Deviance(2e4, 9, 1), {1: 2e4}) == pytest.approx(0.005 * 2e4)


def test_limit__error_floor__counts_where_it_is_largest():
    assert excess(circumstances(50.0), Deviance(100.0, 5, 1), {1: 100.0}) == pytest.approx(50.0)
    assert excess(circumstances(5.0), Deviance(100.0, 5, 1), {1: 100.0}) > 5.0


def test_largest_threshold__all_structures__none_is_beyond():
    found = circumstances()
    limits = [excess(found, Deviance(500.0, free, 1), {1: 500.0}) for free in range(1, 13)]
    assert max(limits) == limits[0] == pytest.approx(found.largest_threshold(500.0))


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
    return {m: Deviance(float(d[draw]), 1 + m.bit_count(), 1) for m, d in found.items()}


@pytest.mark.parametrize("names", ["one_mass", "one_mass+coulomb+viscous", "one_mass+gravity+viscous+delay"])
def test_assess__linear_regression__truth_is_refuted_as_often_as_the_level_says(names):
    """Two per cent of 1,000 draws, within an interval that holds in 998 of 1,000 tests."""
    draws, truth = 1000, LATTICE.mask(PAPER.parse(names))
    found = deviances(np.random.default_rng(len(names)), truth, draws)
    known = Round(LATTICE, 1, {1: 1 + FREE}, 0.0)
    borders = [assess(table_of(found, k), known) for k in range(draws)]
    refuted = sum(all(m & ~truth for m in border.minimal) for border in borders)
    assert refuted <= stats.binom.ppf(0.999, draws, SELECTION.false_alarm_level)
    few = sum(any(truth & ~m and not m & ~truth for m in border.minimal) for border in borders)
    assert few == 0  # each effect of the truth explains as much as 200 samples of noise


def test_assess__linear_regression__truth_is_minimal_but_for_the_level():
    """Noise of variance 1 calls for no more than the truth: minimal alone in all draws but about two per cent."""
    draws, truth = 1000, LATTICE.mask(PAPER.parse("one_mass+coulomb+viscous"))
    found = deviances(np.random.default_rng(7), truth, draws)
    known = Round(LATTICE, 1, {1: 1 + FREE}, 0.0)
    alone = sum(assess(table_of(found, k), known).minimal == (truth,) for k in range(draws))
    assert alone >= stats.binom.ppf(0.001, draws, 1.0 - SELECTION.false_alarm_level)


def test_assess__resonance_that_is_sought_everywhere__refutes_the_truth_no_more_often_than_the_level_says():
    """The second mass has four parameters, and the best of as many frequencies as the policy counts."""
    rng, draws = np.random.default_rng(3), 1000
    lattice = Lattice.of(PAPER, exclude=("three_mass", "stribeck", "current_control", "delay", "backlash"))
    truth, second = (lattice.mask(PAPER.parse(name)) for name in ("one_mass+coulomb", "two_mass"))
    effects = list(lattice.bits(lattice.everything & ~second))
    X, resonances = rng.normal(size=(200, 1 + len(effects))), rng.normal(size=(SELECTION.resonances, 200, 4))
    columns = {m: [0, *(k for k, bit in enumerate(effects, 1) if m & bit)] for m in lattice.masks()}
    y = X[:, columns[truth]].sum(axis=1)[:, None] + rng.standard_normal((200, draws))

    def left(A):
        return np.sum(y**2, axis=0) - np.sum((np.linalg.qr(A)[0].T @ y) ** 2, axis=0)

    found = {
        m: np.min([left(np.hstack([X[:, c], R])) for R in resonances], axis=0) if m & second else left(X[:, c])
        for m, c in columns.items()
    }
    sizes = {m: (len(c) + (4 if m & second else 0), 2 if m & second else 1) for m, c in columns.items()}
    known = Round(lattice, 1, {1: 4, 2: 8}, 0.0)
    tables = [{m: Deviance(float(d[draw]), *sizes[m]) for m, d in found.items()} for draw in range(draws)]
    refuted = sum(all(m & ~truth for m in assess(table, known).minimal) for table in tables)
    assert refuted <= stats.binom.ppf(0.999, draws, SELECTION.false_alarm_level)
    assert refuted >= stats.binom.ppf(0.001, draws, SELECTION.false_alarm_level / 4.0)  # and is no more cautious
