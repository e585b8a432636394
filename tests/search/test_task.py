"""Identification within a search, on a small recording by the reference solver."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from brightgrey.errors import SettingsError
from brightgrey.estimation import scales
from brightgrey.estimation.optimisation.least_squares import polish
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER, Placed
from brightgrey.numerics.proportions import wilson_interval
from brightgrey.paper.assumed import ASSUMED
from brightgrey.paper.experiment import assumed_bounds, first_appearance, recovery_verdict, reference_recording, task_of
from brightgrey.paper.repetitions import RunSummary, summarise_run, summary
from brightgrey.search import IdentificationTask
from brightgrey.search.genetic import GeneticSettings, LeastSquares, PatternSearch, genetic_search, history_csv
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference
from support.genetic_runs import search_with
from support.recordings import make_recording

TRUTH = {"J1": 0.02, "M_C": 0.4, "f_v": 0.05}
STRUCTURE = "one_mass+coulomb+viscous"
SHORT = GeneticSettings(population=4, generations=2, iterations=6)


def small_task(**more):
    t = 0.002 * np.arange(250)
    torque = 2.0 * np.sign(np.sin(2 * np.pi * 4.0 * t)) * np.minimum(1.0, 5 * t)
    (speed,) = reference(STRUCTURE, TRUTH, torque, 0.002, f_tanh=4.0)
    speed = np.round(speed + 0.005 * np.random.default_rng(1).normal(size=t.size), 3)
    recording = make_recording(torque, speed, dt=0.002, name="small")
    known = scales(recording)
    settings = Settings(f_tanh=4.0, speed_scale=known.speed, level="fast")
    return IdentificationTask((recording,), known, settings, **more)


@pytest.fixture(scope="module")
def task():
    return small_task()


def start_of(task, seed):
    rng = np.random.default_rng(seed)
    s = PAPER.parse(STRUCTURE)
    return tuple((p.parameter(q), v) for p in s.placed for q, v in task.draw(p, rng))


@pytest.mark.parametrize(("kind", "iterations"), [(LeastSquares, 50), (PatternSearch, 500)])
def test_both_estimators_find_the_drive(task, kind, iterations):
    structure = PAPER.parse(STRUCTURE)
    starts = [tuple(task.default_start(structure).items()), start_of(task, 3)]
    best = min(kind(task, iterations)(structure, starts), key=lambda r: r.misfit.rss)
    for name, value in best.values:
        assert value == pytest.approx(TRUTH[name], rel=0.05)
    assert best.misfit.rss[0] == pytest.approx(250 * 0.005**2, rel=0.3)
    assert best.misfit.least == (pytest.approx(250 * 0.001**2 / 12),)
    assert best.n_parameters == 3
    assert best.simulations > 10


@pytest.mark.parametrize("kind", [LeastSquares, PatternSearch])
def test_estimators__several_starts__independent_results(task, kind):
    structure = PAPER.parse(STRUCTURE)
    starts = [start_of(task, seed) for seed in range(3)]
    estimate = kind(task, 5)
    assert list(estimate(structure, starts)) == [estimate(structure, [s])[0] for s in starts]


def test_random_values_are_within_their_ranges(task):
    rng = np.random.default_rng(0)
    structure = PAPER.parse("four_mass+coulomb+viscous+stribeck+gravity+backlash+current_control+delay")
    space = task.space(structure)
    for _ in range(50):
        drawn = {p.parameter(q): v for p in structure.placed for q, v in task.draw(p, rng)}
        for name, low, high in zip(space.names, space.low, space.high, strict=True):
            assert low <= drawn[name] <= high


def test_fixed_parameters_stay(task):
    held = small_task(fixed={"M_C": 0.3}, bounds={"f_v": (0.01, 0.2)})
    structure = PAPER.parse(STRUCTURE)
    (result,) = LeastSquares(held)(structure, [start_of(held, 1)])
    assert dict(result.values)["M_C"] == 0.3
    assert result.n_parameters == 2
    assert dict(held.draw(Placed("coulomb"), np.random.default_rng(0))) == {"M_C": 0.3}


def test_bounds_of_unknown_parameters():
    with pytest.raises(SettingsError, match="unknown parameter 'J9'"):
        small_task(bounds={"J9": (0.1, 1.0)}).check(PAPER)


PROGRAM = """
import sys
sys.path[:0] = {folders!r}
from test_task import SHORT, small_task
from brightgrey.search.genetic import genetic_search, history_csv
sys.stdout.write(history_csv(genetic_search(small_task(), SHORT, 11, workers=2)))
"""


def test_genetic_search__workers_and_processes__same_bytes(task):
    texts = {history_csv(genetic_search(task, SHORT, 11, workers=n)) for n in (1, 2, 4)}
    program = PROGRAM.format(folders=[str(folder) for folder in Path(__file__).parents[:2]])
    other = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    texts.add(other.stdout)
    assert len(texts) == 1


def test_bounds_of_the_papers_experiment(task):
    bounds = assumed_bounds(task.recordings[0])
    known = {name for s in PAPER.structures() for name in s.parameters}
    assert bounds.keys() == known == ASSUMED.keys()
    assert bounds["c1"] == (0.5 * ASSUMED["c1"], 2.0 * ASSUMED["c1"])
    assert bounds["M_G"] == (-2.0 * ASSUMED["M_G"], 2.0 * ASSUMED["M_G"])
    for name, value in PAPER_EXPERIMENT.values.items():
        assert bounds[name][0] < value < bounds[name][1]


@pytest.mark.parametrize(
    ("found", "wanted"),
    [
        ("two_mass+coulomb+viscous+stribeck", "true"),
        ("two_mass+coulomb+viscous+stribeck+gravity", "true with extras"),
        ("three_mass+coulomb+viscous+stribeck", "true with extras"),
        ("one_mass+coulomb+viscous+stribeck", "other"),
        ("two_mass+coulomb+viscous+gravity", "other"),
    ],
)
def test_recovery_verdict__found_structure__true_extras_or_other(found, wanted):
    assert recovery_verdict(PAPER.parse(found), PAPER.parse("two_mass+coulomb+viscous+stribeck")) == wanted


def test_wilson_interval():
    assert wilson_interval(95, 100) == (pytest.approx(0.8882, abs=1e-4), pytest.approx(0.9785, abs=1e-4))
    assert wilson_interval(0, 10)[0] == 0.0


def test_repetition_and_summary(draw, estimate):
    truth = PAPER.parse("two_mass+coulomb+viscous+stribeck")
    runs = [search_with(estimate, draw, seed=s) for s in range(12)]
    rows = [summarise_run(r, truth, s) for s, r in enumerate(runs)]
    assert [r.first for r in rows] == [first_appearance(r, truth) for r in runs]
    assert all(len(r.generations.split()) == 21 for r in rows)
    s = summary(rows)
    assert s.true == sum(r.best == str(truth) for r in rows)
    assert s.seen >= s.true
    assert isinstance(rows[0], RunSummary)


@pytest.mark.parametrize("truth", ["three_mass+coulomb+viscous", "four_mass+coulomb+viscous+stribeck"])
def test_polish__bad_step_along_bounds__converges(truth):
    """From the standard start many parameters run to bounds, where the least damped step promises nothing."""
    beyond = {"J3": 0.005, "J4": 0.003, "c2": 180.0, "c3": 160.0, "d2": 0.06, "d3": 0.04}
    structure, known = PAPER.parse(truth), {**PAPER_EXPERIMENT.values, **beyond}
    exact = task_of(reference_recording(structure, {name: known[name] for name in structure.parameters}))
    problem, space = exact.problem(structure), exact.space(structure)
    end = polish(problem, space, exact.settings, space.start, limit=200, tolerance=1e-4)
    (misfit,) = exact.misfits(structure, {n: np.array([v]) for n, v in zip(space.names, end.values, strict=True)})
    assert end.converged
    assert misfit.rss[0] < 1.1 * misfit.least[0]  # the floor is what rounding leaves
