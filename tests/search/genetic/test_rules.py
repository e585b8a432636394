"""Construction rules against all legal structures, set by set."""

import itertools

from brightgrey.kit import PAPER, Grammar, Placed, Structure, grammar_named
from brightgrey.search.genetic.rules import Rules

LEGAL = {frozenset(s.placed) for s in PAPER.structures()}


def subsets(rules):
    for size in range(len(rules.options) + 1):
        for chosen in itertools.combinations(rules.options, size):
            yield frozenset(chosen)


def test_allowed__partial_tree__only_completable_types(rules):
    contained = {frozenset(part) for s in LEGAL for n in range(len(s) + 1) for part in itertools.combinations(s, n)}
    for present in subsets(rules):
        if present in contained:
            wanted = {o for o in rules.options if o not in present and present | {o} in contained}
            assert set(rules.allowed(present)) == wanted, present


def test_allowed__last_node__completes_the_tree(rules):
    for present in subsets(rules):
        wanted = {o for o in rules.options if o not in present and present | {o} in LEGAL}
        assert set(rules.allowed(present, 1)) == wanted, present


def test_complete__types__legal_structures_only(rules):
    assert all(rules.complete(tuple(present)) == (present in LEGAL) for present in subsets(rules))
    assert not rules.complete(())
    assert not rules.complete((Placed("one_mass"), Placed("one_mass")))


def test_largest_tree(rules):
    assert rules.largest_size == max(len(s) for s in LEGAL)


def test_largest_tree__effects_that_exclude_each_other__one_of_them():
    places = {"three_mass": (1,), "coulomb": (1, 2), "backlash": (1, 2), "cubic_spring": (1, 2)}
    assert Rules(Grammar("small", places)).largest_size == max(
        len(s.placed) for s in Grammar("small", places).structures()
    )


def test_rules__function_set_of_millions__are_not_listed():
    rules = Rules(grammar_named("drive").whole)
    assert rules.largest_size > len(PAPER.placed)
    assert rules.complete((Placed("two_mass"), Placed("coulomb", 2)))


def test_another_grammar_is_data():
    small = Rules(Grammar("small", {"two_mass": (1,), "coulomb": (1, 2), "backlash": (1,)}))
    assert set(small.allowed((Placed("two_mass"),))) == {Placed("coulomb"), Placed("coulomb", 2), Placed("backlash")}
    assert small.complete(Structure.parse("two_mass+coulomb+coulomb@2").placed)
    assert not small.complete(Structure.parse("two_mass+viscous").placed)
