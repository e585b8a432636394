"""Least squares of a search: where it starts from, and what it is judged by."""

import dataclasses

import numpy as np
import pytest

from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER
from brightgrey.search import criterion
from brightgrey.search.estimators import LeastSquares
from brightgrey.search.experiment import reference_recording, task_of

VALUES = dict(PAPER_EXPERIMENT.values) | {"J3": 0.005, "J4": 0.003, "c2": 180.0, "c3": 160.0, "d2": 0.06, "d3": 0.04}
VALUES |= {"T_1": 0.004}


def task_for(truth):
    structure = PAPER.parse(truth)
    return task_of(reference_recording(structure, {name: VALUES[name] for name in structure.parameters}))


def identified(task, name, iterations=30):
    structure = PAPER.parse(name)
    start = task.standard(structure)
    (found,) = LeastSquares(task, iterations)(structure, [tuple((n, start[n]) for n in structure.parameters)])
    return found


def test_errors_of_the_simulation_are_no_evidence():
    truth = "one_mass+coulomb+viscous"
    task, value = task_for(truth), criterion("bic").value
    own, more = identified(task, truth), identified(task, f"{truth}+gravity")
    assert own.misfit.rss[0] < 1.1 * own.misfit.least[0]
    assert value(own.misfit, own.n_parameters) > value(more.misfit, more.n_parameters)
    structure = PAPER.parse(truth)
    (fast,) = task.misfits(structure, {n: np.array([v]) for n, v in own.values})
    assert fast.rss[0] > 2.0 * own.misfit.rss[0]  # what the search would have gone by


def test_what_noise_covers_is_left_at_the_level_of_the_search(task, true_values):
    structure = PAPER.parse("two_mass+coulomb")
    found = identified(dataclasses.replace(task, start=true_values), "two_mass+coulomb")
    (fast,) = task.misfits(structure, {n: np.array([v]) for n, v in found.values})
    assert found.misfit.rss == fast.rss


@pytest.mark.parametrize("truth", ["three_mass+coulomb+viscous", "four_mass+coulomb+viscous+stribeck"])
def test_a_bad_step_along_bounds_ends_no_descent(truth):
    found = identified(task_for(truth), truth, iterations=50)
    assert found.misfit.rss[0] < 10.0 * found.misfit.least[0]
