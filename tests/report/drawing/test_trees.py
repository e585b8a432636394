"""Drawings of trees."""

import itertools

from brightgrey.kit import Placed
from brightgrey.report.drawing.matplotlib_figure import picture
from brightgrey.report.drawing.trees import positions, trees
from brightgrey.search.genetic import Node


def node(name, *children):
    return Node(Placed.parse(name), (), children)


TREE = node("two_mass", node("coulomb", node("viscous"), node("gravity")), node("delay"))


def test_positions__leaves_side_by_side_and_parents_above_their_middle():
    assert positions(TREE) == ((1.25, 0), (0.5, 1), (0.0, 2), (1.0, 2), (2.0, 1))


def test_positions__nodes_of_a_depth__do_not_touch():
    wide = node("two_mass", node("coulomb", node("viscous", node("delay"), node("gravity"))), node("backlash"), TREE)
    for depth in range(5):
        across = sorted(x for x, d in positions(wide) if d == depth)
        assert all(b - a >= 1.0 for a, b in itertools.pairwise(across))


def test_trees__show_the_numbers_of_the_paper():
    figure = trees([TREE, node("one_mass")], ["first", "second"])
    first, second = figure.axes[:2]
    assert sorted(t.get_text() for t in first.texts) == ["11", "2", "5", "6", "8"]
    assert len(first.lines) == 4
    assert [t.get_text() for t in second.texts] == ["1"]
    assert picture(figure) == picture(trees([TREE, node("one_mass")], ["first", "second"]))
