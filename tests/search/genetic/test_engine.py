"""The loop of figure 5: what it records, inherits, repeats and leaves behind."""

import dataclasses

import pytest

from brightgrey.errors import SettingsError
from brightgrey.kit import PAPER, Grammar
from brightgrey.search.genetic import GeneticSettings, genetic_search, history_csv
from brightgrey.search.genetic.settings import TUNED_SETTINGS
from support.genetic_runs import search_with

SMALL = GeneticSettings(generations=8)


def test_the_paper_is_the_default():
    s = GeneticSettings()
    assert (s.population, s.generations, s.iterations, s.k_p) == (6, 20, 500, 2.0)
    assert s.stall_polls == 12  # ours: the paper names no other end of a search
    assert (s.estimator, s.criterion, s.start_from) == ("pattern-search", "fitness", "inherited")
    assert (s.elite, s.max_remutations, s.n_neighbours) == (0, 0, 0)


def test_every_individual_of_every_generation_is_recorded(draw, estimate):
    run = search_with(estimate, draw, SMALL, seed=3)
    assert [(e.generation, e.individual) for e in run.evaluations] == [(g, i) for g in range(9) for i in range(6)]
    assert all(e.parents == () and e.operator == "initial" for e in run.generation(0))
    assert all(0 <= p < 6 for e in run.evaluations for p in e.parents)
    lines = history_csv(run).splitlines()
    assert len(lines) == 1 + 9 * 6


def test_estimates_are_the_starts_of_the_next_generation(draw, estimate):
    run = search_with(estimate, draw, dataclasses.replace(SMALL, mutations={}), seed=3)
    for e in run.evaluations:
        if e.operator != "clone":
            continue
        (parent,) = e.parents
        before = run.generation(e.generation - 1)[parent]
        assert e.job.start == before.result.values
        assert dict(e.result.values) == e.tree.parameters


def test_the_same_structure_and_start_is_identified_once(draw, estimate):
    asked = []

    def count(structure, starts):
        asked.extend((structure, start) for start in starts)
        # An estimate that is its start: clones then ask for the same again.
        return [dataclasses.replace(r, values=s) for r, s in zip(estimate(structure, starts), starts, strict=True)]

    run = search_with(count, draw, dataclasses.replace(SMALL, p_clone=0.8, mutations={}), seed=1)
    assert len(asked) == len(set(asked)) == run.identifications < len(run.evaluations)
    assert run.simulations == 10 * run.identifications
    assert sum(e.repeated for e in run.evaluations) == len(run.evaluations) - len(asked)


def test_a_standard_start_identifies_every_structure_once(draw, estimate):
    settings = dataclasses.replace(SMALL, start_from="standard")
    run = search_with(estimate, draw, settings, seed=1, default_start=lambda s: dict.fromkeys(s.parameters, 1.0))
    assert run.identifications == len({e.job.structure for e in run.evaluations})


def test_evolve__redundant_effects__not_in_elite(draw, estimate):
    """They are the same model with dead weight: a generation of their neighbours would be of no use."""

    def weighed(structure, starts):
        idle = tuple(str(p) for p in structure.beside if p.name == "gravity")
        return [dataclasses.replace(r, idle=idle) for r in estimate(structure, starts)]

    run = search_with(weighed, draw, dataclasses.replace(SMALL, elite=2, n_neighbours=2), seed=2)
    kept = [e for g in range(1, 9) for e in run.generation(g) if e.operator == "elite"]
    assert any(e.result.idle for e in run.evaluations)
    assert kept
    assert not any(e.result.idle for e in kept)


def test_evolve__elite__best_value_never_drops(draw, estimate):
    run = search_with(estimate, draw, dataclasses.replace(SMALL, elite=2), seed=4)
    values = [run.best_of(g).value for g in range(9)]
    assert values == sorted(values)
    assert [e.operator for e in run.generation(5)[:2]] == ["elite", "elite"]


def test_evolve__thirty_seeds__finds_truth_more_often_than_chance(draw, estimate):
    found = [str(search_with(estimate, draw, seed=s).best.job.structure) for s in range(30)]
    assert found.count("two_mass+coulomb+viscous+stribeck") >= 5  # 448 structures, 126 individuals: by chance 1 in 4


def test_structures_are_ranked_once(draw, estimate):
    ranked = list(search_with(estimate, draw, seed=2).structures())
    assert len({e.job.structure for e in ranked}) == len(ranked)
    assert [e.value for e in ranked] == sorted((e.value for e in ranked), reverse=True)


def test_an_interruption_leaves_the_best_so_far(draw, estimate):
    calls = []

    def stop(progress):
        calls.append(progress)
        if progress.generation == 3:
            raise KeyboardInterrupt

    run = search_with(estimate, draw, SMALL, seed=3, progress=stop)
    assert run.interrupted
    assert run.generations == 4
    assert run.best == calls[-1].best
    assert calls[0].seconds_left >= 0.0


def test_an_interruption_with_nothing_so_far(draw):
    def broken(structure, starts):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search_with(broken, draw, SMALL)


def test_evolve__all_diverged__has_offspring(draw, estimate):
    def lost(structure, starts):
        nothing = dataclasses.replace(estimate(structure, starts[:1])[0].misfit, rss=(float("inf"),))
        return [dataclasses.replace(r, misfit=nothing) for r in estimate(structure, starts)]

    run = search_with(lost, draw, SMALL, seed=1)
    assert len(run.evaluations) == 54
    assert run.best.value == 0.0


def test_same_seed_same_bytes_for_any_number_of_workers(draw, estimate):
    texts = {history_csv(search_with(estimate, draw, SMALL, seed=5, workers=n)) for n in (1, 2, 4)}
    assert len(texts) == 1
    assert history_csv(search_with(estimate, draw, SMALL, seed=6)) not in texts


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"population": 0}, "population is 0; at least 1"),
        ({"p_clone": 1.5}, "between 0 and 1"),
        ({"mutations": {"points": 0.1}}, "Did you mean 'point'"),
        ({"mutations": {"point": -0.1}}, "between 0 and 1"),
        ({"estimator": "least_squares"}, "Did you mean 'least-squares'"),
        ({"criterion": "aic"}, "unknown criterion"),
        ({"start_from": "random"}, "unknown start_from"),
        ({"elite": 7}, "more than the population"),
        ({"k_p": -1.0}, "k_p"),
    ],
)
def test_wrong_settings(change, message):
    with pytest.raises(SettingsError, match=message):
        GeneticSettings(**change)


def test_a_smaller_grammar(draw, estimate):
    small = dataclasses.replace(PAPER, name="small", places={"one_mass": (1,), "two_mass": (1,), "viscous": (1,)})
    run = search_with(estimate, draw, SMALL, grammar=small, seed=1)
    assert {str(e.job.structure) for e in run.evaluations} <= {
        *("one_mass", "two_mass", "one_mass+viscous", "two_mass+viscous"),
    }


def test_grammar_that_holds_effects_back__they_are_bred_from_the_start(task):
    """Multistarts are made among the others: all structures with these are too many to be listed."""
    places = dict.fromkeys(("one_mass", "two_mass", "coulomb", "viscous", "gravity"), (1,))
    larger = Grammar("larger", places, {"coulomb": (2,), "viscous": (2,)})
    brief = dataclasses.replace(TUNED_SETTINGS, population=4, generations=3)
    run = genetic_search(task, brief, 1, grammar=larger)
    assert any("@2" in str(e.job.structure) for e in run.evaluations)
    assert run.best.job.structure == PAPER.parse("two_mass+coulomb")
