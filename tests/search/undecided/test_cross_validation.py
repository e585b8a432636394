"""Predictions of recordings that were left out, on recordings of the reference solver."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from brightgrey.api.to_si import identification_task
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER, function_set
from brightgrey.search.adequacy import Round
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.detectability import Detectability
from brightgrey.search.lattice import Lattice
from brightgrey.search.undecided.cross_validation import (
    LeftOut,
    extended_unless_contradicted,
    missed,
    predict_halves,
    predict_left_out,
)
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

TRUTH = {"J1": 0.0277, "M_C": 0.8, "f_v": 0.05, "M_G": 0.6}
STRUCTURE = PAPER.parse("one_mass+coulomb+viscous+gravity")
FIRST = PAPER.parse("one_mass+viscous+gravity")
OPTIONAL = ("two_mass", "coulomb", "backlash", "current_control", "delay")


def task_of(frequencies, noise=0.003, *, structure=str(STRUCTURE), values=TRUTH, kind="velocity", rest_from=600):
    """Sines of several frequencies, with noise; from some sample on no more than the constant torque is held."""
    t, made = E.dt * np.arange(600), []
    for k, frequency in enumerate(frequencies):
        u = 3.0 * np.cos(2.0 * np.pi * frequency * t) * (np.arange(600) < rest_from) + 0.6
        (y,) = reference(structure, values, u, E.dt, f_tanh=100.0, outputs=(kind,))
        y += noise * np.abs(y).max() * np.random.default_rng(k).standard_normal(y.size)
        made.append(make_recording(u, y, dt=E.dt, kind=kind))
    return identification_task(made, None, {}, {}, 100.0)


@pytest.fixture(scope="module")
def three():
    return task_of((1.0, 2.0, 3.5))


def always(*_):
    return True


def extended(task, *, model_error, is_known=always, is_beyond_chance=always):
    """The structure that predictions lead to without Coulomb friction, and the predictions."""
    with ThreadPoolExecutor(1) as workers:
        search = BorderSearch(task, Lattice.of(PAPER.whole), workers)
        search.fits.add([FIRST], workers)
        circumstances = Round(search.lattice, 2, {4: 20}, 0.0, model_error)
        detectability = Detectability(search.refined, circumstances, workers)
        predictions = LeftOut(search.fits, workers)
        asked = (predictions, FIRST, OPTIONAL, is_known, is_beyond_chance)
        return extended_unless_contradicted(detectability, *asked), predictions, search.fits


def test_predict_left_out__true_structure__noise_is_all_that_is_missed(three):
    noise = [100.0 * 0.003 * np.abs(r.y).max() / r.y.std() for r in three.recordings]
    found = predict_left_out(three, STRUCTURE, TRUTH)
    np.testing.assert_allclose(100.0 - np.array(found), noise, rtol=0.1)


def test_missed__fits__squares_of_what_is_left():
    assert missed((90.0, 80.0)) == 100.0 + 400.0
    assert missed((-1286.0, -np.inf)) == 2 * 100.0**2
    assert missed(()) == 0.0


def test_extended_unless_contradicted__model_error__adds_what_is_there_and_no_more(three):
    structure, predictions, fits = extended(three, model_error=True)
    assert structure == STRUCTURE
    before, after = predictions.of([fits.done[FIRST], fits.done[STRUCTURE]])
    assert all(new > old for new, old in zip(after, before, strict=True))


@pytest.mark.parametrize(
    ("frequencies", "model_error"), [((1.0, 2.0, 3.5), False), ((1.0, 3.5), True)], ids=["noise", "two recordings"]
)
def test_extended_unless_contradicted__nothing_that_predictions_tell__stays(frequencies, model_error):
    assert extended(task_of(frequencies), model_error=model_error)[0] == FIRST


def test_extended_unless_contradicted__parameters_that_are_not_known__are_not_added(three):
    assert extended(three, model_error=True, is_known=lambda structure: structure == FIRST)[0] == FIRST


def test_extended_unless_contradicted__no_more_than_chance__is_not_added(three):
    assert extended(three, model_error=True, is_beyond_chance=lambda own, larger, tried: False)[0] == FIRST


@pytest.mark.parametrize(
    ("whole", "halves", "added"),
    [
        ((84.0, 89.0, 92.1), (92.0, 92.0, 92.0), True),
        ((84.0, 89.0, 91.7), (90.0, 90.0, 90.0), True),
        ((80.0, 86.0, 91.0), (90.0, 90.0, 90.0), True),
        ((84.0, 89.0, 82.0), (90.0, 90.0, 90.0), False),
        ((80.0, 86.0, 92.1), (89.0, 90.0, 89.0), False),
        ((79.0, 85.0, 91.0), (90.0, 90.0, 90.0), False),
    ],
    ids=["better", "one a little worse", "all a little worse", "one much worse", "halves worse", "all worse"],
)
def test_extended_unless_contradicted__fits_better__is_added_unless_predictions_contradict(
    whole, halves, added, three, monkeypatch
):
    told = {
        predict_left_out: {FIRST: (80.0, 86.0, 92.1), STRUCTURE: whole},
        predict_halves: {FIRST: (90.0, 90.0, 90.0), STRUCTURE: halves},
    }

    def of(self, fits):
        return [told[self.predict].get(f.structure, (0.0, 0.0, 0.0)) for f in fits]

    monkeypatch.setattr(LeftOut, "of", of)
    assert (extended(three, model_error=True)[0] == STRUCTURE) == added


@pytest.mark.parametrize("kind", ["velocity", "position", "acceleration"])
@pytest.mark.parametrize(
    ("structure", "values"),
    [
        ("one_mass+coulomb+viscous+gravity", TRUTH),
        ("one_mass+viscous+gravity+ground_spring", {"J1": 0.0277, "f_v": 0.05, "M_G": 0.6, "c_g": 0.3}),
    ],
    ids=["coulomb", "spring"],
)
def test_predict_halves__true_structure__misses_noise_and_no_more_by_the_parameters_of_a_half(structure, values, kind):
    """The model itself brings the state in the middle; no sensor tells all of it."""
    task = task_of((1.0, 2.0, 3.5), structure=structure, values=values, kind=kind)
    noise = [100.0 * 0.003 * np.abs(r.y).max() / r.y.std() for r in task.recordings]
    part = (100.0 - np.array(predict_halves(task, function_set().parse(structure), values))) / noise
    assert part.min() > 0.9
    assert part.max() < np.sqrt(2.0)


def test_predict_halves__second_half_at_rest__counts_little():
    """A half without motion holds no part of it, so that an error there is no part either."""
    task = task_of((1.0, 2.0, 3.5), rest_from=300)
    assert min(predict_left_out(task, STRUCTURE, TRUTH)) > 98.0
    assert min(predict_halves(task, STRUCTURE, TRUTH)) > 97.0
