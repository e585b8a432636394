"""One generation from the one before (paper section 3.2, figure 5 step 6)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from brightgrey.kit import Structure
from brightgrey.search.genetic.crossover import recombine
from brightgrey.search.genetic.mutation import MUTATIONS
from brightgrey.search.genetic.population import Draw, pick
from brightgrey.search.genetic.rules import Rules
from brightgrey.search.genetic.selection import clone_count, roulette
from brightgrey.search.genetic.settings import HEURISTICS, GeneticSettings
from brightgrey.search.genetic.tree import Node

__all__ = ["Offspring", "mutated", "offspring", "remutate_duplicates", "untried_neighbours"]

_ONE_NODE_MUTATIONS = ("point", "insertion", "deletion")  # mutations that change one node


@dataclass(frozen=True)
class Offspring:
    """An individual before its identification."""

    tree: Node
    parents: tuple[int, ...]  #: Numbers of the parents within the population before; none for the initial one.
    #: How it came about, such as ``recombination+insertion``. Only mutations that changed the tree are named.
    operator: str


def offspring(
    population: Sequence[Node],
    chances: ArrayLike,
    settings: GeneticSettings,
    rules: Rules,
    draw: Draw,
    rng: np.random.Generator,
) -> tuple[Offspring, ...]:
    """As many individuals as there are places left by the elite and what is near it: clones, recombinations; mutated.

    Parameters
    ----------
    population : sequence of Node
    chances : array_like, shape (individuals,)
        Weights of the roulette wheel.
    settings : GeneticSettings
    rules, draw, rng
    """
    size = settings.population - settings.elite - settings.neighbours
    cloned = clone_count(size, settings.p_clone, rng)
    born = []
    for number in range(size):
        first = roulette(chances, rng)
        if number < cloned:
            child = Offspring(population[first], (first,), "clone")
        else:
            second = roulette(chances, rng)
            tree = recombine(population[first], population[second], rules, draw, rng)
            child = Offspring(tree, (first, second), "recombination")
        born.append(mutated(child, settings, rules, draw, rng))
    return tuple(born)


def mutated(
    child: Offspring, settings: GeneticSettings, rules: Rules, draw: Draw, rng: np.random.Generator
) -> Offspring:
    """Perform each mutation with its probability."""
    tree, names = child.tree, [child.operator]
    for name, mutate in MUTATIONS.items():
        if rng.random() < settings.mutations.get(name, 0.0):
            changed = mutate(tree, rules, draw, rng)
            if changed != tree:
                names.append(name)
            tree = changed
    return Offspring(tree, child.parents, "+".join(names))


def remutate_duplicates(
    born: Sequence[Offspring],
    is_tried: Callable[[Structure], bool],
    settings: GeneticSettings,
    rules: Rules,
    draw: Draw,
    rng: np.random.Generator,
) -> tuple[Offspring, ...]:
    """Mutate individuals whose structure was tried or came before in `born`, at most `max_remutations` times."""
    known, out = set[Structure](), []
    for child in born:
        tree, names = child.tree, [child.operator]
        for _ in range(settings.max_remutations):
            if tree.structure not in known and not is_tried(tree.structure):
                break
            name = pick(tuple(MUTATIONS), rng)
            changed = MUTATIONS[name](tree, rules, draw, rng)
            if changed != tree:
                names.append(name)
            tree = changed
        known.add(tree.structure)
        out.append(Offspring(tree, child.parents, "+".join(names)))
    return tuple(out)


def untried_neighbours(
    best: Sequence[Node],
    is_tried: Callable[[Structure], bool],
    settings: GeneticSettings,
    rules: Rules,
    draw: Draw,
    rng: np.random.Generator,
) -> tuple[Offspring, ...]:
    """Individuals with one node changed whose structures have not been tried: of the first of `best` that has such."""
    known, out = set[Structure](), list[Offspring]()
    for tree in best:
        for _ in range(HEURISTICS.neighbour_draws):
            if len(out) == settings.neighbours:
                return tuple(out)
            name = pick(_ONE_NODE_MUTATIONS, rng)
            changed = MUTATIONS[name](tree, rules, draw, rng)
            if changed.structure not in known and not is_tried(changed.structure):
                known.add(changed.structure)
                out.append(Offspring(changed, (), f"elite+{name}"))
    return tuple(out)
