"""Recombination of two trees (paper section 3.2)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brightgrey.kit import Placed
from brightgrey.search.genetic.population import Draw, complete_tree
from brightgrey.search.genetic.rules import Rules
from brightgrey.search.genetic.tree import Node, graft

__all__ = ["recombine", "recombine_at"]


def recombine(first: Node, second: Node, rules: Rules, draw: Draw, rng: np.random.Generator) -> Node:
    """Child of two parents.

    The first parent is copied up to a random node, which is kept. What originates from it there is replaced by
    the branch of the second parent that begins with a random node. Parameter estimates come along with the
    nodes.
    """
    cut, origin = int(rng.integers(first.size)), int(rng.integers(second.size))
    return recombine_at(first, cut, tuple(second.nodes())[origin], rules, draw, rng)


def recombine_at(first: Node, cut: int, branch: Node, rules: Rules, draw: Draw, rng: np.random.Generator) -> Node:
    """Recombination with both places given: `branch` in place of all behind node `cut` of `first`.

    A node of the branch that breaks a construction rule is dropped, its children then originate from its parent.
    At the end a multiple-mass system is appended if none is left.
    """
    trunk = graft(first, cut, ())
    legal, _ = _legal(branch, trunk.types, rules)
    return complete_tree(graft(trunk, cut, legal), rules, draw, rng)


def _legal(branch: Node, present: tuple[Placed, ...], rules: Rules) -> tuple[tuple[Node, ...], tuple[Placed, ...]]:
    """Legal part of `branch` beside the types `present`, and all types then."""
    keep = branch.type in rules.allowed(present)
    present = (*present, branch.type) if keep else present
    children: tuple[Node, ...] = ()
    for child in branch.children:
        kept, present = _legal(child, present, rules)
        children += kept
    return ((replace(branch, children=children),) if keep else children), present
