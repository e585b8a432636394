"""The grammar `paper`: exactly 448 structures, and a reason for every refusal."""

import pytest

from brightgrey.effects import registry
from brightgrey.errors import StructureError
from brightgrey.kit import PAPER, Grammar, Structure

ALL = list(PAPER.structures())


def test_paper_grammar__structures__are_448_and_unequal():
    # Four ladders with seven effects each, without the 64 that would put backlash on a shaft of one mass.
    assert len(ALL) == len(set(ALL)) == len({str(s) for s in ALL}) == 4 * 2**7 - 64 == 448


def test_paper_grammar__every_structure__reads_back():
    assert {p.name for s in ALL for p in s.placed} == set(registry())
    for structure in ALL:
        assert PAPER.parse(str(structure)) == structure


def test_paper_grammar__structures__smaller_come_first():
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
def test_parse__wrong_combination__refused_with_the_rule(text, said):
    with pytest.raises(StructureError) as refusal:
        PAPER.parse(text)
    for part in said:
        assert part in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_grammar__other_places__gives_its_structures():
    wide = Grammar("wide", {"two_mass": (1,), "coulomb": (1, 2)})
    assert [str(s) for s in wide.structures()] == [
        "two_mass",
        "two_mass+coulomb",
        "two_mass+coulomb@2",
        "two_mass+coulomb+coulomb@2",
    ]
    assert wide.broken_rule(Structure.parse("two_mass+viscous")) is not None
    three = Grammar("three", {"two_mass": (1,), "coulomb": (3,)})
    with pytest.raises(StructureError, match="no mass 3"):
        three.parse("two_mass+coulomb@3")
