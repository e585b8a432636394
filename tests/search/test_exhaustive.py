"""All structures of a small set on one recording by the reference solver."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from brightgrey.estimation import scales
from brightgrey.kit import PAPER
from brightgrey.recordings import Recording, Signal
from brightgrey.search import Identification
from brightgrey.search.exhaustive import fit_all
from brightgrey.search.lattice import contains
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference

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
STRUCTURES = [PAPER.parse(name) for name in NAMES]
TRUE = {"J1": 0.012, "J2": 0.008, "c1": 40.0, "d1": 0.05, "M_C": 0.5}


@pytest.fixture(scope="module")
def task():
    t = 0.001 * np.arange(600)
    torque = 4.0 * np.sign(np.sin(2.0 * np.pi * 4.0 * t)) * np.minimum(1.0, 20.0 * t)
    (v,) = reference("two_mass+coulomb", TRUE, torque, 0.001, f_tanh=4.0)
    v = v + 0.05 * np.random.default_rng(2).normal(size=t.size)
    recording = Recording("made", t, torque, v[None], Signal("u", "input", "N m"), (Signal("v", "velocity", "rad/s"),))
    known = scales(recording)
    return Identification((recording,), known, Settings(f_tanh=4.0, speed_scale=known.speed, level="fast"))


@pytest.fixture(scope="module")
def fitted(task):
    return fit_all(task, STRUCTURES, seed=3)


def test_every_structure_has_its_fit_simple_ones_first(fitted):
    assert set(fitted) == set(STRUCTURES)
    sizes = [s.masses + len(s.placed) for s in fitted]
    assert sizes == sorted(sizes)


def test_none_is_worse_than_one_that_it_contains(fitted):
    for big, own in fitted.items():
        for small, other in fitted.items():
            if contains(big, small):
                assert own.cost <= 1.001 * other.cost


def test_the_truth_is_found_with_its_values(task, fitted):
    truth = fitted[PAPER.parse("two_mass+coulomb")]
    exact = {name: np.array([value]) for name, value in TRUE.items()}
    assert truth.cost <= 1.01 * task.problem(truth.structure).costs(exact, task.settings)[0]
    for name, value in TRUE.items():
        assert truth.values[name] == pytest.approx(value, rel=0.1)


def test_values_are_those_of_the_cost_unless_an_effect_is_idle(task, fitted):
    for s, f in fitted.items():
        if not f.idle:
            values = {name: np.array([f.values[name]]) for name in s.parameters}
            assert task.problem(s).costs(values, task.settings)[0] == pytest.approx(f.cost, rel=1e-6)


def test_threads_change_nothing(task, fitted):
    seen = []
    with ThreadPoolExecutor(3) as pool:
        again = fit_all(task, STRUCTURES, seed=3, executor=pool, progress=lambda f: seen.append(f.structure))
    assert {s: (f.cost, dict(f.values)) for s, f in again.items()} == {
        s: (f.cost, dict(f.values)) for s, f in fitted.items()
    }
    assert seen == list(again)


def test_gaps_in_the_set_do_not_break_the_guarantee(task):
    some = [PAPER.parse(n) for n in ("one_mass", "two_mass+coulomb", "two_mass+coulomb+viscous+backlash")]
    done = fit_all(task, some)
    costs = [done[s].cost for s in some]
    assert costs == sorted(costs, reverse=True)
