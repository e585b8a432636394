"""Fits of a small set of structures on one recording by the reference solver, and optima that they have missed."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from brightgrey.estimation import scales
from brightgrey.estimation.noise.error_floor import TRUSTED_ACCURACY
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER, Placed
from brightgrey.search import IdentificationTask
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.missed_optima import _leaders, find_missed_optima
from brightgrey.search.fitting.structure_fit import Options, StructureFit, best_starts, refit_from_supermodel
from brightgrey.search.lattice import complexity, contains
from brightgrey.search.parallel import thread_pool
from brightgrey.search.task import FAST_LEVEL_ACCURACY
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference
from support.recordings import make_recording
from support.searches import fit_all

NAMES = (
    "one_mass",
    "one_mass+coulomb",
    "one_mass+viscous",
    "one_mass+coulomb+viscous",
    "one_mass+coulomb+viscous+delay",
    "two_mass",
    "two_mass+coulomb",
    "two_mass+viscous",
    "two_mass+coulomb+viscous",
    "two_mass+backlash",
    "two_mass+coulomb+backlash",
    "two_mass+coulomb+viscous+backlash",
)

TABLE = "brightgrey.search.fitting.fit_table"
STRUCTURES = [PAPER.parse(name) for name in NAMES]


def noisy_task(structure, true, noise):
    """Task of a drive in the paper's experiment, with white noise in parts of its peak speed."""
    e = PAPER_EXPERIMENT
    (v,) = reference(str(structure), true, e.torque(), e.dt, f_tanh=e.f_tanh)
    v += noise * np.abs(v).max() * np.random.default_rng(4).standard_normal(v.size)
    r = make_recording(e.torque(), v, dt=e.dt, names=("torque", "velocity"), name="noisy")
    known = scales([r])
    return IdentificationTask((r,), known, Settings(f_tanh=e.f_tanh, speed_scale=known.speed, level="fast"))


@pytest.fixture(scope="module")
def fitted(task):
    return fit_all(task, STRUCTURES, seed=3)


def test_fit_all__all_structures__simple_ones_first(fitted):
    assert set(fitted) == set(STRUCTURES)
    sizes = [s.masses + len(s.placed) for s in fitted]
    assert sizes == sorted(sizes)


def test_fit_all__supermodels__not_worse_than_submodels(fitted):
    for big, own in fitted.items():
        for small, other in fitted.items():
            if contains(big, small):
                assert own.cost <= 1.001 * other.cost


def test_fit_all__truth__is_found_with_its_values(task, fitted, true_values):
    truth = fitted[PAPER.parse("two_mass+coulomb")]
    exact = {name: np.array([value]) for name, value in true_values.items()}
    assert truth.cost <= 1.01 * task.problem(truth.structure).costs(exact, task.settings)[0]
    for name, value in true_values.items():
        assert truth.values[name] == pytest.approx(value, rel=0.1)


def test_fit_all__no_redundant_effect__values_give_cost(task, fitted):
    for s, f in fitted.items():
        if not f.redundant_effects:
            values = {name: np.array([f.values[name]]) for name in s.parameters}
            assert task.problem(s).costs(values, task.settings)[0] == pytest.approx(f.cost, rel=1e-6)


def test_fit_all__any_threads__same_fits(task, fitted):
    seen = []
    with ThreadPoolExecutor(3) as pool:
        again = fit_all(task, STRUCTURES, seed=3, executor=pool, progress=lambda f: seen.append(f.structure))
    assert {s: (f.cost, dict(f.values)) for s, f in again.items()} == {
        s: (f.cost, dict(f.values)) for s, f in fitted.items()
    }
    assert seen == list(again)


def test_fit_all__incomplete_set__no_structure_worse_than_submodel(task):
    some = [PAPER.parse(n) for n in ("one_mass", "two_mass+coulomb", "two_mass+coulomb+viscous+backlash")]
    done = fit_all(task, some)
    costs = [done[s].cost for s in some]
    assert costs == sorted(costs, reverse=True)


@pytest.mark.long
def test_fit_all__rattling_backlash__found_and_projected(loose):
    task, values = loose
    kept = {"two_mass", "coulomb", "viscous", "backlash", "delay"}
    structures = [s for s in PAPER.structures() if set(s.names) <= kept and s.masses == 2]
    sought = []
    fitted = fit_all(task, structures, seeking=sought.append)
    truth = fitted[PAPER.parse("two_mass+backlash+delay")]
    exact = {name: np.array([value]) for name, value in values.items()}
    assert truth.cost <= 1.01 * task.problem(truth.structure).costs(exact, task.settings)[0]
    assert not truth.redundant_effects
    assert [str(s) for s in sought] == ["two_mass+coulomb+viscous+backlash+delay"]


def test_fit_all__white_residual__no_restarts(task):
    sought = []
    fit_all(task, STRUCTURES, seed=3, seeking=sought.append)
    assert not sought


def test_restart_leaders__no_noise__ends_at_simulation_accuracy(exact_loose):
    """A fit beside the truth leaves what the search's level may be off by at worst, but is not off by here."""
    task, values = exact_loose
    top, plain = PAPER.parse("two_mass+backlash+delay"), PAPER.parse("two_mass+delay")
    problem = task.problem(top)
    rough, fine = (
        float(task.error_floor(problem.weights, share).sum()) for share in (FAST_LEVEL_ACCURACY, TRUSTED_ACCURACY)
    )
    sizes = np.geomspace(1e-6, 1e-2, 200)
    beside = {name: np.full(sizes.size, value) for name, value in values.items()}
    beside["alpha"] = values["alpha"] * (1.0 + sizes)
    costs = problem.costs(beside, task.settings)
    between = np.flatnonzero((costs > 2.0 * fine) & (costs < 0.9 * rough))
    assert between.size
    k = between[0]
    fits = FitTable(task, [plain, top])
    fits.done[plain] = StructureFit(plain, {}, 1e3 * rough, 5)
    fits.done[top] = StructureFit(top, {name: float(v[k]) for name, v in beside.items()}, float(costs[k]), 6)
    first, again = [], []
    with thread_pool(None) as workers:
        find_missed_optima(fits, workers, first.append)
        find_missed_optima(fits, workers, again.append)
    assert first == [top]
    assert fits.done[top].cost < 0.01 * fine
    assert not again


def spoilt(fits, structure, **changed):
    """Have `structure` end elsewhere, where its fit is bad; returns what it had."""
    before = fits.done[structure]
    problem, values = fits.task.problem(structure), {**before.values, **changed}
    cost = problem.costs({n: np.array([values[n]]) for n in structure.parameters}, fits.task.settings)[0]
    fits.done[structure] = replace(before, values=values, cost=float(cost), redundant_effects=())
    return before.cost


def test_restart_leaders__local_minimum__truth_is_found(task, true_values):
    """A resonance that is a little off is a local minimum, and all around begin there."""
    truth, simple = PAPER.parse("two_mass+coulomb"), PAPER.parse("one_mass+coulomb")
    fits, sought = FitTable(task, [simple, truth]), []
    with thread_pool(None) as workers:
        fits.add([simple, truth], workers)
        found = spoilt(fits, truth, c1=0.5 * true_values["c1"])
        assert fits.done[truth].cost > 2.0 * found
        find_missed_optima(fits, workers, sought.append)
    exact = {name: np.array([value]) for name, value in true_values.items()}
    assert truth in sought
    assert fits.done[truth].cost <= 1.01 * task.problem(truth).costs(exact, task.settings)[0]


def test_refit_from_supermodel__an_effect_that_it_lacks__begins_where_it_vanishes_or_just_matters(task):
    own = StructureFit(PAPER.parse("one_mass+coulomb"), {"J1": 1.0, "M_C": 1.0}, 1e300, 2)
    other = StructureFit(PAPER.parse("one_mass+viscous"), {"J1": 0.01, "f_v": 0.02}, 1.0, 2)
    space = task.space(own.structure, nuisances=True)
    found, _ = refit_from_supermodel(task, own, [other], Options(rounds=0), anyway=True)
    assert found is not None
    assert found.values["J1"] == pytest.approx(0.01)
    least = space.low[space.names.index("M_C")]
    (matters,) = Placed("coulomb").relevant_size(task.scales, other.values).values()
    assert found.values["M_C"] in (pytest.approx(least), pytest.approx(matters))


def test_continue_to_submodels__same_optimum__once(task, monkeypatch):
    costs = {"two_mass+backlash": 100.0, "two_mass+coulomb+backlash": 95.0, "two_mass+viscous+backlash": 60.0}
    small, little, better = map(PAPER.parse, costs)
    fits, followed = FitTable(task, [small, little, better]), []

    def in_vain(task, own, larger, options):
        followed.append((own.structure, larger.structure))
        return None, SimulationCount()

    monkeypatch.setattr(f"{TABLE}.continue_from_supermodel", in_vain)
    monkeypatch.setattr(f"{TABLE}.refit_from_supermodel", lambda *_: (None, SimulationCount()))
    fits.done.update(
        {s: StructureFit(s, {}, c, complexity(s)) for s, c in zip(fits.structures, costs.values(), strict=True)}
    )
    with thread_pool(None) as workers:
        for _ in range(2):
            assert not fits.continue_to_submodels(workers)
        fits.done[little] = replace(fits.done[little], cost=50.0)
        for _ in range(2):
            fits.continue_to_submodels(workers)
        fits.done[better] = replace(fits.done[better], cost=40.0)
        fits.continue_to_submodels(workers)
        fits.done[better] = replace(fits.done[better], cost=30.0)
        fits.continue_to_submodels(workers)
    assert followed == [(small, better), (small, little), (small, better), (small, better)]


def test_propagate__masses_joined__descends_from_a_bad_start_for_a_small_gain():
    """A third mass on a stiff shaft costs next to nothing less; both joined begin far above the optimum of two."""
    true = {"J1": 0.008, "J2": 0.012, "c1": 60.0, "d1": 0.02, "M_C": 0.9}
    small, big = PAPER.parse("two_mass+coulomb"), PAPER.parse("three_mass+coulomb")
    task = noisy_task(small, true, noise=1e-2)

    def ended(structure, cost=None, **values):
        named = {n: np.array([x]) for n, x in values.items()}
        reached = float(task.problem(structure).costs(named, task.settings)[0])
        return StructureFit(structure, values, cost or reached, len(values)), reached

    fits, (_, best) = FitTable(task, [small, big]), ended(small, **true)
    joined = {**true, "c1": 66.0}
    split = {"J1": 0.004, "J2": 0.004, "J3": 0.012, "c1": 4000.0, "c2": 66.0, "d1": 0.05, "d2": 0.02, "M_C": 0.9}
    assert ended(small, **joined)[1] > 1.2 * best
    fits.done[small] = ended(small, 1.05 * best, **{**true, "J2": 0.02})[0]
    fits.done[big] = ended(big, best, **split)[0]
    with thread_pool(None) as workers:
        fits.propagate({big}, workers)
    assert fits.done[small].cost <= 1.001 * best


def test_refit_from_supermodel__light_mass_with_the_fastest_resonance__is_not_joined():
    """Its shaft is not the rigid one: of the three ways to join four masses, the last costs least by far."""
    split = {"J1": 0.00521, "J2": 0.00033, "J3": 0.00624, "J4": 0.00485, "c1": 11.8, "c2": 18.6, "c3": 76.0}
    split |= {"d1": 0.0112, "d2": 0.0051, "d3": 0.344, "M_C": 1.6}
    joined = {name: split[name] for name in ("J1", "J2", "c1", "c2", "d1", "d2", "M_C")} | {"J3": 0.01109}
    small, big = PAPER.parse("three_mass+coulomb"), PAPER.parse("four_mass+coulomb")
    task = noisy_task(small, joined, noise=1e-3)
    least = float(task.problem(small).costs({n: np.array([x]) for n, x in joined.items()}, task.settings)[0])
    own, larger = (StructureFit(s, values, 1e9, len(values)) for s, values in ((small, joined), (big, split)))
    found, _ = refit_from_supermodel(task, own, [larger], Options(rounds=0), anyway=True)
    assert found.cost == pytest.approx(least)


def test_continue_to_submodels__improved__neighbours_refitted(task, monkeypatch):
    costs = {"two_mass+backlash": 100.0, "two_mass+coulomb+backlash": 60.0, "two_mass+gravity+backlash": 90.0}
    small, larger, other = map(PAPER.parse, costs)
    fits = FitTable(task, [small, larger, other])
    found, asked = StructureFit(small, {}, 70.0, complexity(small)), []

    def handed_on(task, structure, parents, *rest):
        asked.append((structure, [f.cost for f in parents]))
        return StructureFit(structure, {}, 65.0, complexity(structure))

    monkeypatch.setattr(f"{TABLE}.continue_from_supermodel", lambda *_: (found, SimulationCount()))
    monkeypatch.setattr(f"{TABLE}.refit_from_supermodel", lambda *_: (None, SimulationCount()))
    monkeypatch.setattr(f"{TABLE}.fit_from_neighbours", handed_on)
    fits.done.update(
        {s: StructureFit(s, {}, c, complexity(s)) for s, c in zip(fits.structures, costs.values(), strict=True)}
    )
    with thread_pool(None) as workers:
        assert fits.continue_to_submodels(workers) == {small, other}
    assert asked == [(other, [70.0])]
    assert fits.done[small] is found


def test_leading_structures__single_leader__its_submodels_follow(task):
    """Though it is far behind; what has fewer masses is another number's matter."""
    costs = {
        "two_mass": 3e8,
        "two_mass+backlash": 2e8,
        "two_mass+viscous+backlash": 1e8,
        "two_mass+coulomb+backlash": 4e8,
        "two_mass+coulomb+viscous+backlash": 1.0,
        "three_mass+coulomb+viscous+backlash": 5e8,
    }
    names = dict(zip(costs, map(PAPER.parse, costs), strict=True))
    fits = FitTable(task, list(names.values()))
    fits.done.update({s: StructureFit(s, {}, costs[name], complexity(s)) for name, s in names.items()})
    turns = [str(s) for place in range(4) for s in _leaders(fits, place, gaps=True)]
    big = "two_mass+coulomb+viscous+backlash"
    assert turns == [big, "two_mass+viscous+backlash", "two_mass+coulomb+backlash", big]


def test_propagate__lag_removed__dead_time_grows():
    """Lag and dead time show as their sum: without the lag the dead time has to be longer before anything is gained."""
    true = {"J1": 0.02, "M_C": 0.9, "T_d": 6e-3}
    small, big = PAPER.parse("one_mass+coulomb+delay"), PAPER.parse("one_mass+coulomb+current_control+delay")
    task = noisy_task(small, true, noise=3e-3)

    def ended(structure, **changed):
        values = {**true, **changed}
        cost = task.problem(structure).costs({n: np.array([x]) for n, x in values.items()}, task.settings)[0]
        return StructureFit(structure, values, float(cost), len(values))

    fits, begin = FitTable(task, [small, big]), ended(small, T_d=4e-3)
    fits.done[small] = replace(ended(small, J1=0.04), cost=0.9 * begin.cost)
    fits.done[big] = ended(big, T_d=4e-3, T_1=2e-3)
    assert fits.done[big].cost < 0.5 * begin.cost
    with thread_pool(None) as workers:
        fits.propagate({big}, workers)
    assert fits.done[small].cost <= 1.001 * ended(small).cost


def test_best_starts__early_termination__same_choice(task, rng):
    """The best start at each of some optima, of as many optima as asked for, as if all had been simulated through."""
    structure = PAPER.parse("two_mass+coulomb+viscous")
    problem, space = task.problem(structure), task.space(structure, nuisances=True)
    tried = [space.sample(count, rng) for count in (8, 1, 16)]
    costs = [problem.costs(space.named(begins), task.settings) for begins in tried]
    order = np.argsort([cost.min() for cost in costs])
    wanted = np.stack([tried[k][:, np.argmin(costs[k])] for k in order[:2]], axis=1)
    chosen, count = best_starts(task, problem, space, tried, 2)
    np.testing.assert_array_equal(chosen, wanted)
    assert count == 25


@pytest.mark.parametrize("worthwhile", [True, False])
@pytest.mark.parametrize("worse", ["two_mass", "two_mass+coulomb"])
def test_fit_table__should_refit_false__no_second_fit(task, worse, worthwhile):
    """A relative's optimum that is better, a larger one's or a smaller one's, is not worth another fit otherwise."""
    simple, worse, truth = map(PAPER.parse, ("one_mass", worse, "two_mass+coulomb"))
    asked = []

    def should_refit(structure, cost):
        asked.append((structure, cost))
        return worthwhile

    fits = FitTable(task, [simple, PAPER.parse("two_mass"), truth], should_refit=should_refit)
    with thread_pool(None) as executor:
        fits.add([PAPER.parse("two_mass"), truth], executor)
        fits.done[worse] = replace(fits.done[worse], cost=1e9)
        before = len(fits.log)
        fits.add([simple], executor)
    again = [f.structure for _, f in fits.log[before:] if f.structure == worse]
    assert len(again) == worthwhile
    assert {s for s, _ in asked} >= {worse}
    larger = [cost for s, cost in asked if s == worse and cost > 0.0]
    assert larger == [fits.done[truth].cost] * len(larger)  # what it would be handed
