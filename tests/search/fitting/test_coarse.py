"""Coarser recordings for the descents of a search."""

import numpy as np

from brightgrey.estimation.optimisation.torque_regression import with_waves
from brightgrey.kit import Structure
from brightgrey.search.fitting.coarse import coarse_task
from brightgrey.simulation.reference import reference
from support.searches import task_of_arrays

DT, F_TANH = 1e-3, 500.0
STRUCTURE = Structure.parse("one_mass+coulomb+viscous+pendulum")
TRUE = {"J1": 0.05, "M_C": 0.2, "f_v": 0.1, "G": 0.15, "k": 30.0, "phi_0": 0.5}


def slow_ripple():
    """Task of a position with 45 periods of a ripple over the travel, in slow motion."""
    t = DT * np.arange(24000)
    u = 0.5 * np.sin(2.0 * np.pi * 0.05 * t) + 0.3 * np.sin(2.0 * np.pi * 0.21 * t)
    (y,) = reference(STRUCTURE, TRUE, u, DT, f_tanh=F_TANH, outputs=["position"])
    y += 1e-6 * np.abs(y).max() * np.random.default_rng(1).standard_normal(y.size)
    return task_of_arrays(u, y, dt=DT, f_tanh=F_TANH, kind="position")


def test_coarse_task__slow_motion__balances_torques_on_all_samples():
    whole = slow_ripple()
    task = coarse_task(whole)
    assert task.recordings[0].samples < 0.2 * whole.recordings[0].samples
    assert task.fine == whole.recordings
    problem, space = task.problem_and_space(STRUCTURE)
    found = space.named(with_waves(problem, space, task.settings, space.sample(4, np.random.default_rng(2))))
    travel = float(np.ptp(whole.recordings[0].y))
    assert travel * TRUE["k"] > 20 * 2.0 * np.pi
    assert np.abs(found["k"] - TRUE["k"]).min() < 0.5 * 2.0 * np.pi / travel
