"""Operators one by one, and statistics of what they draw."""

from collections import Counter

import numpy as np
import pytest
from scipy import stats

from brightgrey.kit import PAPER, Placed
from brightgrey.search.genetic import GeneticSettings, Node
from brightgrey.search.genetic.crossover import recombine, recombine_at
from brightgrey.search.genetic.mutation import MUTATIONS, chromosome, delete, insert, point
from brightgrey.search.genetic.offspring import Offspring, mutated, offspring, remutate_duplicates, untried_neighbours
from brightgrey.search.genetic.population import complete_tree, initial_population, random_tree
from brightgrey.search.genetic.selection import clone_count, roulette

LEGAL = frozenset(PAPER.structures())
UNLIKELY = 1e-4  # probability of a false alarm of one test, over all seeds


def tree(text):
    """Tree from its text form, values of its own number."""
    name, bracket, rest = text.partition("(")
    children, depth, start = [], 0, 0
    inner = rest[:-1] if bracket else ""
    for i, c in enumerate(inner + ","):
        depth += (c == "(") - (c == ")")
        if c == "," and depth == 0 and inner:
            children.append(tree(inner[start:i].strip()))
            start = i + 1
    placed = Placed.parse(name)
    return Node(placed, tuple((q.symbol, 0.25) for q in placed.effect.parameters), tuple(children))


def fits(counts, probabilities):
    """Counts are a sample of these probabilities (chi-squared)."""
    counts, p = np.asarray(counts, float), np.asarray(probabilities, float)
    return stats.chisquare(counts, counts.sum() * p / p.sum()).pvalue > UNLIKELY


# --- selection ---------------------------------------------------------------------------------------------------


def test_selection_follows_fitness(rng):
    fitness = np.array([3.0, 0.5, 10.0, 1.0, 2.5, 0.1])
    counts = np.bincount([roulette(fitness, rng) for _ in range(20_000)], minlength=6)
    assert fits(counts, fitness)


def test_selection_does_not_depend_on_the_unit_of_fitness():
    for scale in (1e-300, 1.0, 1e300):
        rng = np.random.default_rng(3)
        assert [roulette(scale * np.array([1.0, 2.0, 3.0]), rng) for _ in range(20)] == [
            roulette([1.0, 2.0, 3.0], again) for again in [np.random.default_rng(3)] for _ in range(20)
        ]


def test_roulette__zero_fitness__never_selected(rng):
    assert {roulette([0.0, 1.0, 0.0, 2.0], rng) for _ in range(2000)} == {1, 3}


def test_roulette__all_failed__uniform(rng):
    counts = np.bincount([roulette(np.zeros(4), rng) for _ in range(8000)], minlength=4)
    assert fits(counts, np.ones(4))


def test_clone_counts_are_binomial(rng):
    counts = np.bincount([clone_count(6, 0.2, rng) for _ in range(20_000)], minlength=7)
    expected = stats.binom.pmf(np.arange(7), 6, 0.2)
    rare = 5
    assert fits([*counts[:rare], counts[rare:].sum()], [*expected[:rare], expected[rare:].sum()])


# --- initial population ------------------------------------------------------------------------------------------


def test_initial_trees_are_legal_and_of_all_sizes(rules, draw, rng):
    trees = initial_population(3000, rules, draw, rng)
    assert {t.structure for t in trees} <= LEGAL
    assert {t.size for t in trees} == set(range(1, rules.largest_size + 1))


def test_small_trees_are_as_likely_as_asked(rules, draw, rng):
    sizes = Counter(random_tree(rules, draw, rng).size for _ in range(8000))
    wanted = range(1, rules.largest_size - 1)  # the largest sizes end early beside a one-mass system
    assert fits([sizes[n] for n in wanted], np.ones(len(wanted)))


def test_origins_are_random(rules, draw, rng):
    trees = [t for t in initial_population(4000, rules, draw, rng) if t.size == 3]
    chains = sum(len(t.children) == 1 for t in trees)
    assert stats.binomtest(chains, len(trees), 0.5).pvalue > UNLIKELY


# --- recombination -----------------------------------------------------------------------------------------------


def test_recombination_keeps_the_trunk_and_takes_the_branch(rules, draw, rng):
    first = tree("two_mass(coulomb(viscous), delay)")
    branch = tree("stribeck(gravity)")
    assert str(recombine_at(first, 1, branch, rules, draw, rng)) == "two_mass(coulomb(stribeck(gravity)), delay)"


def test_recombine__illegal_node__dropped_children_stay(rules, draw, rng):
    first = tree("two_mass(coulomb)")
    branch = tree("coulomb(gravity, one_mass(delay))")
    assert str(recombine_at(first, 0, tree("one_mass(coulomb(gravity), delay)"), rules, draw, rng)) == (
        "two_mass(coulomb(gravity), delay)"
    )
    assert str(recombine_at(first, 1, branch, rules, draw, rng)) == "two_mass(coulomb(gravity, delay))"


def test_a_backlash_beside_one_mass_is_dropped(rules, draw, rng):
    joined = recombine_at(tree("one_mass(coulomb)"), 1, tree("backlash(viscous)"), rules, draw, rng)
    assert str(joined) == "one_mass(coulomb(viscous))"


def test_a_one_mass_system_is_appended_if_none_is_left(rules, draw, rng):
    joined = recombine_at(tree("coulomb(two_mass)"), 0, tree("viscous"), rules, draw, rng)
    assert str(joined.structure) == "one_mass+coulomb+viscous"


def test_recombine__backlash_left__more_masses_are_drawn(rules, draw, rng):
    drawn = Counter(complete_tree(tree("backlash(coulomb)"), rules, draw, rng).structure.masses for _ in range(3000))
    assert fits([drawn[2], drawn[3], drawn[4]], np.ones(3))
    assert drawn[1] == 0


def test_estimates_are_inherited(rules, draw, rng):
    first, second = tree("two_mass(coulomb)"), tree("one_mass(viscous)")
    second = Node(second.type, second.values, (Node(second.children[0].type, (("f_v", 0.75),)),))
    child = recombine_at(first, 1, second.children[0], rules, draw, rng)
    assert child.parameters["f_v"] == 0.75
    assert child.parameters["M_C"] == 0.25


# --- mutations ---------------------------------------------------------------------------------------------------


def test_point_mutation_changes_one_type_and_draws_its_values(rules, draw, rng):
    old = tree("two_mass(coulomb(viscous), delay)")
    seen = set()
    for _ in range(400):
        new = point(old, rules, draw, rng)
        changed = [i for i, (a, b) in enumerate(zip(old.types, new.types, strict=True)) if a != b]
        assert len(changed) == 1
        node = list(new.nodes())[changed[0]]
        assert [s for s, _ in node.values] == [q.symbol for q in node.type.effect.parameters]
        assert all(value != 0.25 for _, value in node.values)
        seen.add((changed[0], str(node.type)))
    assert {name for i, name in seen if i == 0} == {"one_mass", "three_mass", "four_mass"}
    assert {name for i, name in seen if i == 1} == {"stribeck", "gravity", "backlash", "current_control"}


def test_point_mutation_without_another_type(rules, draw, rng):
    full = tree("two_mass(coulomb, viscous, stribeck, gravity, backlash, current_control, delay)")
    kinds = {str(point(full, rules, draw, rng).structure).split("+")[0] for _ in range(200)}
    assert kinds == {"two_mass", "three_mass", "four_mass"}  # one_mass would leave the backlash without a shaft


def test_insertion_adds_one_node(rules, draw, rng):
    old = tree("one_mass(coulomb)")
    new = [insert(old, rules, draw, rng) for _ in range(300)]
    assert {n.size for n in new} == {3}
    assert {str(t) for n in new for t in n.types} - {"one_mass", "coulomb"} == {
        *("viscous", "stribeck", "gravity", "current_control", "delay"),
    }
    full = tree("two_mass(coulomb, viscous, stribeck, gravity, backlash, current_control, delay)")
    assert insert(full, rules, draw, rng) == full


def test_deletion_respects_the_rules(rules, draw, rng):
    old = tree("two_mass(coulomb(viscous))")
    results = Counter(str(delete(old, rules, draw, rng)) for _ in range(900))
    assert set(results) == {str(old), "two_mass(viscous)", "two_mass(coulomb)"}
    assert fits(list(results.values()), np.ones(3))
    assert delete(tree("one_mass"), rules, draw, rng) == tree("one_mass")


def test_chromosome_mutation_replaces_a_branch(rules, draw, rng):
    old = tree("two_mass(coulomb(viscous, stribeck), delay)")
    sizes = set()
    for _ in range(600):
        new = chromosome(old, rules, draw, rng)
        assert new.structure in LEGAL
        sizes.add(new.size)
    assert sizes == set(range(1, rules.largest_size + 1))


def test_chromosome__tree_without_branch__is_smallest_size(rules, draw):
    old = tree("two_mass(coulomb(viscous, stribeck), delay)")
    for seed in range(300):
        index = int(np.random.default_rng(seed).integers(old.size))
        left = old.size - list(old.nodes())[index].size
        assert chromosome(old, rules, draw, np.random.default_rng(seed)).size >= max(left, 1)


# --- together ----------------------------------------------------------------------------------------------------


def test_mutations_have_their_probabilities(rules, draw, rng):
    settings = GeneticSettings(mutations={"insertion": 0.3})
    old = tree("two_mass(coulomb)")
    count = sum(
        mutated(Offspring(old, (0,), "clone"), settings, rules, draw, rng).operator == "clone+insertion"
        for _ in range(3000)
    )
    assert stats.binomtest(count, 3000, 0.3).pvalue > UNLIKELY


def test_offspring__no_mutation__clones_and_recombinations(rules, draw, rng):
    settings = GeneticSettings(population=200, p_clone=0.5, mutations={})
    parents = initial_population(6, rules, draw, rng)
    born = offspring(parents, np.ones(6), settings, rules, draw, rng)
    assert len(born) == 200
    assert {b.operator for b in born} == {"clone", "recombination"}
    assert all(b.tree == parents[b.parents[0]] for b in born if b.operator == "clone")
    assert all(len(b.parents) == 2 for b in born if b.operator == "recombination")


def test_tried_structures_are_mutated_again(rules, draw, rng):
    settings = GeneticSettings(max_remutations=50)
    old = tree("two_mass(coulomb)")
    clones = [Offspring(old, (0,), "clone")] * 5
    new = remutate_duplicates(clones, {old.structure}.__contains__, settings, rules, draw, rng)
    structures = [b.tree.structure for b in new]
    assert len({*structures, old.structure}) == 6


def test_untried_neighbours__ranked_trees__one_node_away_best_first(rules, draw, rng):
    best = [tree("two_mass(coulomb)"), tree("four_mass(gravity)")]
    tried = {t.structure for t in best}
    settings = GeneticSettings(population=40, n_neighbours=40)
    born = untried_neighbours(best, tried.__contains__, settings, rules, draw, rng)
    assert {b.operator for b in born} == {"elite+point", "elite+insertion", "elite+deletion"}
    structures = [b.tree.structure for b in born]
    assert len({*structures, *tried}) == len(structures) + 2

    def steps(structure, start):
        apart = Counter(structure.placed) - Counter(start.placed), Counter(start.placed) - Counter(structure.placed)
        return max(part.total() for part in apart)

    nearest = [min((steps(s, b.structure), i) for i, b in enumerate(best)) for s in structures]
    assert all(distance == 1 for distance, _ in nearest)
    whose = [i for _, i in nearest]
    assert whose == sorted(whose)
    assert set(whose) == {0, 1}
    assert len(untried_neighbours(best, tried.__contains__, GeneticSettings(n_neighbours=3), rules, draw, rng)) == 3


def test_operators__many_operations__only_legal_trees_all_structures(rules, draw, rng):
    trees = list(initial_population(40, rules, draw, rng))
    seen = {t.structure for t in trees}
    names = tuple(MUTATIONS)
    for step in range(30_000):
        i, j = rng.integers(40, size=2)
        if step % 5 == 4:
            new = recombine(trees[i], trees[j], rules, draw, rng)
        else:
            new = MUTATIONS[names[step % 5]](trees[i], rules, draw, rng)
        structure = new.structure  # raises if a type stands there twice
        assert structure in LEGAL, str(new)
        seen.add(structure)
        trees[j] = new
    assert seen == LEGAL


@pytest.mark.parametrize("name", MUTATIONS)
def test_operators_are_repeatable(name, rules, draw):
    old = tree("two_mass(coulomb(viscous, stribeck), delay)")
    again = [MUTATIONS[name](old, rules, draw, np.random.default_rng(5)) for _ in range(2)]
    assert again[0] == again[1]
