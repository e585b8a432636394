"""Which structure contains which, and the lattice of a grammar's structures as bit masks."""

import numpy as np
import pytest

from brightgrey.errors import SettingsError
from brightgrey.kit import PAPER, Grammar
from brightgrey.search.lattice import (
    Lattice,
    added_effects,
    contains,
    maximal_submodels,
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
    assert [t for t in ALL if all(contains(other, t) for other in ALL)] == [s("one_mass")]
    most = [t for t in ALL if not one_larger(t, ALL)]
    assert most == [max(ALL, key=lambda t: (t.masses, len(t.placed)))]


def test_effects_beyond_name_the_masses_first():
    assert added_effects(s("three_mass+coulomb+delay"), s("one_mass+delay")) == ("three_mass", "coulomb")


PLACES = {"one_mass": (1,), "two_mass": (1,), "three_mass": (1,)}
SEVERAL = {
    "friction at each mass": Grammar("a", {**PLACES, "coulomb": (1, 2, 3), "viscous": (1, 3)}),
    "gaps at both shafts": Grammar("b", {**PLACES, "backlash": (1, 2), "delay": (1,)}),
    "one mass, effects beyond it": Grammar("c", {"one_mass": (1,), "gravity": (1,), "coulomb": (1, 2)}),
}


def test_lattice__paper_grammar__448_structures():
    lattice = Lattice.of(PAPER)
    masks = lattice.masks()
    assert lattice.size == len(masks) == len(set(masks)) == 448
    assert {lattice.structure(m) for m in masks} == set(ALL)


def test_mask__every_structure__round_trip_keeps_containment():
    lattice = Lattice.of(PAPER)
    masks = {t: lattice.mask(t) for t in ALL}
    assert all(lattice.structure(m) == t for t, m in masks.items())
    for big in ALL[::11]:
        assert [t for t in ALL if contains(big, t)] == [t for t in ALL if not masks[t] & ~masks[big]]


@pytest.mark.parametrize("name", SEVERAL)
def test_size__effects_at_several_places__as_many_as_are_listed(name):
    lattice, listed = Lattice.of(SEVERAL[name]), list(SEVERAL[name].structures())
    assert lattice.size == len(listed)
    assert {lattice.structure(m) for m in lattice.masks()} == set(listed)


@pytest.mark.parametrize("grammar", [PAPER, *SEVERAL.values()], ids=lambda g: g.name)
def test_within__any_set_of_atoms__largest_structure_within_it(grammar):
    lattice, rng = Lattice.of(grammar), np.random.default_rng(1)
    masks = lattice.masks()
    for some in rng.integers(0, lattice.everything + 1, size=40).tolist():
        inside = [m for m in masks if not m & ~some]
        assert lattice.within(some) == max(inside, key=int.bit_count)
        assert all(not m & ~lattice.within(some) for m in inside)


def test_without__mass__takes_what_requires_it():
    lattice = Lattice.of(PAPER)
    whole = lattice.mask(s("four_mass+coulomb+backlash+delay"))
    left = {
        str(p): str(lattice.structure(lattice.without(whole, 1 << i)))
        for i, p in enumerate(lattice.atoms)
        if whole >> i & 1
    }
    assert left["two_mass"] == "one_mass+coulomb+delay"
    assert left["three_mass"] == "two_mass+coulomb+backlash+delay"
    assert left["backlash"] == "four_mass+coulomb+delay"


def test_lattice__required_and_excluded__masses_count_cumulatively():
    lattice = Lattice.of(PAPER, ("two_mass", "delay"), ("three_mass", "stribeck"))
    wanted = {t for t in ALL if t.masses == 2 and "delay" in t.names and "stribeck" not in t.names}
    assert {lattice.structure(m) for m in lattice.masks()} == wanted
    assert lattice.size == len(wanted)
    assert lattice.required == lattice.mask(s("two_mass+delay"))
    assert lattice.optional == lattice.everything & ~lattice.required


def test_lattice__gap_required__has_its_second_mass():
    lattice = Lattice.of(PAPER, require=("backlash",))
    assert min(lattice.structure(m).masses for m in lattice.masks()) == 2
    assert lattice.size == 192  # 3 numbers of masses, 6 other effects


@pytest.mark.parametrize(
    ("require", "exclude", "message"),
    [
        (("colomb",), (), "Did you mean 'coulomb'"),
        ((), ("colomb",), "Did you mean 'coulomb'"),
        ((), ("one_mass",), "one mass at least"),
        (("coulomb",), ("coulomb",), r"^'coulomb' is both required and excluded$"),
        (("three_mass",), ("two_mass",), r"^no structure has three_mass and lacks two_mass$"),
        (("backlash",), ("two_mass",), r"^no structure has backlash and lacks two_mass$"),
    ],
)
def test_lattice__impossible_request__refused(require, exclude, message):
    with pytest.raises(SettingsError, match=message):
        Lattice.of(PAPER, require, exclude)
