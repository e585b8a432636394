"""Trees: order of no meaning, changes that leave the rest alone."""

import pytest

from brightgrey.errors import StructureError
from brightgrey.kit import Placed, Structure
from brightgrey.search.genetic.tree import Node, attach, drop, graft, prune, relabel, tree_of, with_values


def node(name, *children, **values):
    return Node(Placed(name), tuple(values.items()), children)


def shape(tree):
    return None if tree is None else str(tree)


TREE = node("two_mass", node("coulomb", node("viscous"), node("gravity")), node("delay"))


def test_multiplicity__tree__counts_nodes_of_type():
    assert TREE.multiplicity[Placed("viscous")] == 1
    assert node("viscous", node("viscous")).multiplicity[Placed("viscous")] == 2
    with pytest.raises(StructureError, match="more than once"):
        _ = node("viscous", node("viscous")).structure


def test_order_has_no_meaning_for_the_model():
    other = node("delay", node("viscous", node("gravity"), node("two_mass", node("coulomb"))))
    assert other.structure == TREE.structure
    assert other != TREE


def test_nodes_come_parent_first():
    assert [str(n.type) for n in TREE.nodes()] == ["two_mass", "coulomb", "viscous", "gravity", "delay"]
    assert TREE.size == 5


def test_str__tree__nested():
    assert str(TREE) == "two_mass(coulomb(viscous, gravity), delay)"


def test_attach():
    assert shape(attach(TREE, 3, node("backlash"))) == "two_mass(coulomb(viscous, gravity(backlash)), delay)"
    assert shape(attach(TREE, 0, node("backlash"))) == "two_mass(coulomb(viscous, gravity), delay, backlash)"
    assert attach(None, 0, TREE) is TREE


def test_drop_leaves_the_children_to_the_parent():
    assert shape(drop(TREE, 1)) == "two_mass(viscous, gravity, delay)"
    assert shape(drop(TREE, 3)) == "two_mass(coulomb(viscous), delay)"
    assert shape(drop(TREE, 0)) == "coulomb(viscous, gravity, delay)"
    assert drop(node("delay"), 0) is None


def test_prune_takes_the_branch():
    assert shape(prune(TREE, 1)) == "two_mass(delay)"
    assert shape(prune(TREE, 4)) == "two_mass(coulomb(viscous, gravity))"
    assert prune(TREE, 0) is None


def test_graft_and_relabel():
    assert shape(graft(TREE, 1, (node("stribeck"),))) == "two_mass(coulomb(stribeck), delay)"
    assert shape(relabel(TREE, 1, Placed("stribeck"), ())) == "two_mass(stribeck(viscous, gravity), delay)"


def test_attach__index_beyond_tree__error():
    with pytest.raises(IndexError):
        attach(TREE, 5, node("backlash"))


def test_estimates_go_to_their_nodes():
    tree = node("two_mass", node("coulomb", M_C=1.0), J1=2.0, J2=3.0)
    changed = with_values(tree, {"M_C": 5.0, "J2": 6.0, "unknown": 7.0})
    assert changed.parameters == {"J1": 2.0, "J2": 6.0, "M_C": 5.0}


def test_tree_of__structure__flat_tree():
    structure = Structure((Placed("two_mass"), Placed("coulomb"), Placed("coulomb", 2), Placed("delay")))
    values = {name: float(k) for k, name in enumerate(structure.parameters)}
    tree = tree_of(structure, values)
    assert tree.structure == structure
    assert tree.parameters == values
    assert tree.size == len(structure.placed)
