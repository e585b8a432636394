"""The grammar `paper`: exactly 448 structures, and a reason for every refusal."""

import pytest

from brightgrey.effects import registry
from brightgrey.errors import StructureError
from brightgrey.kit import PAPER, Grammar, Placed, Structure, function_set, grammar_named

ALL = list(PAPER.structures())


def test_paper_grammar__structures__are_448_and_unequal():
    # Four ladders with seven effects each, without the 64 that would put backlash on a shaft of one mass.
    assert len(ALL) == len(set(ALL)) == len({str(s) for s in ALL}) == 4 * 2**7 - 64 == 448


def test_paper_grammar__every_structure__reads_back():
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


def test_function_set__every_effect__stands_at_all_its_places():
    kit = function_set()
    assert set(kit.places) == set(registry())
    for placed in kit.placed:
        names = dict.fromkeys(["four_mass", *(f"{n}@{placed.place}" for n in placed.effect.requires), str(placed)])
        others = [n for n in names if n == str(placed) or not placed.effect.masses]
        assert placed in kit.parse("+".join(others)).placed


def test_drive__what_is_not_held_back__is_the_paper():
    drive = grammar_named("drive")
    assert drive.places == PAPER.places
    held_back = [str(p) for p in drive.further]
    assert len(held_back) == len(set(held_back)) == 22
    assert set(held_back).isdisjoint(map(str, drive.placed))
    assert set(drive.whole.parameters) > set(PAPER.parameters)
    assert set(PAPER.parameters) == {name for s in ALL for name in s.parameters}


def test_grammar__effects_that_exclude_each_other__stand_at_different_places():
    rules = function_set()
    rules.parse("three_mass+backlash+cubic_spring@2")
    with pytest.raises(StructureError, match="'backlash' and 'cubic_spring' exclude each other"):
        rules.parse("three_mass+backlash+cubic_spring")
    offered = grammar_named("drive").offering([Placed("cubic_spring", 1)])
    assert "backlash" not in offered.places
    assert grammar_named("drive").offering([Placed("cubic_spring", 2)]).places["backlash"] == (1,)


def test_grammar__offering__brings_what_is_required():
    offered = grammar_named("drive").offering([Placed("directional_viscous", 2)])
    assert offered.places["viscous"] == (1, 2)
    assert offered.further == ()
    with pytest.raises(StructureError, match="'directional_viscous@2' requires 'viscous@2'"):
        offered.parse("two_mass+viscous+directional_viscous@2")
    with pytest.raises(StructureError, match="Did you mean 'drive'"):
        grammar_named("drives")


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
