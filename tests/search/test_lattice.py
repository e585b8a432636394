"""Which structure contains which."""

import pytest

from brightgrey.kit import PAPER
from brightgrey.search.lattice import (
    added_effects,
    contains,
    maximal_submodels,
    minimal_elements,
    minimal_supermodels,
    one_larger,
    one_smaller,
)

ALL = list(PAPER.structures())


def s(text):
    return PAPER.parse(text)


@pytest.mark.parametrize(
    ("big", "small", "held"),
    [
        ("two_mass+coulomb", "one_mass+coulomb", True),
        ("two_mass+coulomb", "two_mass", True),
        ("two_mass+coulomb", "one_mass+viscous", False),
        ("one_mass+coulomb", "two_mass", False),
        ("one_mass", "one_mass", True),
        ("four_mass+delay", "one_mass", True),
    ],
)
def test_masses_count_cumulatively(big, small, held):
    assert contains(s(big), s(small)) is held


@pytest.mark.parametrize("structure", ALL[::37], ids=str)
def test_neighbours_differ_by_one_step(structure):
    for big in one_larger(structure, ALL):
        assert structure in one_smaller(big, ALL)
        assert contains(big, structure)
        assert len(added_effects(big, structure)) == 1
        assert abs(big.masses - structure.masses) + abs(len(big.placed) - len(structure.placed)) == 1


@pytest.mark.parametrize("structure", ALL[::53], ids=str)
def test_maximal_submodels__incomplete_set__next_ones(structure):
    some = ALL[::7]
    for found, holds in ((maximal_submodels(structure, some), False), (minimal_supermodels(structure, some), True)):
        related = [t for t in some if t != structure and (contains(t, structure) if holds else contains(structure, t))]
        assert set(found) <= set(related)
        assert not any(a != b and contains(a, b) for a in found for b in found)
        for t in related:
            assert any(contains(t, f) if holds else contains(f, t) for f in found)
    assert set(minimal_supermodels(structure, ALL)) == set(one_larger(structure, ALL))


def test_contains__smallest_and_largest__bound_all():
    assert minimal_elements(ALL) == [s("one_mass")]
    most = [t for t in ALL if not one_larger(t, ALL)]
    assert most == [max(ALL, key=lambda t: (t.masses, len(t.placed)))]


def test_minimal_ones_keep_their_order():
    given = [s("two_mass+coulomb"), s("one_mass+viscous"), s("two_mass+coulomb+viscous"), s("one_mass+coulomb+delay")]
    assert minimal_elements(given) == [given[0], given[1], given[3]]


def test_effects_beyond_name_the_masses_first():
    assert added_effects(s("three_mass+coulomb+delay"), s("one_mass+delay")) == ("three_mass", "coulomb")
