"""Fitness (19) with its floor, and BIC."""

import numpy as np
import pytest

from brightgrey.errors import SettingsError
from brightgrey.search import Misfit, criterion


def test_fitness_is_the_papers():
    assert criterion("fitness").value(Misfit((4.0,), (1e-9,), 100, (9.0,)), 8) == pytest.approx(1 / (4.0 * (1 + 2 * 8)))
    assert criterion("fitness", k_p=0.5).value(Misfit((4.0,), (1e-9,), 100, (9.0,)), 8) == pytest.approx(1 / (4.0 * 5))


def test_a_perfect_fit_counts_as_the_floor():
    fitness = criterion("fitness").value
    perfect, rounded = (fitness(Misfit((rss,), (0.01,), 100, (9.0,)), 3) for rss in (0.0, 0.01))
    assert perfect == rounded == pytest.approx(1 / (0.01 * 7 * (1 + 1.645 * np.sqrt(0.008))))
    assert fitness(Misfit((0.0,), (0.01,), 100, (9.0,)), 3) > fitness(Misfit((0.0,), (0.01,), 100, (9.0,)), 4)


@pytest.mark.parametrize("independent", [50, 1000])
def test_rounding_alone_stays_below_the_floor_in_19_of_20(independent):
    """Each error five times over, as where few samples are independent."""
    rounding = np.repeat(np.random.default_rng(3).random((4000, independent)) - 0.5, 5, axis=1)
    left = np.square(rounding).sum(axis=1)
    samples = 5 * independent
    most = Misfit((0.0,), (samples / 12,), samples, (1e3,), share=0.2).floored[0]
    spread = np.sqrt(0.05 * 0.95 / len(left))
    assert np.mean(left <= most) == pytest.approx(0.95, abs=4.0 * spread)
    truth, more = (Misfit((c * samples / 12,), (samples / 12,), samples, (1e3,), share=0.2) for c in (1.01, 0.99))
    assert criterion("bic").value(truth, 5) > criterion("bic").value(more, 6)


def test_a_diverged_simulation_has_no_chance():
    lost = Misfit((np.inf,), (0.01,), 100, (9.0,))
    assert criterion("fitness").value(lost, 3) == 0.0
    bic = criterion("bic")
    values = [bic.value(lost, 3), bic.value(Misfit((5.0,), (0.01,), 100, (9.0,)), 3)]
    assert values[0] == -np.inf
    assert bic.chances(values, 100)[0] == 0.0


def test_bic__one_more_parameter__has_to_pay():
    bic = criterion("bic").value
    assert bic(Misfit((1.0,), (1e-9,), 1000, (9.0,)), 3) > bic(Misfit((0.999,), (1e-9,), 1000, (9.0,)), 4)
    assert bic(Misfit((1.0,), (1e-9,), 1000, (9.0,)), 3) < bic(Misfit((0.9,), (1e-9,), 1000, (9.0,)), 4)


def test_chances__bic_and_fitness__proportional_to_inverse_rss():
    misfits = [Misfit((rss,), (1e-9,), 1000, (9.0,)) for rss in (1.0, 2.0, 8.0)]
    for name in ("fitness", "bic"):
        c = criterion(name)
        chances = c.chances([c.value(m, 3) for m in misfits], 1000)
        assert chances / chances[0] == pytest.approx([1.0, 0.5, 0.125])


def test_chances__all_diverged__zero():
    assert criterion("bic").chances([-np.inf, -np.inf], 100).tolist() == [0.0, 0.0]


def test_an_unknown_criterion():
    with pytest.raises(SettingsError, match="Did you mean 'fitness'"):
        criterion("fitnes")


def test_fit_percent__outputs__mean():
    assert Misfit((1.0,), (1e-9,), 100, (100.0,)).fit_percent == pytest.approx(90.0)
    assert Misfit((1.0, 16.0), (1e-9, 1e-9), 100, (100.0, 64.0)).fit_percent == pytest.approx(70.0)
