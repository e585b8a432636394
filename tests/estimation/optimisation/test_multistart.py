"""Start points, and the end of a multistart search."""

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from scipy.signal import lfilter

from brightgrey.effects import Scales, registry
from brightgrey.estimation import scales
from brightgrey.estimation.noise.residual_analysis import is_white
from brightgrey.estimation.optimisation.least_squares import SAME_OPTIMUM_RTOL, Optimum, fit_many
from brightgrey.estimation.optimisation.multistart import DescentBatch, agreeing_starts, multistart
from brightgrey.estimation.optimisation.options import StartPointOptions
from brightgrey.estimation.optimisation.start_points import (
    best_diverse,
    perturbed_starts,
    resonance_scan,
    starts_at_residual_peaks,
    torque_rows,
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
def test_declared_samples__lie_within_the_bounds(name):
    effect = registry()[name]
    share = np.random.default_rng(1).random((len(effect.parameters), 200))
    values = effect.search.sample(SCALES, share)
    assert values.shape == share.shape
    for parameter, row in zip(effect.parameters, values, strict=True):
        low, high = parameter.bounds(SCALES)
        assert np.mean((row >= low) & (row <= high)) >= 0.95, parameter.symbol  # the others are cut to the bounds


@pytest.mark.parametrize("name", [name for name, effect in registry().items() if effect.search.perturb])
def test_declared_exchange__keeps_the_total_inertia__all_positive(name):
    effect = registry()[name]
    rng = np.random.default_rng(1)
    share = rng.random((len(effect.parameters), 100))
    values = effect.search.sample(SCALES, share)
    other = effect.search.perturb(values, rng.random(share.shape), np.where(rng.random(100) < 0.5, 60.0, np.nan))
    inertias = [k for k, p in enumerate(effect.parameters) if p.symbol.startswith("J")]
    np.testing.assert_allclose(other[inertias].sum(axis=0), values[inertias].sum(axis=0), rtol=1e-9)
    assert np.all(other > 0.0)
    assert not np.any(np.all(other == values, axis=0))


def test_perturbed_starts__within_bounds__near_their_parents(demo):
    space = parameter_space(PAPER.parse("three_mass+coulomb+delay"), scales(demo), {}, {})
    rng = np.random.default_rng(2)
    fresh = space.sample(64, rng)
    perturbed = perturbed_starts(space, [space.start], fresh, rng)
    assert perturbed.shape == fresh.shape
    assert np.all((perturbed >= space.low[:, None] * (1 - 1e-12)) & (perturbed <= space.high[:, None] * (1 + 1e-12)))
    kept = np.abs(space.to_scaled(perturbed) - space.to_scaled(space.start)[:, None]) < 0.3 * 4
    assert np.median(kept.mean(axis=0)) >= 0.5


def test_perturbed_starts__torques_at_the_masses__sampled_anew_together(demo):
    structure = PAPER.parse("two_mass+coulomb+gravity+backlash+delay")
    space = parameter_space(structure, scales(demo), {}, {})
    rows = torque_rows(structure, space)
    assert {space.names[i] for i in rows} == {"M_C", "M_G"}
    options = StartPointOptions(redrawn_torques=1.0, exchanged_share=0.0, shifts=(0.0,))
    fresh = space.sample(64, np.random.default_rng(2))
    perturbed = perturbed_starts(space, [space.start], fresh, np.random.default_rng(3), rows, options)
    np.testing.assert_allclose(perturbed[rows], fresh[rows], rtol=1e-12)
    others = [i for i in range(len(space.names)) if i not in rows]
    np.testing.assert_allclose(perturbed[others], np.repeat(space.start[others, None], 64, axis=1), rtol=1e-12)


def test_first_batch__given_starts_of_a_gap__copies_of_them_beside_samples(demo):
    """Descents on the whole recording seldom come back to an optimum with a gap from anywhere near it."""
    problem = SimulationErrorProblem.of(PAPER.parse("two_mass+backlash"), [demo])
    space = parameter_space(problem.structure, scales(demo), {}, {})
    settings = Settings(1.0, space.scales.speed)
    given = dict(zip(space.names, space.start.tolist(), strict=True))
    counts = [
        multistart(problem, space, settings, known, starts=2, patience=0, seed=1).starts.shape[1]
        for known in ([], [given])
    ]
    assert counts[1] == counts[0] + 1 + 2  # the given start on the whole recording, and two copies


def test_multistart__cost_that_no_start_gets_below__descents_are_given_up(demo):
    problem = SimulationErrorProblem.of(PAPER.parse("two_mass+viscous"), [demo])
    space = parameter_space(problem.structure, scales(demo), {}, {})
    settings = Settings(1.0, space.scales.speed, "fast")

    def found(cost):
        return multistart(problem, space, settings, None, starts=4, patience=0, seed=1, cost_to_beat=cost)

    whole = found(np.inf)
    best = min(end.cost for end in whole.optima)
    beaten, given_up = found(1.5 * best), found(0.1 * best)
    assert min(end.cost for end in beaten.optima) == pytest.approx(best, rel=SAME_OPTIMUM_RTOL)
    assert given_up.simulations.samples < whole.simulations.samples


@pytest.mark.parametrize("name", [name for name, effect in registry().items() if effect.search.enumerate])
def test_declared_ways__keep_the_total_inertia__all_different(name):
    effect = registry()[name]
    values = effect.search.sample(SCALES, np.linspace(0.3, 0.7, len(effect.parameters))[:, None])[:, 0]
    other = effect.search.enumerate(values, np.array([30.0, 60.0]))
    inertias = [k for k, p in enumerate(effect.parameters) if p.symbol.startswith("J")]
    assert other.shape[:2] == (len(effect.parameters), 2)
    np.testing.assert_allclose(other[inertias].sum(axis=0), values[inertias].sum(), rtol=1e-9)
    assert np.all(other > 0.0)
    flat = other.reshape(len(values), -1)
    assert len(np.unique(flat.round(12), axis=1).T) == flat.shape[1]


def test_starts_at_residual_peaks__have_the_resonance_of_the_residual(demo):
    structure = PAPER.parse("two_mass")
    space, omega = parameter_space(structure, scales(demo), {}, {}), 2 * np.pi * 20.0
    settings = Settings(f_tanh=2.5, speed_scale=40.0, level="fast")
    values = np.array([0.008, 0.012, 250.0, 0.1])
    problem = SimulationErrorProblem.of(structure, [demo])
    simulated = problem.residuals(space.named(values[:, None]), settings)[:, 0] / problem.weights[0] + demo.y[0]
    disturbed = replace(demo, y=(simulated + np.sin(omega * demo.t))[None])
    problem = SimulationErrorProblem.of(structure, [disturbed])
    found = starts_at_residual_peaks(problem, space, settings, values, 200, np.random.default_rng(3))
    np.testing.assert_allclose(found[:2].sum(axis=0), values[:2].sum(), rtol=1e-9)
    resonances = [
        np.abs(np.linalg.eigvals(assemble(structure, dict(zip(space.names, v, strict=True)), 2.5).A)).max()
        for v in found.T
    ]
    resolution = 2 * np.pi / (demo.samples * demo.dt)
    assert np.mean(np.abs(np.array(resonances) - omega) < 2 * resolution) >= 0.95
    assert len(np.unique(found[0])) == 200


def test_resonance_scan__undamped_resonance__is_found_from_a_stiff_model(demo):
    structure = PAPER.parse("two_mass+viscous")
    space, settings = (
        parameter_space(structure, scales(demo), {}, {}),
        Settings(f_tanh=2.5, speed_scale=40.0, level="fast"),
    )
    problem = SimulationErrorProblem.of(structure, [demo])
    true, stiff = np.array([0.019, 0.0009, 25.0, 1e-5, 0.01]), np.array([0.01, 0.0099, 2e5, 5.0, 0.01])
    made = problem.residuals(space.named(true[:, None]), settings)[:, 0] / problem.weights[0] + demo.y[0]
    disturbed = replace(demo, y=(made + 0.05 * np.random.default_rng(4).standard_normal(demo.samples))[None])
    problem = SimulationErrorProblem.of(structure, [disturbed])
    found, _ = resonance_scan(problem, space, settings, stiff, 24)
    assert found.shape[0] == 5
    assert 0 < found.shape[1] <= 24
    assert np.all((found >= space.low[:, None]) & (found <= space.high[:, None]))
    np.testing.assert_allclose(found[:2].sum(axis=0), stiff[:2].sum(), rtol=1e-9)
    wanted = np.sqrt(true[2] * (1 / true[0] + 1 / true[1]))
    resonances = np.sqrt(found[2, 0] * (1 / found[0, 0] + 1 / found[1, 0]))
    assert abs(resonances - wanted) < np.pi / (demo.samples * demo.dt)  # half a line
    end = fit_many(problem, space, settings, found[:, :1], limit=40)[0]
    assert end.cost <= 1.001 * problem.costs(space.named(true[:, None]), settings)[0]
    lone = fit_many(problem, space, settings, stiff[:, None], limit=40)[0]
    assert lone.cost > 1.5 * end.cost


def test_resonance_starts__no_parts_to_exchange__are_empty(demo):
    structure = PAPER.parse("one_mass+viscous")
    space = parameter_space(structure, scales(demo), {}, {})
    problem, settings = (
        SimulationErrorProblem.of(structure, [demo]),
        Settings(f_tanh=2.5, speed_scale=40.0, level="fast"),
    )
    assert starts_at_residual_peaks(problem, space, settings, space.start, 10, np.random.default_rng(0)).shape == (
        2,
        0,
    )
    assert resonance_scan(problem, space, settings, space.start, 10)[0].shape == (2, 0)


def test_best_diverse__are_good__and_apart(demo):
    structure = PAPER.parse("one_mass+coulomb")
    space = parameter_space(structure, scales(demo), {}, {})
    problem, settings = (
        SimulationErrorProblem.of(structure, [demo]),
        Settings(f_tanh=2.5, speed_scale=40.0, level="fast"),
    )
    candidates = space.sample(64, np.random.default_rng(0))
    cost = problem.costs(space.named(candidates), settings)
    chosen = best_diverse(problem, space, settings, candidates, 4)
    np.testing.assert_array_equal(chosen[0], candidates[:, cost.argmin()])
    assert len({tuple(c) for c in chosen}) == 4


def test_is_white__coloured_residuals__are_rejected(demo):
    lengths = SimulationErrorProblem.of(PAPER.parse("one_mass"), [demo]).segment_lengths
    rng = np.random.default_rng(5)
    white = sum(is_white(rng.standard_normal(demo.samples), lengths) for _ in range(200))
    assert white >= 195  # one in 500 is lost; eleven of 200 would be beyond chance
    signal = np.sin(2 * np.pi * 5 * demo.t)
    assert not is_white(rng.standard_normal(demo.samples) + 0.4 * signal, lengths)  # 8 % more than the noise
    assert not is_white(lfilter([1.0], [1.0, -0.3], rng.standard_normal(demo.samples)), lengths)


def test_truncated__share_of_the_excitation__is_kept(demo):
    problem = SimulationErrorProblem.of(PAPER.parse("one_mass"), [demo])
    lengths = [problem.truncated(share).samples for share in (0.1, 0.3, 0.6, 1.0)]
    assert lengths == sorted(lengths)
    assert lengths[0] < 0.3 * demo.samples
    assert np.any(problem.truncated(0.3).recordings[0].u != 0.0)


@pytest.mark.parametrize("seed", range(4))
def test_multistart__white_and_agreeing__ends_after_one_batch(demo, seed):
    structure = PAPER.parse("two_mass+coulomb+viscous+stribeck")
    space = parameter_space(structure, scales(demo), {}, {})
    problem, settings = (
        SimulationErrorProblem.of(structure, [demo]),
        Settings(f_tanh=2.5, speed_scale=40.0, level="fast"),
    )
    found = multistart(problem, space, settings, None, starts=8, patience=4, seed=seed)
    batch = 8 + 2  # two balance the torques
    costs = sorted(optimum.cost for optimum in found.optima[:batch])
    agree = costs[1] <= (1.0 + SAME_OPTIMUM_RTOL) * costs[0]
    assert (len(found.optima) == batch) == agree


def test_multistart__other_structure_leaves_less__white_residual_does_not_end_it(demo):
    structure = PAPER.parse("two_mass+coulomb+viscous+stribeck")
    space, problem = parameter_space(structure, scales(demo), {}, {}), SimulationErrorProblem.of(structure, [demo])
    settings = Settings(f_tanh=2.5, speed_scale=40.0, level="fast")
    ended = multistart(problem, space, settings, None, starts=8, patience=3, seed=0)
    least = min(optimum.cost for optimum in ended.optima)
    further = multistart(problem, space, settings, None, starts=8, patience=3, seed=0, enough=0.5 * least)
    assert len(further.optima) > len(ended.optima)
    assert min(optimum.cost for optimum in further.optima) <= least


def test_multistart__given_optimum__is_no_independent_start(demo):
    structure = PAPER.parse("one_mass+viscous")
    space, problem = parameter_space(structure, scales(demo), {}, {}), SimulationErrorProblem.of(structure, [demo])
    settings = Settings(f_tanh=2.5, speed_scale=40.0, level="fast")
    free = multistart(problem, space, settings, None, starts=1, patience=0, seed=0)
    assert free.agreeing == 1  # the declared start
    (optimum,) = free.optima
    given = multistart(problem, space, settings, [space.by_name(optimum.values)], starts=1, patience=0, seed=0)
    assert len(given.optima) == 1
    assert given.optima[0].cost == pytest.approx(optimum.cost, rel=1e-3)
    assert given.agreeing == 0
    drawn = multistart(problem, space, settings, [], starts=1, patience=0, seed=0)
    assert not np.array_equal(drawn.starts[:, 0], free.starts[:, 0])  # a sample, not the declared start


def test_agreeing_starts__dependent_starts__do_not_count():
    optima = [Optimum(np.zeros(1), cost, True, 1, 5, np.eye(1)) for cost in (100.0, 100.2, 100.3, 120.0)]
    assert agreeing_starts([DescentBatch([], optima, [True, True, False, True], 0, SimulationCount())]) == 2
    separate = [
        DescentBatch([], [optimum], [independent], 0, SimulationCount())
        for optimum, independent in zip(optima, (False, False, False, True), strict=True)
    ]
    assert agreeing_starts(separate) == 0
