"""The grammar `paper`: exactly 448 structures, and a reason for every refusal."""

import pytest

from brightgrey.effects import registry
from brightgrey.errors import StructureError
from brightgrey.kit import PAPER, Grammar, Structure

ALL = list(PAPER.structures())


def test_there_are_exactly_448_structures_and_no_two_are_equal():
    # Four ladders with seven effects each, without the 64 that would put backlash on a shaft of one mass.
    assert len(ALL) == len(set(ALL)) == len({str(s) for s in ALL}) == 4 * 2**7 - 64 == 448


def test_every_effect_is_present_and_every_structure_reads_back():
    assert {p.name for s in ALL for p in s.placed} == set(registry())
    for structure in ALL:
        assert PAPER.parse(str(structure)) == structure


def test_smaller_structures_come_first():
    sizes = [len(s.placed) for s in ALL]
    assert sizes == sorted(sizes)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("coulomb+viscous", ["exactly one of", "none"]),
        ("one_mass+two_mass", ["exactly one of", "one_mass and two_mass"]),
        ("one_mass+backlash", ["no shaft 1", "one_mass"]),
        ("two_mass+coulomb@2", ["'paper'", "'coulomb' at mass 1"]),
        ("three_mass+backlash@2", ["'paper'", "'backlash' at shaft 1"]),
        ("two_mass+stribek", ["'stribeck'"]),
    ],
)
def test_wrong_combinations_are_refused_with_the_reason(text, said):
    with pytest.raises(StructureError) as refusal:
        PAPER.parse(text)
    for part in said:
        assert part in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_grammar_is_data():
    wide = Grammar("wide", {"two_mass": (1,), "coulomb": (1, 2)})
    assert [str(s) for s in wide.structures()] == [
        "two_mass",
        "two_mass+coulomb",
        "two_mass+coulomb@2",
        "two_mass+coulomb+coulomb@2",
    ]
    assert wide.reason_against(Structure.parse("two_mass+viscous")) is not None
    three = Grammar("three", {"two_mass": (1,), "coulomb": (3,)})
    with pytest.raises(StructureError, match="no mass 3"):
        three.parse("two_mass+coulomb@3")
