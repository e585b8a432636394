"""Thresholds of adequacy, and how often the decision refutes the truth."""

import numpy as np
import pytest
from scipy import stats

from brightgrey.kit import PAPER
from brightgrey.search.adequacy import Deviance, Round
from brightgrey.search.border import assess
from brightgrey.search.lattice import Lattice
from brightgrey.search.policy import BORDER, SELECTION

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
    """Each further mass has half the share of the level."""
    quantile = stats.chi2.isf(0.02 / (1.0 + 0.5 + 0.25), 8 - 3)
    allowed = excess(with_masses(), Deviance(100.0, 3, 1), {1: 100.0, 2: 100.0, 3: 100.0})
    assert allowed == pytest.approx(quantile)


def test_limit__noise_that_a_further_mass_explains__is_allowed():
    """What share a further mass has is shared among the frequencies again."""
    quantile = stats.chi2.isf(0.02 / 3.0 / SELECTION.resonances, 20 - 10)
    assert excess(with_masses(), Deviance(150.0, 10, 2), {1: 900.0, 2: 130.0, 3: 100.0}) == pytest.approx(quantile)


def test_limit__more_masses_than_the_lattice__counts_as_the_largest():
    known = with_masses()
    least = {1: 900.0, 2: 130.0, 3: 100.0}
    assert known.limit(Deviance(150.0, 10, 4), least) == known.limit(Deviance(150.0, 10, 3), least)


def test_limit__structure_with_fewest_parameters__is_far_below_several_thresholds_of_one_test():
    """Such an excess ends the refinement of a fit."""
    known, least = with_masses(), {1: 1e3, 2: 1e3, 3: 100.0}
    sizes = [(free, n) for n in (1, 2, 3) for free in range(2, known.most_free[n])]
    limits = [excess(known, Deviance(1e3, *size), least) for size in sizes]
    assert max(limits) == limits[0] < 0.5 * BORDER.far * known.threshold_of_one_test(100.0)


def test_chance__best_of_several_effects__level_is_shared_among_them():
    assert circumstances().chance(2, among=4) == pytest.approx(stats.chi2.isf(0.005, 2))
    assert circumstances().chance(0, among=0) == pytest.approx(stats.chi2.isf(0.02, 1))


def test_limit__many_samples__material_difference():
    """With 20,000 samples half a per cent of the sum of squares is a deviance of 100: beyond chance, and no matter."""
    assert excess(circumstances(), Deviance(2e4, 9, 1), {1: 2e4}) == pytest.approx(0.005 * 2e4)


def test_limit__error_floor__counts_where_it_is_largest():
    assert excess(circumstances(50.0), Deviance(100.0, 5, 1), {1: 100.0}) == pytest.approx(50.0)
    assert excess(circumstances(5.0), Deviance(100.0, 5, 1), {1: 100.0}) > 5.0


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


@pytest.mark.parametrize("effects", [1, 2, 8])
def test_chance_beyond__resonances_sought_everywhere__truth_is_refuted_no_more_often_than_the_level_says(effects):
    """Each further mass has three parameters, and explains as much as the best of the frequencies that count."""
    rng, draws = np.random.default_rng(effects), 100_000
    known = Round(LATTICE, 1, {n: 1 + effects + 3 * (n - 1) for n in (1, 2, 3, 4)}, 0.0)
    further = [rng.chisquare(3, (draws, SELECTION.resonances)).max(axis=1) for _ in range(3)]
    explained = np.cumsum([rng.chisquare(effects, draws), *further], axis=0)
    limits = [known.chance_beyond(1, 1, n) for n in (1, 2, 3, 4)]
    refuted = np.mean(np.any(explained > np.array(limits)[:, None], axis=0))
    assert 0.5 * SELECTION.false_alarm_level < refuted < stats.binom.ppf(0.999, draws, 0.02) / draws


def test_assess__friction_beside_one_mass__is_found_among_structures_with_one_mass():
    """Beside 15 parameters of further masses its gain would be taken for chance."""
    lattice = Lattice.of(PAPER, exclude=("stribeck", "current_control", "delay", "backlash"))
    known = Round(lattice, 1, {1: 4, 2: 9, 3: 14, 4: 19}, 0.0)
    viscous = lattice.mask(PAPER.parse("one_mass+viscous"))
    masses = {m: lattice.structure(m).masses for m in lattice.masks()}
    free = {m: 1 + len(lattice.structure(m).beside) + 5 * (masses[m] - 1) for m in masses}
    table = {m: Deviance(282.0 if m & viscous else 300.0, free[m], masses[m]) for m in masses}
    assert stats.chi2.isf(SELECTION.false_alarm_level, 18) > 18.0
    assert assess(table, known).minimal == (viscous,)
