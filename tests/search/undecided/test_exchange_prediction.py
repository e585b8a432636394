"""What a structure would leave with several effects in the place of one, at first order."""

import numpy as np
import pytest

from brightgrey.kit import PAPER, Placed
from brightgrey.search.further.proposals import EffectChanges
from brightgrey.search.undecided.exchange_prediction import WithoutEffect

EXPLAINED, ONE, TWO = np.eye(20)[:3]


def change(effect, column):
    placed = Placed(effect)
    return EffectChanges(placed, (placed,), {"size": np.ones(1)}, "size", column[:, None], either_sign=True)


@pytest.fixture
def without():
    return WithoutEffect(PAPER.parse("one_mass"), 3.0 * ONE + 4.0 * TWO, EXPLAINED[:, None], 30.0)


def test_with_several__two_effects__deviance_and_effects_with_the_largest_change_first(without):
    deviance, effects = without.with_several([change("viscous", ONE + EXPLAINED), change("gravity", TWO)])
    assert deviance == pytest.approx(5.0)
    assert [f.placed.name for f in effects] == ["gravity", "viscous"]
    assert [f.start["size"] for f in effects] == pytest.approx([-4.0, -3.0])


def test_with_several__effect_that_requires_the_one_that_is_gone__is_left_out(without):
    deviance, effects = without.with_several([change("directional_viscous", ONE)])
    assert (deviance, effects) == (30.0, [])


def test_with_several__change_that_the_parameters_explain_but_for_rounding__is_left_out(without):
    deviance, effects = without.with_several([change("viscous", EXPLAINED - 1e-15 * ONE)])
    assert (deviance, effects) == (30.0, [])
