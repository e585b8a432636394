"""Trees that grow at random, and the initial population (paper section 3.1, step 2)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from brightgrey.kit import Placed
from brightgrey.search.genetic.rules import Rules
from brightgrey.search.genetic.tree import Node, NodeValues, attach

__all__ = ["Draw", "complete_tree", "grow", "initial_population", "pick", "random_tree"]

Option = TypeVar("Option")
Draw = Callable[[Placed, np.random.Generator], NodeValues]
"""Draws random parameter values of a submodel within their ranges."""


def pick(options: tuple[Option, ...], rng: np.random.Generator) -> Option:
    """One of `options`, each as likely."""
    return options[int(rng.integers(len(options)))]


def grow(
    branch: Node | None, rest: tuple[Placed, ...], count: int, rules: Rules, draw: Draw, rng: np.random.Generator
) -> Node | None:
    """Add up to `count` nodes of random types to `branch`, each originating from a random node of it.

    Ends early where no type fits any more.

    Parameters
    ----------
    branch : Node or None
    rest : tuple of Placed
        Types elsewhere in the tree that `branch` belongs to.
    count : int
    rules : Rules
    draw : callable
    rng : numpy.random.Generator
    """
    for left in range(count, 0, -1):
        present = (*rest, *(branch.types if branch else ()))
        options = rules.allowed(present, left)
        if not options:
            break
        chosen = pick(options, rng)
        origin = int(rng.integers(branch.size)) if branch else 0
        branch = attach(branch, origin, Node(chosen, draw(chosen, rng)))
    return branch


def random_tree(rules: Rules, draw: Draw, rng: np.random.Generator) -> Node:
    """Tree of a random size from one node to that of a model with all features."""
    tree = grow(None, (), int(rng.integers(1, rules.largest_size + 1)), rules, draw, rng)
    if tree is None:
        raise AssertionError("a grammar has at least one multiple-mass system")
    return tree


def initial_population(size: int, rules: Rules, draw: Draw, rng: np.random.Generator) -> tuple[Node, ...]:
    """Initial population of `size` trees."""
    return tuple(random_tree(rules, draw, rng) for _ in range(size))


def complete_tree(tree: Node | None, rules: Rules, draw: Draw, rng: np.random.Generator) -> Node:
    """Append the multiple-mass system with the fewest masses if there is none.

    Where the rules exclude that one (one mass beside a backlash), one of the others is drawn: the paper leaves
    this case open.
    """
    if tree is not None and any(placed.effect.masses for placed in tree.types):
        return tree
    options = rules.completing(tree.types if tree else ())
    chosen = options[0] if options[0] == rules.mass_chains[0] else pick(options, rng)
    origin = int(rng.integers(tree.size)) if tree else 0
    return attach(tree, origin, Node(chosen, draw(chosen, rng)))
