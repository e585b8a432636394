"""Exact friction in a search: taken where it explains more than any width, on recordings of the reference solver."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from brightgrey import identify
from brightgrey.api.to_si import identification_task
from brightgrey.api.written_run import task_of_run
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER
from brightgrey.numerics.distributions import chi2
from brightgrey.search.adequacy import material_growth
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.fitting.exact_friction import refit_all, reverses_at_once, simplifies
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.refined_fit import RefinedFits, residual_and_jacobian
from brightgrey.search.fitting.structure_fit import Options, fit_multistart
from brightgrey.search.lattice import Lattice
from brightgrey.search.parallel import InlineExecutor
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

TRUTH = {"J1": 0.0277, "M_C": 2.11, "M_G": 0.52}
STRUCTURE = PAPER.parse("one_mass+coulomb+gravity")
NOTABLE = material_growth(model_error=True)


def recording(f_tanh, noise, *, truth=TRUTH, structure=STRUCTURE, torque=3.5):
    """A chirp; by default friction and weight hold it for a good part of the time. Noise is relative to the peak."""
    t = E.dt * np.arange(1200)
    u = torque * np.sin(2.0 * np.pi * (0.5 + 1.5 * t / t[-1]) * t) * (0.4 + 0.6 * t / t[-1])
    (v,) = reference(str(structure), truth, u, E.dt, f_tanh=f_tanh)
    v += noise * np.abs(v).max() * np.random.default_rng(3).standard_normal(v.size)
    return make_recording(u, v, dt=E.dt)


def fitted(f_tanh, noise, structure=STRUCTURE):
    """Task of a recording, and a fit by multistart."""
    task = identification_task([recording(f_tanh, noise)], None, {}, {}, None)
    return task, fit_multistart(task, structure, Options(patience=0), seed=1)


@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-4])
def test_reverses_at_once__drive_that_rests__yes(noise):
    assert reverses_at_once(*fitted(np.inf, noise), NOTABLE)


@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("share", [0.003, 0.03])
def test_reverses_at_once__friction_with_a_width__no(share, noise):
    speed = np.abs(recording(np.inf, 0.0).y).max()
    assert not reverses_at_once(*fitted(1.0 / (share * speed), noise), NOTABLE)


def test_reverses_at_once__drive_that_never_rests_and_no_noise__yes():
    """Narrow Stribeck friction takes the part of a reversal that is sharper than any width."""
    structure, values = (
        PAPER.parse("one_mass+coulomb+viscous+delay"),
        {"J1": 0.02, "M_C": 0.3, "f_v": 0.03, "T_d": 5e-3},
    )
    task = identification_task(
        [recording(np.inf, 0.0, truth=values, structure=structure, torque=6.0)], None, {}, {}, None
    )
    larger = PAPER.parse("one_mass+coulomb+viscous+stribeck+delay")
    assert reverses_at_once(task, fit_multistart(task, larger, Options(patience=0), seed=1), NOTABLE)


@pytest.mark.parametrize(("share", "allowed", "saved"), [(0.0, 0.0, True), (0.01, 0.0, False), (0.01, 1e9, False)])
def test_simplifies__narrow_stribeck_friction_mends_the_reversal__only_of_exact_friction(share, allowed, saved):
    """The truth has no Stribeck friction, and `share` of the largest speed is the width of its reversal.

    Nor is friction exact where any deviance is allowed, because a width explains as much without the effect.
    """
    truth, structure = {"J1": 0.02, "M_C": 0.6, "f_v": 0.03}, PAPER.parse("one_mass+coulomb+viscous")
    larger = PAPER.parse("one_mass+coulomb+viscous+stribeck")
    speed = np.abs(recording(np.inf, 0.0, truth=truth, structure=structure, torque=6.0).y).max()
    f_tanh = np.inf if share == 0.0 else 1.0 / (share * speed)
    measured = recording(f_tanh, 1e-5, truth=truth, structure=structure, torque=6.0)
    task, workers = identification_task([measured], None, {}, {}, None), InlineExecutor()
    fits, lattice = FitTable(task, [structure, larger]), Lattice.of(PAPER, exclude=["two_mass"])
    fits.add([structure, larger], workers)
    refined = RefinedFits(task, fits, workers)
    refined.begin_round(larger)
    assert simplifies(refined, lattice, larger, lambda free: float(chi2.isf(0.02, free)) + allowed) == saved


def test_search__exact_friction_and_some_noise__needs_no_stribeck_friction():
    """The best fit has some, so that an exact sign gains too little beside it."""
    truth, structure = {"J1": 0.02, "M_C": 0.6, "f_v": 0.03}, PAPER.parse("one_mass+coulomb+viscous")
    measured = recording(np.inf, 3e-4, truth=truth, structure=structure, torque=6.0)
    offered = {*structure.names, "stribeck"}
    lattice = Lattice.of(PAPER, exclude=[e for e in PAPER.places if e not in offered])
    search = BorderSearch(identification_task([measured], None, {}, {}, None), lattice, InlineExecutor())
    border = search.run()
    assert [lattice.structure(m) for m in border.minimal] == [structure]
    assert search.task.exact_friction


@pytest.mark.parametrize(("share", "simpler"), [(0.0, True), (0.01, False)])
def test_simplifies__minimal_structure_itself_explains_more__only_of_exact_friction(share, simpler):
    """What leads has been asked, but its optimum may hide it among further effects."""
    speed = np.abs(recording(np.inf, 0.0).y).max()
    task, found = fitted(np.inf if share == 0.0 else 1.0 / (share * speed), 1e-5)
    fits = FitTable(task, [STRUCTURE])
    fits.done[STRUCTURE] = found
    refined = RefinedFits(task, fits, InlineExecutor())
    refined.begin_round(STRUCTURE, model_error=True)
    lattice = Lattice.of(PAPER, [n for n in STRUCTURE.names if n != "one_mass"], ["two_mass"])  # no effect of it can go
    assert simplifies(refined, lattice, STRUCTURE, lambda free: 0.0) == simpler


def test_reverses_at_once__nothing_that_could_reverse__no():
    assert not reverses_at_once(*fitted(np.inf, 0.0, PAPER.parse("one_mass+viscous+gravity")), NOTABLE)


def test_refit_all__task_with_exact_friction__all_fits_have_it_and_the_truth_is_reached():
    task = identification_task([recording(np.inf, 0.0)], None, {}, {}, None)
    fits = FitTable(task, [PAPER.parse("one_mass+coulomb"), STRUCTURE])
    smaller = PAPER.parse("one_mass+coulomb")
    with ThreadPoolExecutor(1) as pool:
        fits.add([smaller, STRUCTURE], pool)
        before = fits.done[STRUCTURE].cost
        fits.task = task.with_friction_of({FRICTION_WIDTH: 0.0})
        refit_all(fits, pool)
    assert set(fits.done) == {smaller, STRUCTURE}
    assert all(f.values[FRICTION_WIDTH] == 0.0 for f in (*fits.done.values(), *fits.anchors.values()))
    found = fits.done[STRUCTURE]
    assert found.cost < 1e-3 * before
    assert found.values["M_C"] == pytest.approx(TRUTH["M_C"], rel=1e-4)


def test_identify__drive_that_rests_and_no_noise__finds_the_truth_alone_with_exact_friction():
    """With a width, a second mass takes the part of what creeps."""
    found = identify(recording(np.inf, 0.0), exclude=["three_mass", "current_control", "delay"])
    assert [str(r.structure) for r in found.evidence.minimal] == [str(STRUCTURE)]
    assert found.evidence.minimal[0].values[FRICTION_WIDTH] == 0.0
    assert found.model.settings.friction_width == 0.0
    low, high = found.model.settings.friction_width_ci95
    assert low == 0.0
    assert high < 0.01 * found.model.settings.speed_scale
    for name, value in TRUTH.items():
        assert found.model.values_si()[name] == pytest.approx(value, rel=1e-4)
    # the self-test takes its noise from the residual: with a width it would be that of the creep
    again, values = task_of_run(found.record, found.recordings), found.evidence.minimal[0].values
    residual = residual_and_jacobian(again, STRUCTURE, values)[0]
    assert np.abs(residual).max() < 1e-6 * np.abs(again.problem(STRUCTURE).weights * found.recordings[0].y).max()
