"""Signs of model error: what the residual of a structure shows beyond the effects that have a verdict."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER, Placed
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.decision import _unexplained_signs
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.lattice import Lattice
from brightgrey.search.unexplained.model_error import (
    calls_for_mass,
    gains_steadily,
    optimum_of,
    signs_of_model_error,
)
from support.recordings import make_recording
from support.searches import simulated_task


def test_signs__missing_coulomb_friction__no_sign_where_it_has_a_verdict():
    values = {"J1": 0.02, "M_C": 1.0, "f_v": 0.02}
    task = simulated_task("one_mass+coulomb+viscous", values, E.torque()[:900], 0.05, dt=E.dt, f_tanh=E.f_tanh, seed=2)
    lacking = PAPER.parse("one_mass+viscous")
    fits = FitTable(task, (), anchors=[lacking])
    with ThreadPoolExecutor(1) as pool:
        fits.add([lacking], pool)
    optimum = optimum_of(task, fits.done[lacking])

    signs = signs_of_model_error(task, lacking, optimum, 0.0)
    left = signs_of_model_error(task, lacking, optimum, 0.0, [Placed("coulomb")])

    assert any("sign of speed" in sign for sign in signs)
    assert set(left) < set(signs)
    assert signs_of_model_error(task, lacking, optimum, np.inf) == ()


def test_unexplained_signs__best_structure_shows_none__those_of_the_simplest_are_said():
    values = {"J1": 0.02, "M_C": 1.0, "f_v": 0.02}
    task = simulated_task("one_mass+coulomb+viscous", values, E.torque()[:900], 0.05, dt=E.dt, f_tanh=E.f_tanh, seed=2)
    best, simplest = PAPER.parse("one_mass+coulomb+viscous"), PAPER.parse("one_mass+viscous")
    lattice = Lattice.of(PAPER, (), [e for e in PAPER.places if e not in ("one_mass", "viscous")])
    with ThreadPoolExecutor(1) as pool:
        search = BorderSearch(task, lattice, pool)
        search.run()
        assert _unexplained_signs(search, best, best) == ()
        assert any("friction" in sign for sign in _unexplained_signs(search, best, simplest))


@pytest.mark.parametrize(
    ("truth", "values", "lacking", "called"),
    [
        ("two_mass+viscous", {"J1": 0.012, "J2": 0.008, "c1": 40.0, "d1": 0.02, "f_v": 0.02}, "one_mass+viscous", True),
        ("one_mass+coulomb+viscous", {"J1": 0.02, "M_C": 1.0, "f_v": 0.02}, "one_mass+viscous", False),
    ],
)
def test_calls_for_mass__resonance_in_the_residual_and_not_friction(truth, values, lacking, called):
    task = simulated_task(truth, values, E.torque()[:900], 0.05, dt=E.dt, f_tanh=E.f_tanh, seed=2)
    structure = PAPER.parse(lacking)
    fits = FitTable(task, (), anchors=[structure])
    with ThreadPoolExecutor(1) as pool:
        fits.add([structure], pool)
    assert calls_for_mass(task, fits.done[structure]) == called


def test_gains_steadily__two_recordings_of_two_outputs__parts_of_time_of_all_outputs():
    """The residuals of a recording stand output by output: what helps one of them all the time is steady."""
    recordings = [make_recording(np.zeros(n), np.zeros((2, n)), kind=("position", "velocity")) for n in (40, 120)]
    own = np.ones(2 * 160)
    first_output = np.concatenate([np.full(40, 2.0), np.ones(40), np.full(120, 2.0), np.ones(120)])
    one_recording = np.concatenate([np.full(80, 2.0), np.ones(240)])
    assert gains_steadily(own, first_output, recordings)
    assert not gains_steadily(own, one_recording, recordings)  # that is two parts of eight
    assert not gains_steadily(own, own, recordings)
