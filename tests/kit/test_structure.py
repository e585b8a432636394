"""Structures: reading, order, names of parameters, refusals."""

import pytest

from brightgrey.effects import registry
from brightgrey.errors import StructureError
from brightgrey.kit import Placed, Structure


def test_order_and_spaces_of_the_text_do_not_matter():
    structure = Structure.parse("viscous + coulomb+ two_mass")
    assert str(structure) == "two_mass+coulomb+viscous"
    assert structure == Structure.parse("two_mass+coulomb+viscous")
    assert hash(structure) == hash(Structure.of(["coulomb", "two_mass", "viscous"]))
    assert structure.names == ("two_mass", "coulomb", "viscous")


def test_text_of_a_structure_reads_back():
    for text in ("four_mass", "two_mass+coulomb@2", "three_mass+coulomb+coulomb@3+backlash@2"):
        assert str(Structure.parse(text)) == text


def test_place_one_is_omitted_and_other_places_mark_the_parameters():
    structure = Structure.parse("two_mass+coulomb@1+coulomb@2")
    assert structure.names == ("two_mass", "coulomb", "coulomb@2")
    assert list(structure.parameters) == ["J1", "J2", "c1", "d1", "M_C", "M_C@2"]
    assert Placed.parse("coulomb@2") == Placed("coulomb", 2)


def test_masses_are_counted_from_the_declarations():
    for name, effect in registry().items():
        assert Structure.of([name]).masses == effect.masses


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("two_mass+colomb", "'coulomb'"),
        ("twomass", "'two_mass'"),
        ("two_mass+", "unknown effect ''"),
        ("two_mass+coulomb@0", "whole number from 1"),
        ("two_mass+coulomb@x", "'x'"),
        ("two_mass+coulomb@-1", "'-1'"),
        ("two_mass+coulomb+coulomb", "'coulomb' stands more than once"),
        ("two_mass+coulomb@2+coulomb@2", "'coulomb@2' stands more than once"),
    ],
)
def test_wrong_text_is_refused_in_one_line_that_helps(text, said):
    with pytest.raises(StructureError) as refusal:
        Structure.parse(text)
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)
