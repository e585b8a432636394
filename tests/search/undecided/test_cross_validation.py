"""Predictions of recordings that were left out, on recordings of the reference solver."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from brightgrey.api.to_si import identification_task
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER
from brightgrey.search.adequacy import Round
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.detectability import Detectability
from brightgrey.search.lattice import Lattice
from brightgrey.search.undecided.cross_validation import (
    LeftOut,
    each_half,
    each_recording,
    extended_by_prediction,
    missed,
    predict_left_out,
)
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

TRUTH = {"J1": 0.0277, "M_C": 0.8, "f_v": 0.05, "M_G": 0.6}
STRUCTURE = PAPER.parse("one_mass+coulomb+viscous+gravity")
FIRST = PAPER.parse("one_mass+viscous+gravity")
OPTIONAL = ("two_mass", "coulomb", "backlash", "current_control", "delay")


def task_of(frequencies, noise=0.003):
    """Sines of several frequencies, with noise."""
    t, made = E.dt * np.arange(600), []
    for k, frequency in enumerate(frequencies):
        u = 3.0 * np.cos(2.0 * np.pi * frequency * t) + 0.6
        (v,) = reference(str(STRUCTURE), TRUTH, u, E.dt, f_tanh=100.0)
        v += noise * np.abs(v).max() * np.random.default_rng(k).standard_normal(v.size)
        made.append(make_recording(u, v, dt=E.dt))
    return identification_task(made, None, {}, {}, 100.0)


@pytest.fixture(scope="module")
def three():
    return task_of((1.0, 2.0, 3.5))


def extended(task, *, model_error, is_known=lambda structure: True):
    """The structure that predictions lead to without Coulomb friction, and the predictions."""
    with ThreadPoolExecutor(1) as workers:
        search = BorderSearch(task, Lattice.of(PAPER.whole), workers)
        search.fits.add([FIRST], workers)
        circumstances = Round(search.lattice, 2, {4: 20}, 0.0, model_error)
        detectability = Detectability(search.refined, circumstances, workers)
        predictions = LeftOut(search.fits, workers)
        return extended_by_prediction(detectability, predictions, FIRST, OPTIONAL, is_known), predictions, search.fits


def test_predict_left_out__true_structure__noise_is_all_that_is_missed(three):
    noise = [100.0 * 0.003 * np.abs(r.y).max() / r.y.std() for r in three.recordings]
    found = predict_left_out(three, STRUCTURE, TRUTH, each_recording(three.recordings))
    np.testing.assert_allclose(100.0 - np.array(found), noise, rtol=0.1)


def test_missed__fits__squares_of_what_is_left():
    assert missed((90.0, 80.0)) == 100.0 + 400.0
    assert missed((-1286.0, -np.inf)) == 2 * 100.0**2
    assert missed(()) == 0.0


def test_extended_by_prediction__model_error__adds_what_is_there_and_no_more(three):
    structure, predictions, fits = extended(three, model_error=True)
    assert structure == STRUCTURE
    before, after = predictions.of([fits.done[FIRST], fits.done[STRUCTURE]])
    assert all(new > old for new, old in zip(after, before, strict=True))


@pytest.mark.parametrize(
    ("frequencies", "model_error"), [((1.0, 2.0, 3.5), False), ((1.0, 3.5), True)], ids=["noise", "two recordings"]
)
def test_extended_by_prediction__nothing_that_predictions_tell__stays(frequencies, model_error):
    assert extended(task_of(frequencies), model_error=model_error)[0] == FIRST


def test_extended_by_prediction__parameters_that_are_not_known__are_not_added(three):
    assert extended(three, model_error=True, is_known=lambda structure: structure == FIRST)[0] == FIRST


def told(monkeypatch, by_split):
    """Let predictions be known, of the first structure and of the true one; others miss everything."""

    def of(self, fits):
        known = by_split[self.split]
        nothing = (0.0,) * len(known[FIRST])
        return [known.get(f.structure, nothing) for f in fits]

    monkeypatch.setattr(LeftOut, "of", of)


@pytest.mark.parametrize(("third", "added"), [(92.1, True), (91.7, True), (86.0, False)])
def test_extended_by_prediction__one_recording_a_little_worse__is_added_but_not_if_it_is_notably(
    third, added, three, monkeypatch
):
    """Where the others get much better, the last digits of one recording decide nothing."""
    whole = {FIRST: (80.0, 86.0, 92.1), STRUCTURE: (84.0, 89.0, third)}
    halves = dict.fromkeys((FIRST, STRUCTURE), (90.0,) * 6)
    told(monkeypatch, {each_recording: whole, each_half: halves})
    assert (extended(three, model_error=True)[0] == STRUCTURE) == added


@pytest.mark.parametrize(("half", "added"), [(85.0, True), (80.0, False)])
def test_extended_by_prediction__others_predict_as_well__halves_decide(half, added, three, monkeypatch):
    whole = dict.fromkeys((FIRST, STRUCTURE), (80.0, 86.0, 92.1))
    told(monkeypatch, {each_recording: whole, each_half: {FIRST: (80.0,) * 6, STRUCTURE: (half,) * 6}})
    assert (extended(three, model_error=True)[0] == STRUCTURE) == added


def test_each_half__three_recordings__each_predicts_the_other(three):
    folds = each_half(three.recordings)
    assert [[r.samples for r in part] for fold in folds for part in fold] == [[300] * 3] * 4
    fitted, left_out = folds[0]
    for whole, first, second in zip(three.recordings, fitted, left_out, strict=True):
        np.testing.assert_array_equal(np.hstack([first.y, second.y]), whole.y)
    assert folds[1] == (left_out, fitted)


def test_each_half__recordings_of_39_samples__are_too_short_for_halves(three):
    short = [replace(r, t=r.t[:39], u=r.u[:39], y=r.y[:, :39]) for r in three.recordings]
    assert each_half(short) == []


def test_predict_left_out__half_at_rest__is_missed_as_a_whole_at_most(three):
    """Nothing moves in the second half, so that no structure can explain any motion there."""
    moving = np.arange(600) < 300
    task = replace(three, recordings=tuple(replace(r, u=r.u * moving, y=r.y * moving) for r in three.recordings))
    found = predict_left_out(task, STRUCTURE, TRUTH, each_half(task.recordings))
    assert len(found) == 6
    assert missed(found) <= 6 * 100.0**2
