"""FitTable in the order in which a genetic search asks for them, each begun where relatives have ended."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from brightgrey.errors import SettingsError
from brightgrey.estimation.optimisation.multistart import multistart
from brightgrey.estimation.problem import simulation_error as problem
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER, Grammar
from brightgrey.paper.experiment import reference_recording, task_of
from brightgrey.search import criterion
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.missed_optima import find_missed_optima
from brightgrey.search.fitting.structure_fit import Options, StructureFit
from brightgrey.search.genetic import GeneticSettings, genetic_search
from brightgrey.search.genetic.lattice_evaluator import LatticeEvaluator
from brightgrey.search.genetic.settings import TUNED_SETTINGS
from brightgrey.search.lattice import complexity, contains
from brightgrey.search.parallel import thread_pool
from brightgrey.simulation import response, squares

FEW = Grammar("few", {"one_mass": (1,), "two_mass": (1,), "coulomb": (1,), "viscous": (1,), "gravity": (1,)})
FEW_AT_FIRST = replace(FEW, held_back={"coulomb": (2,), "viscous": (2,)})
ALL = tuple(FEW.structures())
BRIEF = replace(TUNED_SETTINGS, population=4, generations=3)
LITTLE = Options(fresh=2, patience=0, rounds=8)  # where it matters what is fitted, not how well


def in_pieces(task, workers=1):
    fits = FitTable(task, ALL, seed=5)
    largest_first = sorted(ALL, key=lambda s: -len(s.placed))
    with ThreadPoolExecutor(workers) as executor:
        for i in range(0, len(ALL), 5):
            fits.add(largest_first[i : i + 5], executor)
        fits.restart(PAPER.parse("two_mass+coulomb"), executor)
    return fits


@pytest.fixture(scope="module")
def pieces(task):
    return in_pieces(task)


def test_fit_table__any_order__no_structure_worse_than_submodel(pieces, true_values):
    assert set(pieces.done) == set(ALL)
    for big, own in pieces.done.items():
        for small, other in pieces.done.items():
            if contains(big, small):
                assert own.cost <= other.cost
    truth = pieces.done[PAPER.parse("two_mass+coulomb")]
    assert {name: truth.values[name] for name in true_values} == pytest.approx(true_values, rel=0.1)


def test_fit_table__anchors__fitted_once_all_fits_logged(pieces):
    hubs = [f.structure for hub, f in pieces.log if hub]
    assert sorted(map(str, hubs)) == sorted({str(h) for h in pieces.anchors})
    assert len(pieces.log) >= len(ALL) + len(hubs) + 1  # the last one was sought from everywhere
    assert all(f.spent.sets > 0 for _, f in pieces.log)


def test_fit_table__known_structures__no_further_fit(pieces):
    before = len(pieces.log)
    with thread_pool(None) as executor:
        assert pieces.add(ALL, executor) == set()
        assert pieces.restart(PAPER.parse("two_mass+coulomb"), executor) == set()
    assert len(pieces.log) == before


def test_fit_table__any_workers__same_log(task, pieces):
    assert in_pieces(task, workers=3).log == pieces.log


def genetic(task, workers=1, seed=1):
    return genetic_search(task, BRIEF, seed, grammar=FEW, workers=workers)


@pytest.fixture(scope="module")
def bred(task):
    return genetic(task)


def test_genetic_search__from_neighbours__each_structure_once(task, bred):
    assert bred.best.job.structure == PAPER.parse("two_mass+coulomb")
    assert bred == genetic(task, workers=2)
    for e in bred.evaluations:
        (misfit,) = task.misfits(e.job.structure, {name: np.array([value]) for name, value in e.result.values})
        assert e.result.misfit.rss[0] <= misfit.rss[0] * (1.0 + 1e-9)  # idle effects count as left out
    improved = [e for e in bred.evaluations if e.individual >= BRIEF.population]
    assert all(e.operator == "neighbours" and not e.repeated for e in improved)
    again = [e for e in bred.evaluations if e.individual < BRIEF.population and not e.repeated]
    assert len(again) == len({e.job.structure for e in again})


def test_start_from_neighbours__pattern_search__refused():
    with pytest.raises(SettingsError, match="least-squares"):
        GeneticSettings(start_from="neighbours")


def test_share__coloured_residuals__fewer_independent_samples(task, bred):
    (white,) = task.recordings
    rng, noise = np.random.default_rng(4), np.zeros(white.samples)
    for k in range(1, white.samples):
        noise[k] = 0.9 * noise[k - 1] + 0.1 * rng.normal()
    slow = replace(task, recordings=(replace(white, y=white.y + noise),))
    shares = []
    for run in (bred, genetic(slow)):
        shares += {e.result.misfit.share for e in run.evaluations}
        assert len(shares) == (1 if run is bred else 2)  # all are judged alike
        best = run.best.result
        n, (rss,) = best.misfit.independent, best.misfit.rss
        expected = -0.5 * (n * np.log(rss / white.samples) + best.n_parameters * np.log(n))
        assert run.best.value == pytest.approx(expected)
    assert shares[0] > 0.8
    assert shares[1] < 0.3  # (1 - 0.81) / (1 + 0.81) = 0.1 for the slow part alone


def test_identify__fit_within_simulation_error__polished():
    truth = PAPER.parse("one_mass+coulomb+viscous")
    more = PAPER.parse(f"{truth}+gravity")
    exact = task_of(reference_recording(truth, {n: PAPER_EXPERIMENT.values[n] for n in truth.parameters}))
    with thread_pool(None) as executor:
        relatives = LatticeEvaluator(exact, [truth, more], executor, criterion("bic"))
        (own, _), (large, _) = relatives.identify([truth, more])
        again = relatives.result_of(truth)
    assert own.misfit.rss[0] < 1.1 * own.misfit.least[0]
    value = criterion("bic").value
    assert value(own.misfit, own.n_parameters) > value(large.misfit, large.n_parameters)
    (fast,) = exact.misfits(truth, {name: np.array([v]) for name, v in own.values})
    assert fast.rss[0] > 2.0 * own.misfit.rss[0]  # what the search would have gone by
    assert again == replace(own, spent=SimulationCount())  # made once
    assert own.spent.sets > relatives.fits.done[truth].spent.sets


@pytest.fixture
def given(monkeypatch):
    """What is given to the simulation: parameter sets and samples, call by call."""
    calls = []

    def counting(simulate):
        def counted(system, u, dt, x0, *others, **options):
            calls.append((x0.shape[1], x0.shape[1] * len(u)))
            return simulate(system, u, dt, x0, *others, **options)

        return counted

    for module, simulate in ((problem, response), (problem, squares)):
        monkeypatch.setattr(module, simulate.__name__, counting(simulate))
    return calls


def test_run_spent__genetic_search__equals_kernel_calls(task, given):
    run = genetic(task)
    assert run.spent == SimulationCount(*(sum(column) for column in zip(*given, strict=True)))
    assert run.passes == run.spent.samples / task.recordings[0].samples < run.simulations


def test_restart_leaders__after_genetic_fits__finds_backlash(briefly_loose):
    task, values = briefly_loose
    truth = PAPER.parse("two_mass+backlash+delay")
    kept = {"two_mass", "coulomb", "viscous", "backlash", "delay"}
    structures = [s for s in PAPER.structures() if set(s.names) <= kept and s.masses == 2]
    with thread_pool(None) as executor:
        relatives = LatticeEvaluator(task, structures, executor, criterion("bic"))
        relatives.identify(structures)
        before = relatives.fits.done[truth].cost
        spent = relatives.restart_leaders()
    exact = task.problem(truth).costs({name: np.array([v]) for name, v in values.items()}, task.settings)[0]
    assert relatives.fits.done[truth].cost <= 1.01 * exact < 0.5 * before
    assert truth in relatives.improved
    assert spent.sets > 0


def test_restart__structure_held_back_by_grammar__no_multistart(task, given):
    """What a grammar holds back is fitted from neighbours alone: a multistart of twenty effects takes minutes."""
    offered = [PAPER.parse("one_mass"), PAPER.parse("two_mass")]
    larger = PAPER.parse("two_mass+viscous")  # the drive has Coulomb friction, so that a search goes on
    with ThreadPoolExecutor(1) as executor:
        evaluator = LatticeEvaluator(task, offered, executor, criterion("bic"), options=LITTLE)
        evaluator.fits.add([*offered, larger], executor)
        counted = len(given)
        assert evaluator.restart(larger) == SimulationCount()
        assert len(given) == counted
        begun = len(evaluator.fits.log)
        find_missed_optima(evaluator.fits, executor)
    sought = {f.structure for _, f in evaluator.fits.log[begun:]}
    assert PAPER.parse("two_mass") in sought
    assert larger not in sought


def test_restart_leaders__largest_structure_not_bred__is_fitted(briefly_loose):
    task, values = briefly_loose
    grammar = Grammar("loose", dict.fromkeys(("two_mass", "viscous", "backlash", "delay"), (1,)))
    structures = list(grammar.structures())
    top = max(structures, key=complexity)
    with thread_pool(None) as executor:
        relatives = LatticeEvaluator(task, structures, executor, criterion("bic"))
        relatives.identify([s for s in structures if "backlash" not in s.names])
        relatives.restart_leaders()
        found = relatives.result_of(top)
    without = {**values, "f_v": 0.0}
    exact = task.problem(top).costs({name: np.array([without[name]]) for name in top.parameters}, task.settings)[0]
    assert relatives.fits.done[top].cost <= 1.01 * exact
    assert top in relatives.improved
    assert dict(found.values).keys() == set(top.parameters)


@pytest.mark.long
def test_restart_leaders__larger_structures_not_fitted__ends(briefly_loose):
    """What is found with two masses is offered to those that are there, not to what comes after it."""
    task, _ = briefly_loose
    names = ("one_mass", "two_mass", "two_mass+backlash", "three_mass", "three_mass+backlash")
    structures = list(map(PAPER.parse, names))
    with thread_pool(None) as executor:
        fits = FitTable(task, structures, options=LITTLE)
        fits.add(structures[:2], executor)
        find_missed_optima(fits, executor)
    assert structures[2] in fits.done


@pytest.mark.long
def test_restart_leaders__hard_limit__compared_with_largest_without(briefly_loose):
    """Beside a bare mass whatever was bred with a gap tells something, and is sought for nothing."""
    task, _ = briefly_loose
    names = ("one_mass", "two_mass", "two_mass+backlash", "two_mass+viscous", "two_mass+viscous+backlash")
    structures = list(map(PAPER.parse, names))
    with thread_pool(None) as executor:
        fits = FitTable(task, structures, options=LITTLE)
        fits.add(structures[:2], executor)
        find_missed_optima(fits, executor)
    assert structures[3] in fits.done


@pytest.mark.parametrize(
    ("generations", "narrow", "after"),
    [(0, False, {0}), (2, False, {1, 2}), (3, False, {1, 3}), (8, False, {1, 2, 8}), (8, True, {8})],
)
def test_restart_leaders__generations__early_and_last(task, true_values, monkeypatch, generations, narrow, after):
    """Within narrow ranges in the end only."""
    seen, sought = [], set()
    monkeypatch.setattr(LatticeEvaluator, "restart_leaders", lambda self: sought.add(len(seen)) or SimulationCount())
    settings = replace(TUNED_SETTINGS, population=2, generations=generations, n_neighbours=1, max_remutations=1)
    if narrow:
        values = dict.fromkeys(("f_v", "M_G"), 0.1) | true_values
        task = replace(task, bounds={name: (0.5 * v, 2.0 * v) for name, v in values.items()})
    genetic_search(task, settings, 1, grammar=FEW, progress=seen.append)
    assert sought == after


def test_restart_leaders__effects_held_back__in_the_end_only(task, monkeypatch):
    seen, sought = [], set()
    monkeypatch.setattr(LatticeEvaluator, "restart_leaders", lambda self: sought.add(len(seen)) or SimulationCount())
    settings = replace(TUNED_SETTINGS, population=4, generations=8, n_neighbours=2)
    run = genetic_search(task, settings, 1, grammar=FEW_AT_FIRST, progress=seen.append)
    assert any("coulomb@2" in str(e.job.structure) for e in run.evaluations)
    assert sought == {8}


def test_genetic_search__structure_not_bred__has_tree(briefly_loose):
    task, _ = briefly_loose
    grammar = Grammar("loose", dict.fromkeys(("two_mass", "viscous", "backlash", "delay"), (1,)))
    settings = replace(TUNED_SETTINGS, population=2, generations=0)
    for seed in range(8):
        run = genetic_search(task, settings, seed, grammar=grammar)
        bred = {e.job.structure for e in run.evaluations if e.operator != "neighbours"}
        beside = [e for e in run.evaluations if e.job.structure not in bred]
        assert all(e.tree.parameters == dict(e.result.values) for e in beside)
        assert all(e.tree.structure == e.job.structure for e in run.evaluations)
        if beside:
            return
    pytest.fail("the largest structure was bred from every seed")


def lost_of(relatives):
    return {s for s in ALL if relatives.has_lost(s)}


@pytest.fixture
def sought(task, monkeypatch):
    """Relatives of fits by hand, after missed optima have been sought in vain."""
    monkeypatch.setattr("brightgrey.search.genetic.lattice_evaluator.find_missed_optima", lambda fits, workers: None)

    def made(costs, task=task, name="bic"):
        with thread_pool(None) as executor:
            relatives = LatticeEvaluator(task, ALL, executor, criterion(name))
            relatives.fits.done |= {s: StructureFit(s, {}, cost, len(s.parameters)) for s, cost in costs.items()}
            assert lost_of(relatives) == set()  # missed optima have not been looked for yet
            relatives.restart_leaders()
        return relatives

    return made


PLAIN, FRICTION, TRUTH, MORE, TOP = map(
    PAPER.parse,
    (
        "one_mass",
        "one_mass+coulomb",
        "two_mass+coulomb",
        "two_mass+coulomb+viscous",
        "two_mass+coulomb+viscous+gravity",
    ),
)


@pytest.mark.parametrize("name", ["bic", "fitness"])
def test_can_still_win__criterion_cannot_be_reached__false(sought, name):
    """By the criterion, if it left no less than the best fit that contains it, or than what it is offered."""
    relatives = sought({TOP: 99.8, TRUTH: 100.0, PLAIN: 1e4}, name=name)
    lost = lost_of(relatives)
    assert MORE in lost
    assert not {PLAIN, FRICTION, TRUTH} & lost
    assert all(len(s.parameters) > len(TRUTH.parameters) for s in lost)
    assert relatives.can_still_win(FRICTION, 100.0)
    assert not relatives.can_still_win(FRICTION, 1e6)


def test_has_lost__no_containing_fit__none(sought):
    """Nobody knows what it leaves, and growing is how it is found."""
    relatives = sought({PLAIN: 1e4, FRICTION: 9e3})
    assert lost_of(relatives) == set()
    assert lost_of(sought({})) == set()


@pytest.mark.parametrize("given", [{"bounds": {"f_v": (0.1, 1.0)}}, {"fixed": {"f_v": 0.1}}])
def test_has_lost__bounds_or_fixed_values__none(sought, task, given):
    """A structure that contains another may leave more then, as in the paper's experiment."""
    assert lost_of(sought({TOP: 99.8, TRUTH: 100.0}, task=replace(task, **given))) == set()


def test_has_lost__several_outputs__none(sought, task):
    """The criterion weighs them against each other, and the sum of both says little."""
    (r,) = task.recordings
    twice = replace(r, y=np.vstack([r.y, r.y]), outputs=(r.outputs[0], replace(r.outputs[0], name="again")))
    assert lost_of(sought({TOP: 99.8, TRUTH: 100.0}, task=replace(task, recordings=(twice,)))) == set()


def test_can_still_win__gain_below_resolution__smaller_structure_wins(sought, task):
    """Below what rounding leaves a fit is no better: the smaller one wins, and may win."""
    (r,) = task.recordings
    coarse = replace(task, recordings=(replace(r, resolution=np.array([float(r.y.std())])),))
    floor = r.samples * float(coarse.problem(TRUTH).weights[0] * r.y.std()) ** 2 / 12.0
    relatives = sought({TOP: 0.9 * floor, FRICTION: floor}, task=coarse)
    assert relatives.can_still_win(FRICTION, floor)
    assert TRUTH in lost_of(relatives)


def test_identify__new_structures__optima_continued_to_submodels(task, monkeypatch):
    structures = [PAPER.parse(f"{name}+backlash") for name in ("two_mass", "two_mass+coulomb", "two_mass+viscous")]
    asked = []
    with thread_pool(None) as executor:
        relatives = LatticeEvaluator(task, structures, executor, criterion("bic"))
        fits = relatives.fits
        monkeypatch.setattr(
            fits, "continue_to_submodels", lambda workers: asked.append(tuple(fits.done)) or {structures[0]}
        )
        relatives.identify(structures[:1])
        assert relatives.improved == ()  # they are of this generation
        relatives.identify(structures[:2])
        assert relatives.improved == ()
        relatives.identify(structures[1:])
        assert relatives.improved == (structures[0],)
        relatives.identify(structures)
    assert list(map(len, asked)) == [1, 2, 3]


def test_multistart__hard_limit__simulations_counted(given):
    truth = PAPER.parse("two_mass+coulomb+backlash")
    values = {**PAPER_EXPERIMENT.values, "alpha": 0.02}
    gap = task_of(reference_recording(truth, {name: values[name] for name in truth.parameters}))
    space, whole = gap.space(truth, nuisances=True), gap.problem(truth)
    found = multistart(whole, space, gap.settings, None, starts=3, patience=1, seed=0)
    assert found.simulations.samples == sum(samples for _, samples in given)


def test_multistart__resonance_scan__simulations_counted(task, given):
    simple = PAPER.parse("two_mass+viscous")  # leaves a coloured residual
    problem, space = task.problem(simple), task.space(simple, nuisances=True)
    found = multistart(problem, space, task.settings, None, starts=3, patience=2, seed=0)
    assert max(sets for sets, _ in given) > 500
    assert found.simulations == SimulationCount(*(sum(column) for column in zip(*given, strict=True)))
