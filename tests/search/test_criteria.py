"""Fitness (19) with its floor, and BIC."""

import numpy as np
import pytest

from brightgrey.errors import SettingsError
from brightgrey.search import Misfit, criterion
from brightgrey.search.criteria import by_rank


def test_fitness_is_the_papers():
    assert criterion("fitness").value(Misfit((4.0,), (1e-9,), 100, (9.0,)), 8) == pytest.approx(1 / (4.0 * (1 + 2 * 8)))
    assert criterion("fitness", k_p=0.5).value(Misfit((4.0,), (1e-9,), 100, (9.0,)), 8) == pytest.approx(1 / (4.0 * 5))


def test_a_perfect_fit_counts_as_the_floor():
    fitness = criterion("fitness").value
    assert (
        fitness(Misfit((0.0,), (0.01,), 100, (9.0,)), 3)
        == fitness(Misfit((0.01,), (0.01,), 100, (9.0,)), 3)
        == 1 / 0.07
    )
    assert fitness(Misfit((0.0,), (0.01,), 100, (9.0,)), 3) > fitness(Misfit((0.0,), (0.01,), 100, (9.0,)), 4)


def test_a_diverged_simulation_has_no_chance():
    lost = Misfit((np.inf,), (0.01,), 100, (9.0,))
    assert criterion("fitness").value(lost, 3) == 0.0
    bic = criterion("bic")
    values = [bic.value(lost, 3), bic.value(Misfit((5.0,), (0.01,), 100, (9.0,)), 3)]
    assert values[0] == -np.inf
    assert bic.chances(values)[0] == 0.0


def test_bic_prefers_the_smaller_model_unless_the_larger_one_pays():
    bic = criterion("bic").value
    assert bic(Misfit((1.0,), (1e-9,), 1000, (9.0,)), 3) > bic(Misfit((0.999,), (1e-9,), 1000, (9.0,)), 4)
    assert bic(Misfit((1.0,), (1e-9,), 1000, (9.0,)), 3) < bic(Misfit((0.9,), (1e-9,), 1000, (9.0,)), 4)


def test_ranks():
    assert by_rank([5.0, -1.0, 3.0]).tolist() == pytest.approx([1.0, 1 / 3, 2 / 3])
    equal = by_rank([1.0, 1.0, 0.0])
    assert equal[0] == equal[1] > equal[2]


def test_an_unknown_criterion():
    with pytest.raises(SettingsError, match="Did you mean 'fitness'"):
        criterion("fitnes")


def test_fit():
    assert Misfit((1.0,), (1e-9,), 100, (100.0,)).fit_percent == pytest.approx(90.0)
    assert Misfit((1.0, 16.0), (1e-9, 1e-9), 100, (100.0, 64.0)).fit_percent == pytest.approx(70.0)
