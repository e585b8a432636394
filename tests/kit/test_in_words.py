"""Structures and effects in words."""

import pytest

from brightgrey.effects import registry
from brightgrey.kit import Placed, Structure
from brightgrey.kit.in_words import effect_in_words, enumerated, structure_in_words


@pytest.mark.parametrize(
    ("items", "text"), [([], ""), (["a"], "a"), (["a", "b"], "a and b"), (["a", "b", "c"], "a, b and c")]
)
def test_enumerated__any_number__and_before_the_last(items, text):
    assert enumerated(items) == text


@pytest.mark.parametrize(
    ("structure", "words"),
    [
        ("one_mass", "one mass"),
        ("two_mass+coulomb", "two masses with Coulomb friction"),
        ("one_mass+coulomb+viscous+stribeck", "one mass with Coulomb, viscous and Stribeck friction"),
        (
            "two_mass+coulomb+coulomb@2+viscous+gravity+delay",
            "two masses with Coulomb and viscous friction, Coulomb friction at mass 2, a constant load, and dead time",
        ),
        ("three_mass+backlash+backlash@2", "three masses with backlash, and backlash at shaft 2"),
    ],
)
def test_structure_in_words__kinds_of_friction_share_that_word(structure, words):
    assert structure_in_words(Structure.parse(structure)) == words


def test_effect_in_words__every_effect__has_words_that_stand_in_a_sentence():
    for name, effect in registry().items():
        words = effect_in_words(Placed(name))
        assert words == words.strip()
        assert "_" not in words
        assert not words.endswith(".")
        assert effect_in_words(Placed(name), article=False) == effect.words.removeprefix("a ")


def test_effect_in_words__masses__are_counted():
    assert effect_in_words(Placed("three_mass")) == "a third mass"
