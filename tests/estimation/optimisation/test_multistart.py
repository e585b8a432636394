"""Starts that are plausible and unlike each other, and when a search may stop."""

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from scipy.signal import lfilter

from brightgrey.effects import Scales, registry
from brightgrey.estimation import scales
from brightgrey.estimation.optimisation.least_squares import SAME_OPTIMUM_RTOL, Optimum, fit_many
from brightgrey.estimation.optimisation.multistart import _agreeing, _Part, is_white, multistart
from brightgrey.estimation.optimisation.start_points import (
    best_diverse,
    perturbed_starts,
    resonance_scan,
    starts_at_residual_peaks,
)
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.kit import PAPER, assemble
from brightgrey.recordings import read_recording
from brightgrey.simulation import Settings

SCALES = Scales(8.0, 40.0, 600.0, 14.0, 1e-3, 1.8, 0.02, 1.1, 0.007, 0.1)


@pytest.fixture(scope="module")
def demo():
    path = files("brightgrey.excitation").joinpath("data/demo.csv")
    return read_recording(str(path), input="torque", outputs=["velocity:velocity"], time="t")


@pytest.mark.parametrize("name", [name for name, effect in registry().items() if effect.search.sample])
def test_what_an_effect_declares_plausible_lies_within_its_bounds(name):
    effect = registry()[name]
    share = np.random.default_rng(1).random((len(effect.parameters), 200))
    values = effect.search.sample(SCALES, share)
    assert values.shape == share.shape
    for parameter, row in zip(effect.parameters, values, strict=True):
        low, high = parameter.bounds(SCALES)
        assert np.mean((row >= low) & (row <= high)) >= 0.95, parameter.symbol  # the others are cut to the bounds


@pytest.mark.parametrize("name", [name for name, effect in registry().items() if effect.search.perturb])
def test_regrouping_keeps_the_total_inertia_and_all_positive(name):
    effect = registry()[name]
    rng = np.random.default_rng(1)
    share = rng.random((len(effect.parameters), 100))
    values = effect.search.sample(SCALES, share)
    other = effect.search.perturb(values, rng.random(share.shape), np.where(rng.random(100) < 0.5, 60.0, np.nan))
    inertias = [k for k, p in enumerate(effect.parameters) if p.symbol.startswith("J")]
    np.testing.assert_allclose(other[inertias].sum(axis=0), values[inertias].sum(axis=0), rtol=1e-9)
    assert np.all(other > 0.0)
    assert not np.any(np.all(other == values, axis=0))


def test_offspring_stay_within_bounds_and_near_their_parents(demo):
    search = parameter_space(PAPER.parse("three_mass+coulomb+delay"), scales(demo), {}, {})
    rng = np.random.default_rng(2)
    fresh = search.sample(64, rng)
    young = perturbed_starts(search, [search.start], fresh, rng)
    assert young.shape == fresh.shape
    assert np.all((young >= search.low[:, None] * (1 - 1e-12)) & (young <= search.high[:, None] * (1 + 1e-12)))
    kept = np.abs(search.to_scaled(young) - search.to_scaled(search.start)[:, None]) < 0.3 * 4
    assert np.median(kept.mean(axis=0)) >= 0.5


@pytest.mark.parametrize("name", [name for name, effect in registry().items() if effect.search.enumerate])
def test_ways_keep_the_total_inertia_and_are_all_unlike(name):
    effect = registry()[name]
    values = effect.search.sample(SCALES, np.linspace(0.3, 0.7, len(effect.parameters))[:, None])[:, 0]
    other = effect.search.enumerate(values, np.array([30.0, 60.0]))
    inertias = [k for k, p in enumerate(effect.parameters) if p.symbol.startswith("J")]
    assert other.shape[:2] == (len(effect.parameters), 2)
    np.testing.assert_allclose(other[inertias].sum(axis=0), values[inertias].sum(), rtol=1e-9)
    assert np.all(other > 0.0)
    flat = other.reshape(len(values), -1)
    assert len(np.unique(flat.round(12), axis=1).T) == flat.shape[1]


def test_retuned_starts_ring_where_the_residual_does(demo):
    structure = PAPER.parse("two_mass")
    search, turning = parameter_space(structure, scales(demo), {}, {}), 2 * np.pi * 20.0
    settings = Settings(f_tanh=2.5, speed_scale=40.0, level="fast")
    values = np.array([0.008, 0.012, 250.0, 0.1])
    problem = SimulationErrorProblem.of(structure, [demo])
    simulated = problem.residuals(search.named(values[:, None]), settings)[:, 0] / problem.weights[0] + demo.y[0]
    heard = replace(demo, y=(simulated + np.sin(turning * demo.t))[None])
    problem = SimulationErrorProblem.of(structure, [heard])
    found = starts_at_residual_peaks(problem, search, settings, values, 200, np.random.default_rng(3))
    np.testing.assert_allclose(found[:2].sum(axis=0), values[:2].sum(), rtol=1e-9)
    rings = [
        np.abs(np.linalg.eigvals(assemble(structure, dict(zip(search.names, v, strict=True)), 2.5).A)).max()
        for v in found.T
    ]
    resolution = 2 * np.pi / (demo.samples * demo.dt)
    assert np.mean(np.abs(np.array(rings) - turning) < 2 * resolution) >= 0.95
    assert len(np.unique(found[0])) == 200


def test_a_resonance_without_damping_is_met_from_a_model_that_has_none(demo):
    structure = PAPER.parse("two_mass+viscous")
    search, settings = (
        parameter_space(structure, scales(demo), {}, {}),
        Settings(f_tanh=2.5, speed_scale=40.0, level="fast"),
    )
    problem = SimulationErrorProblem.of(structure, [demo])
    true, stiff = np.array([0.019, 0.0009, 25.0, 1e-5, 0.01]), np.array([0.01, 0.0099, 2e5, 5.0, 0.01])
    made = problem.residuals(search.named(true[:, None]), settings)[:, 0] / problem.weights[0] + demo.y[0]
    heard = replace(demo, y=(made + 0.05 * np.random.default_rng(4).standard_normal(demo.samples))[None])
    problem = SimulationErrorProblem.of(structure, [heard])
    found, _ = resonance_scan(problem, search, settings, stiff, 24)
    assert found.shape[0] == 5
    assert 0 < found.shape[1] <= 24
    assert np.all((found >= search.low[:, None]) & (found <= search.high[:, None]))
    np.testing.assert_allclose(found[:2].sum(axis=0), stiff[:2].sum(), rtol=1e-9)
    wanted = np.sqrt(true[2] * (1 / true[0] + 1 / true[1]))
    rings = np.sqrt(found[2, 0] * (1 / found[0, 0] + 1 / found[1, 0]))
    assert abs(rings - wanted) < np.pi / (demo.samples * demo.dt)  # half a line
    end = fit_many(problem, search, settings, found[:, :1], limit=40)[0]
    assert end.cost <= 1.001 * problem.costs(search.named(true[:, None]), settings)[0]
    lone = fit_many(problem, search, settings, stiff[:, None], limit=40)[0]
    assert lone.cost > 1.5 * end.cost


def test_nothing_rings_where_nothing_can_change_roles(demo):
    structure = PAPER.parse("one_mass+viscous")
    search = parameter_space(structure, scales(demo), {}, {})
    problem, settings = (
        SimulationErrorProblem.of(structure, [demo]),
        Settings(f_tanh=2.5, speed_scale=40.0, level="fast"),
    )
    assert starts_at_residual_peaks(problem, search, settings, search.start, 10, np.random.default_rng(0)).shape == (
        2,
        0,
    )
    assert resonance_scan(problem, search, settings, search.start, 10)[0].shape == (2, 0)


def test_best_of_are_good_and_apart(demo):
    structure = PAPER.parse("one_mass+coulomb")
    search = parameter_space(structure, scales(demo), {}, {})
    problem, settings = (
        SimulationErrorProblem.of(structure, [demo]),
        Settings(f_tanh=2.5, speed_scale=40.0, level="fast"),
    )
    candidates = search.sample(64, np.random.default_rng(0))
    cost = problem.costs(search.named(candidates), settings)
    chosen = best_diverse(problem, search, settings, candidates, 4)
    np.testing.assert_array_equal(chosen[0], candidates[:, cost.argmin()])
    assert len({tuple(c) for c in chosen}) == 4


def test_white_residuals_are_told_from_coloured_ones(demo):
    problem = SimulationErrorProblem.of(PAPER.parse("one_mass"), [demo])
    rng = np.random.default_rng(5)
    white = sum(is_white(problem, rng.standard_normal(demo.samples)) for _ in range(200))
    assert white >= 195  # one in 500 is lost; eleven of 200 would be beyond chance
    signal = np.sin(2 * np.pi * 5 * demo.t)
    assert not is_white(problem, rng.standard_normal(demo.samples) + 0.4 * signal)  # 8 % more than the noise
    assert not is_white(problem, lfilter([1.0], [1.0, -0.3], rng.standard_normal(demo.samples)))


def test_a_beginning_holds_a_share_of_the_motion(demo):
    problem = SimulationErrorProblem.of(PAPER.parse("one_mass"), [demo])
    lengths = [problem.truncated(share).samples for share in (0.1, 0.3, 0.6, 1.0)]
    assert lengths == sorted(lengths)
    assert lengths[0] < 0.3 * demo.samples
    assert np.any(problem.truncated(0.3).recordings[0].u != 0.0)


@pytest.mark.parametrize("seed", range(4))
def test_a_white_residual_and_two_starts_that_agree_end_the_search_at_the_first_field(demo, seed):
    structure = PAPER.parse("two_mass+coulomb+viscous+stribeck")
    search = parameter_space(structure, scales(demo), {}, {})
    problem, settings = (
        SimulationErrorProblem.of(structure, [demo]),
        Settings(f_tanh=2.5, speed_scale=40.0, level="fast"),
    )
    found = multistart(problem, search, settings, [], starts=8, patience=4, seed=seed)
    costs = sorted(end.cost for end in found.ends[:8])
    agree = costs[1] <= (1.0 + SAME_OPTIMUM_RTOL) * costs[0]
    assert (len(found.ends) == 8) == agree


def test_only_independent_starts_bear_witness():
    ends = [Optimum(np.zeros(1), cost, True, 1, 5, np.eye(1)) for cost in (100.0, 100.2, 100.3, 120.0)]
    assert _agreeing([_Part([], ends, [True, True, False, True], 0, SimulationCount())]) == 2
    apart = [
        _Part([], [end], [alone], 0, SimulationCount())
        for end, alone in zip(ends, (False, False, False, True), strict=True)
    ]
    assert _agreeing(apart) == 0
