"""Structures: reading, order, names of parameters, refusals."""

import pytest

from brightgrey.effects import Scales, registry
from brightgrey.errors import StructureError
from brightgrey.kit import Placed, Structure


def test_parse__other_order_and_spaces__same_structure():
    structure = Structure.parse("viscous + coulomb+ two_mass")
    assert str(structure) == "two_mass+coulomb+viscous"
    assert structure == Structure.parse("two_mass+coulomb+viscous")
    assert hash(structure) == hash(Structure.of(["coulomb", "two_mass", "viscous"]))
    assert structure.names == ("two_mass", "coulomb", "viscous")


def test_structure__its_text__reads_back():
    for text in ("four_mass", "two_mass+coulomb@2", "three_mass+coulomb+coulomb@3+backlash@2"):
        assert str(Structure.parse(text)) == text


def test_placed__place_one__is_omitted_in_names():
    structure = Structure.parse("two_mass+coulomb@1+coulomb@2")
    assert structure.names == ("two_mass", "coulomb", "coulomb@2")
    assert list(structure.parameters) == ["J1", "J2", "c1", "d1", "M_C", "M_C@2"]
    assert Placed.parse("coulomb@2") == Placed.parse(" coulomb @ 2 ") == Placed("coulomb", 2)


def test_structure__masses__counted_from_the_declarations():
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
def test_parse__wrong_text__refused_in_one_line(text, said):
    with pytest.raises(StructureError) as refusal:
        Structure.parse(text)
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_of__one_text__advice_to_parse_it():
    with pytest.raises(StructureError, match=r"one text came; Structure.parse reads 'two_mass\+coulomb'"):
        Structure.of("two_mass+coulomb")


def test_parse__no_text__refused():
    with pytest.raises(StructureError, match=r"a text such as two_mass\+coulomb is expected, 3 came"):
        Structure.parse(3)


def test_relevant_size__gap_in_another_shaft__reads_the_stiffness_of_that_shaft():
    scales = Scales(2.0, 40.0, 400.0, 1e6, 1e-3, 2.0, 0.02, 0.1, 0.01, 0.0)
    values = {"c1": 100.0, "c2": 50.0}
    assert Placed("backlash").relevant_size(scales, values) == {"alpha": pytest.approx(0.001)}
    assert Placed("backlash", 2).relevant_size(scales, values) == {"alpha@2": pytest.approx(0.002)}


def test_has_hard_limit__only_with_a_gap():
    assert Structure.parse("two_mass+coulomb+backlash").has_hard_limit
    assert not Structure.parse("two_mass+coulomb+stribeck+gravity+current_control+delay").has_hard_limit


def test_parameters__of_another_place__say_where():
    declared = Structure.parse("two_mass+coulomb+coulomb@2").parameters
    assert declared["M_C"].about == "Coulomb friction torque (or force)"
    assert declared["M_C@2"].about == "Coulomb friction torque (or force), at mass 2"
