"""Trees of the degenerate genetic programming (paper section 3.1): nodes carry submodels, order means nothing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from brightgrey.kit import Placed, Structure

__all__ = ["Node", "NodeValues", "attach", "drop", "graft", "prune", "relabel", "tree_of", "with_values"]

NodeValues = tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Node:
    """A node with all that originates from it; the root stands for the whole tree.

    The number of nodes of one type is the multiplicity of that submodel. How they hang together is of no meaning
    for the model, only for what recombination and mutation move together.
    """

    type: Placed  #: Submodel, and where it stands.
    values: NodeValues = ()  #: Its parameter values by symbol, SI: a random draw, or the latest estimate.
    children: tuple[Node, ...] = ()

    def nodes(self) -> Iterator[Node]:
        """All nodes, a parent before its children (pre-order). A node's position here is its index."""
        yield self
        for child in self.children:
            yield from child.nodes()

    @cached_property
    def size(self) -> int:
        """Number of nodes."""
        return 1 + sum(child.size for child in self.children)

    @cached_property
    def types(self) -> tuple[Placed, ...]:
        """Types of all nodes in pre-order."""
        return tuple(node.type for node in self.nodes())

    @property
    def multiplicity(self) -> Mapping[Placed, int]:
        """Number of nodes of each type."""
        return Counter(self.types)

    @cached_property
    def structure(self) -> Structure:
        """Structure of the model; raises StructureError if a type is there more than once."""
        return Structure(self.types)

    @property
    def parameters(self) -> dict[str, float]:
        """Parameter values, SI, by their names in the structure."""
        return {n.type.parameter(symbol): value for n in self.nodes() for symbol, value in n.values}

    def __str__(self) -> str:
        if not self.children:
            return str(self.type)
        return f"{self.type}({', '.join(str(child) for child in self.children)})"


def tree_of(structure: Structure, named: Mapping[str, float]) -> Node:
    """Tree of a structure that is not bred: all else originates from its first submodel."""
    root, *others = (
        Node(p, tuple((q.symbol, named[p.parameter(q.symbol)]) for q in p.effect.parameters)) for p in structure.placed
    )
    return replace(root, children=tuple(others))


def attach(tree: Node | None, index: int, branch: Node) -> Node:
    """Let `branch` originate from the node at `index`; it is the tree if there was none."""
    if tree is None:
        return branch
    if index == 0:
        return replace(tree, children=(*tree.children, branch))
    return _replace_in_child(tree, index, lambda child, at: (attach(child, at, branch),))


def drop(tree: Node, index: int) -> Node | None:
    """Remove the node at `index`; its children then originate from its parent.

    Where the root goes, its first child takes its place and the others originate from it.
    """
    if index == 0:
        if not tree.children:
            return None
        first, *others = tree.children
        return replace(first, children=(*first.children, *others))
    return _replace_in_child(
        tree, index, lambda child, at: child.children if at == 0 else (_not_empty(drop(child, at)),)
    )


def prune(tree: Node, index: int) -> Node | None:
    """Remove the node at `index` with the whole branch that originates from it."""
    if index == 0:
        return None
    return _replace_in_child(tree, index, lambda child, at: () if at == 0 else (_not_empty(prune(child, at)),))


def graft(tree: Node, index: int, children: Sequence[Node]) -> Node:
    """Replace all that originates from the node at `index` by `children`."""
    if index == 0:
        return replace(tree, children=tuple(children))
    return _replace_in_child(tree, index, lambda child, at: (graft(child, at, children),))


def relabel(tree: Node, index: int, type: Placed, values: NodeValues) -> Node:
    """Give the node at `index` another type; what originates from it stays."""
    if index == 0:
        return replace(tree, type=type, values=values)
    return _replace_in_child(tree, index, lambda child, at: (relabel(child, at, type, values),))


def with_values(tree: Node, named: Mapping[str, float]) -> Node:
    """Replace parameter values by those in `named` (by name in the structure), as after an identification."""
    own = tuple((symbol, float(named.get(tree.type.parameter(symbol), value))) for symbol, value in tree.values)
    return replace(tree, values=own, children=tuple(with_values(child, named) for child in tree.children))


def _replace_in_child(tree: Node, index: int, change: Callable[[Node, int], tuple[Node, ...]]) -> Node:
    """Replace the child that holds the node at `index` by what `change(child, index in child)` gives."""
    rest = index - 1
    for place, child in enumerate(tree.children):
        if rest < child.size:
            changed = (*tree.children[:place], *change(child, rest), *tree.children[place + 1 :])
            return replace(tree, children=changed)
        rest -= child.size
    raise IndexError(f"node {index} of a tree with {tree.size}")


def _not_empty(node: Node | None) -> Node:
    if node is None:
        raise AssertionError("only the root's removal can leave nothing")
    return node
