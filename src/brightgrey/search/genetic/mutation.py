"""The four mutations of a tree (paper section 3.2). Where a mutation is not possible, the tree stays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from brightgrey.search.genetic.population import Draw, grow, pick
from brightgrey.search.genetic.rules import Rules
from brightgrey.search.genetic.tree import Node, attach, drop, prune, relabel

__all__ = ["MUTATIONS", "chromosome", "delete", "insert", "point"]


def point(tree: Node, rules: Rules, draw: Draw, rng: np.random.Generator) -> Node:
    """Give one random node another type that satisfies the rules, with random parameters."""
    index = int(rng.integers(tree.size))
    others = (*tree.types[:index], *tree.types[index + 1 :])
    old = tree.types[index]
    options = tuple(o for o in rules.allowed(others, 1) if o != old)
    if not options:
        return tree
    chosen = pick(options, rng)
    return relabel(tree, index, chosen, draw(chosen, rng))


def insert(tree: Node, rules: Rules, draw: Draw, rng: np.random.Generator) -> Node:
    """Add a node of a random type that satisfies the rules, originating from a random node."""
    options = rules.allowed(tree.types, 1)
    if not options:
        return tree
    chosen = pick(options, rng)
    return attach(tree, int(rng.integers(tree.size)), Node(chosen, draw(chosen, rng)))


def delete(tree: Node, rules: Rules, draw: Draw, rng: np.random.Generator) -> Node:
    """Delete a random node if the rules are respected without it; its children go to its parent."""
    index = int(rng.integers(tree.size))
    left = drop(tree, index)
    return left if left is not None and rules.complete(left.types) else tree


def chromosome(tree: Node, rules: Rules, draw: Draw, rng: np.random.Generator) -> Node:
    """Replace a random node and the branch originating from it by a branch that is grown at random.

    The size of the resulting tree is random, from that of the tree without the branch (plus one node where this
    has no multiple-mass system) to the largest one.
    """
    index = int(rng.integers(tree.size))
    rest = prune(tree, index)
    types = rest.types if rest else ()
    least = len(types) + (not any(placed.effect.masses for placed in types))
    size = int(rng.integers(least, rules.largest_size + 1))
    branch = grow(None, types, size - len(types), rules, draw, rng)
    if rest is None or branch is None:
        return branch or rest or tree
    return attach(rest, _parent(tree, index), branch)


def _parent(tree: Node, index: int) -> int:
    """Index of the node that node `index` (not the root) originates from; it stands before it."""
    first = 1
    for child in tree.children:
        if index == first:
            return 0
        if index < first + child.size:
            return first + _parent(child, index - first)
        first += child.size
    raise IndexError(f"node {index} of a tree with {tree.size}")


MutationOperator = Callable[[Node, Rules, Draw, np.random.Generator], Node]

MUTATIONS: Mapping[str, MutationOperator] = MappingProxyType(
    {"point": point, "insertion": insert, "deletion": delete, "chromosome": chromosome}
)
"""Mutations by name, in the order in which they are performed."""
