"""Samples that a search leaves out: it takes more of them where that shows in what the best fit leaves."""

from dataclasses import replace

import numpy as np
import pytest

from brightgrey.estimation.problem.decimation import decimated
from brightgrey.kit import PAPER
from brightgrey.search.fitting.enough_samples import with_enough_samples
from brightgrey.search.fitting.structure_fit import Options, fit_multistart
from brightgrey.search.further.offers import effective_samples_of
from support.searches import simulated_task

DT, FACTOR = 1e-3, 10
STRUCTURE = PAPER.parse("two_mass+viscous")
VALUES = {"J1": 0.012, "J2": 0.008, "c1": 60.0, "d1": 0.03, "f_v": 0.03}
T = DT * np.arange(12001)
TORQUE = np.sin(2.0 * np.pi * np.outer(T, (0.7, 2.3, 5.1, 11.3))).sum(axis=1)


def tasks(noise, factor=FACTOR, torque=TORQUE):
    """Task with all samples, and with every `factor`-th; there is a resonance at 18 Hz.

    Where every second sample is kept, an error that shows calls for all of them, and None is said of no other case.
    """
    whole = simulated_task(str(STRUCTURE), VALUES, torque, noise, dt=DT, f_tanh=50.0)
    return whole, replace(whole, recordings=tuple(decimated(r, factor) for r in whole.recordings))


def asked(coarse, whole, fitted):
    return with_enough_samples(coarse, whole.recordings, fitted, effective_samples_of(coarse, fitted))


def best(task):
    return fit_multistart(task, STRUCTURE, Options(fresh=2, patience=0), 0)


@pytest.fixture(scope="module")
def clean():
    return tasks(0.002)


def test_with_enough_samples__clean_recording__leaves_out_fewer_and_comes_nearer_to_the_truth(clean):
    whole, coarse = clean
    fitted = best(coarse)
    finer = asked(coarse, whole, fitted)
    assert coarse.recordings[0].samples < finer.recordings[0].samples < whole.recordings[0].samples
    again = best(finer)
    assert abs(again.values["c1"] / VALUES["c1"] - 1.0) < abs(fitted.values["c1"] / VALUES["c1"] - 1.0)
    assert asked(finer, whole, again) is None


def test_with_enough_samples__every_second_sample_of_a_fast_torque__takes_all():
    whole, coarse = tasks(1e-3, 2, TORQUE + 5.0 * np.sin(2.0 * np.pi * 150.0 * T))
    assert asked(coarse, whole, best(coarse)) == whole


def test_with_enough_samples__poor_fit__what_is_left_out_does_not_show():
    whole, coarse = tasks(0.002, 2)
    rigid = fit_multistart(coarse, PAPER.parse("one_mass+viscous"), Options(fresh=2, patience=0), 0)
    assert asked(coarse, whole, rigid) is None


def test_with_enough_samples__noise__has_enough():
    whole, coarse = tasks(0.5, 2)
    assert asked(coarse, whole, best(coarse)) is None


def test_with_enough_samples__nothing_left_out__has_enough(clean):
    whole, coarse = clean
    assert asked(whole, whole, best(coarse)) is None


def test_with_enough_samples__differenced_speed__is_compared_as_the_mean_over_the_samples():
    whole, _ = tasks(0.5)
    (r,) = whole.recordings
    angle = np.cumsum(r.y[0]) * DT
    signal = replace(r.outputs[0], kind="velocity-differenced")
    whole = replace(whole, recordings=(replace(r, y=np.diff(angle, prepend=0.0)[None] / DT, outputs=(signal,)),))
    coarse = replace(whole, recordings=tuple(decimated(r, 2) for r in whole.recordings))
    assert asked(coarse, whole, best(coarse)) is None
