"""What the best structure's identification is worth to those beside it."""

import dataclasses

import pytest

from brightgrey.errors import SettingsError
from brightgrey.kit import PAPER
from brightgrey.search import Evaluated, Misfit
from brightgrey.search.genetic import GeneticSettings, search
from brightgrey.search.genetic.leaders import reshaped
from brightgrey.search.genetic.population import initial
from brightgrey.search.lattice import simpler

TRUTH = "two_mass+coulomb+viscous"
LED = GeneticSettings(population=8, generations=6, begin="standard", criterion="bic", elite=1, fresh=2, lead=True)


def standard(structure):
    return dict.fromkeys(structure.parameters, 1.0)


def blind(structure, starts):
    """The truth is found from values near 2 only, and only what contains it with gravity gives these away."""
    truth, effects = PAPER.parse(TRUTH), {p.effect.name for p in structure.beside}
    out = []
    for start in starts:
        near = structure == truth and all(value == 2.0 for _, value in start)
        larger = {"coulomb", "viscous", "gravity"} <= effects and structure.masses >= 2
        rss = 1.0 if near or larger else 50.0
        values = tuple((name, 2.0 if larger else value) for name, value in start)
        out.append(Evaluated(values, Misfit((rss,), (1e-3,), 1000, (1e4,)), len(start), 10))
    return out


def test_trees_take_the_form_of_other_structures(rules, draw, rng):
    structures = list(PAPER.structures())
    for tree in initial(200, rules, draw, rng):
        wanted = structures[int(rng.integers(len(structures)))]
        named = {name: float(i) for i, name in enumerate(wanted.parameters)}
        other = reshaped(tree, wanted, named)
        assert other.structure == wanted
        assert other.parameters == named


def test_what_the_leader_does_not_need_is_seen_from_its_optimum(draw):
    for seed in range(5):
        alone = search(blind, draw, dataclasses.replace(LED, lead=False), standard=standard, seed=seed)
        led = search(blind, draw, LED, standard=standard, seed=seed)
        assert str(alone.best.job.structure) != TRUTH
        assert str(led.best.job.structure) == TRUTH
        assert led.best.operator == "leader+deletion"
        assert set(led.best.result.values) == {(name, 2.0) for name in PAPER.parse(TRUTH).parameters}


def test_leaders_are_followed_once(draw, estimate):
    settings = dataclasses.replace(LED, criterion="fitness")
    run = search(estimate, draw, settings, standard=standard, seed=3)
    assert "leader" in [e.operator for e in run.generation(0)[8:]]
    leaders = [e.job.structure for e in run.evaluations if e.operator == "leader"]
    assert len(leaders) == len(set(leaders))
    smaller = {e.job.structure for e in run.evaluations if e.operator == "leader+deletion"}
    assert set(simpler(leaders[-1], PAPER.structures())) <= smaller
    for g in range(run.generations):
        assert [e.individual for e in run.generation(g)] == list(range(len(run.generation(g))))


def test_every_structure_that_is_born_gets_the_standard_start_first(draw):
    run = search(blind, draw, LED, standard=standard, seed=1)
    seen = set()
    for e in run.evaluations:
        if not e.operator.startswith("leader"):
            begun = all(value == 1.0 for _, value in e.job.start)
            assert begun or e.job.structure in seen
            seen.add(e.job.structure)


def test_the_elite_is_the_best_identification_of_its_structure(draw):
    run = search(blind, draw, LED, standard=standard, seed=1)
    *_, e = (e for e in run.evaluations if e.operator == "elite")
    assert e.repeated
    assert e.value == run.best.value
    assert str(e.job.structure) == TRUTH


def test_only_a_standard_start_is_led():
    with pytest.raises(SettingsError, match="standard"):
        GeneticSettings(lead=True)
