"""Ensembles that learn along the recording."""

from dataclasses import replace

import numpy as np
import pytest

from brightgrey.estimation import descend_many, scales
from brightgrey.estimation.assimilate import assimilated
from brightgrey.estimation.bounds import search_space
from brightgrey.estimation.explore import _agreeing, _Part
from brightgrey.estimation.leastsquares import End
from brightgrey.estimation.problem import Problem
from brightgrey.estimation.spent import Spent
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER
from brightgrey.recordings import Recording, Signal
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference

STRUCTURE = PAPER.parse("two_mass+viscous+backlash+delay")
TRUE = {"J1": 0.004, "J2": 0.016, "c1": 300.0, "d1": 0.04, "f_v": 0.03, "alpha": 0.05, "T_d": 0.003}
SETTINGS = Settings(f_tanh=E.f_tanh, speed_scale=E.speed, level="fast")


@pytest.fixture(scope="module")
def drive():
    """A light motor that rattles against a heavy load."""
    u = E.torque()
    (v,) = reference(STRUCTURE, TRUE, u, E.dt, f_tanh=E.f_tanh)
    y = v + 0.005 * np.abs(v).max() * np.random.default_rng(1).standard_normal(v.size)
    outputs = (Signal("v", "velocity", "rad/s"),)
    return Recording("made", E.dt * np.arange(v.size), u, y[None], Signal("u", "input", "N m"), outputs)


def learned(recording, parents, seed=0, structure=STRUCTURE):
    problem = Problem.of(structure, [recording])
    search = search_space(structure, scales(recording), {}, {}, problem.unknown)
    ensemble, _ = assimilated(
        problem, search, SETTINGS, [p[: len(search.names)] for p in parents], np.random.default_rng(seed)
    )
    return problem, search, ensemble


def test_an_ensemble_learns_a_rattling_drive_where_descents_are_lost(drive):
    true = np.array(list(TRUE.values()))
    factors = np.exp(0.25 * np.random.default_rng(3).standard_normal((8, len(true))))
    factors[:, -1] = 1.0
    parents = list(true * factors)
    problem, search, ensemble = learned(drive, parents)
    least = problem.costs(search.named(true[:, None]), SETTINGS)[0]

    def best(begins):
        return min(end.cost for end in descend_many(problem, search, SETTINGS, begins, limit=40)) / least

    order = np.argsort(problem.costs(search.named(ensemble), SETTINGS))
    assert best(np.stack(parents, axis=1)) > 1.02  # else this drive tests nothing
    assert best(ensemble[:, order[:8]]) <= 1.02


def test_the_ensemble_keeps_bounds_and_the_first_parents_dead_time(drive):
    true = np.array(list(TRUE.values()))
    _, search, ensemble = learned(drive, [true, 1.1 * true])
    assert np.all((ensemble >= search.low[:, None]) & (ensemble <= search.high[:, None]))
    np.testing.assert_allclose(ensemble[search.names.index("T_d")], TRUE["T_d"], rtol=1e-9)
    assert np.all(np.ptp(ensemble[:-1], axis=1) > 0.0)
    np.testing.assert_array_equal(ensemble, learned(drive, [true, 1.1 * true])[2])


@pytest.mark.parametrize("kind", ["position", "acceleration", "velocity-differenced"])
def test_every_kind_of_output_teaches(drive, kind):
    structure = PAPER.parse("one_mass+viscous")
    values = {"J1": 0.02, "f_v": 0.05}
    (q, _, a) = reference(
        structure, values, drive.u, E.dt, f_tanh=E.f_tanh, outputs=("position", "velocity", "acceleration")
    )
    y = {"position": q, "acceleration": a, "velocity-differenced": np.diff(q, prepend=q[0]) / E.dt}[kind]
    y = y + 1e-3 * np.abs(y).max() * np.random.default_rng(2).standard_normal(y.size)
    recording = replace(drive, y=y[None], outputs=(Signal("y", kind, "rad"),))
    _, _, ensemble = learned(recording, [np.array([0.03, 0.03])], structure=structure)
    np.testing.assert_allclose(ensemble[:, 0], list(values.values()), rtol=0.05)


def test_only_independent_starts_bear_witness():
    ends = [End(np.zeros(1), cost, True, 1, 5) for cost in (100.0, 100.2, 100.3, 120.0)]
    assert _agreeing([_Part([], ends, [True, True, False, True], 0, Spent())]) == 2
    apart = [
        _Part([], [end], [alone], 0, Spent()) for end, alone in zip(ends, (False, False, False, True), strict=True)
    ]
    assert _agreeing(apart) == 0
