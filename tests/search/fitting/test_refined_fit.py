"""Refined fits in coloured noise, against scipy's least squares on the same whitened residuals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import lfilter

from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER, function_set
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.refined_fit import Refined, RefinedFits, accurate, refine, whitening_by
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.parallel import thread_pool
from brightgrey.search.policy import REFINEMENT
from brightgrey.simulation.reference import reference
from support.searches import simulated_task, task_of_arrays

DT, F_TANH = 0.002, 5.0
TRUTH, VALUES = PAPER.parse("one_mass+coulomb+viscous"), {"J1": 0.02, "M_C": 0.5, "f_v": 0.03}


@pytest.fixture(scope="module")
def coloured():
    """A drive in noise that hangs together over ten samples, quantised; its fit by unweighted squares; whitening."""
    t = DT * np.arange(500)
    u = 3.0 * np.sign(np.sin(2.0 * np.pi * 2.0 * t + 0.7)) * np.minimum(1.0, 20.0 * t)
    (v,) = reference(str(TRUTH), VALUES, u, DT, f_tanh=F_TANH)
    y = v + lfilter([0.3], [1.0, -0.9], np.random.default_rng(4).standard_normal(v.size))
    task = task_of_arrays(u, 0.01 * np.round(y / 0.01), dt=DT, f_tanh=F_TANH)
    with thread_pool(None) as workers:
        fits = FitTable(task, [TRUTH])
        fits.add([TRUTH], workers)
    fitted = fits.done[TRUTH]
    return task, fitted, whitening_by(task, TRUTH, fitted.values)


def residuals(task, whitening):
    """Whitened residuals by the logarithms of the three parameters."""
    problem, settings = task.problem(TRUTH), accurate(task).settings

    def whitened(logs):
        values = dict(zip(VALUES, np.exp(logs)[:, None], strict=True))
        return whitening.whiten(problem.residuals(values, settings)[:, 0])

    return whitened


def test_refine__coloured_noise__lower_whitened_cost_at_scipys_optimum(coloured):
    task, fitted, whitening = coloured
    whitened = residuals(task, whitening)
    begin = np.log([fitted.values[name] for name in VALUES])
    unweighted = float(np.sum(whitened(begin) ** 2))
    wanted = least_squares(whitened, begin, method="lm", xtol=1e-12, ftol=1e-12)
    found = refine(task, TRUTH, {n: 1.05 * v for n, v in fitted.values.items()}, whitening, np.inf)
    deviance = found.deviance - whitening.floor_deviance
    assert found.finished
    assert deviance < unweighted - REFINEMENT.negligible  # unweighted squares are not efficient here
    assert 2.0 * wanted.cost <= deviance + 1e-6
    assert deviance == pytest.approx(2.0 * wanted.cost, abs=0.2)  # noise has variance 1: chance makes more than that
    spread = np.sqrt(np.diag(np.linalg.inv(wanted.jac.T @ wanted.jac)))
    assert np.all(np.abs(np.log([found.values[n] for n in VALUES]) - wanted.x) < 0.3 * spread)


def test_refine__free_parameters_and_cost__those_of_the_fit(coloured):
    task, fitted, whitening = coloured
    found = refine(task, TRUTH, fitted.values, whitening, np.inf)
    values = {name: np.array([found.values[name]]) for name in VALUES}
    assert found.free == 3
    assert found.at_bound == ()
    assert found.cost == pytest.approx(float(task.problem(TRUTH).costs(values, accurate(task).settings)[0]), rel=1e-9)


def test_refine__curved_valley__ends_at_the_optimum_however_many_rounds_that_takes():
    """Friction of three kinds: what one has less of another has more of. Ten rounds end far above."""
    structure = function_set().parse("one_mass+viscous+stribeck+gravity+directional_viscous")
    values = {"J1": 0.024, "f_v": 0.064, "M_S": 2.2, "omega_S": 3.0, "M_G": -0.4, "f_d": 0.047}
    task = simulated_task(str(structure), values, E.torque(), 0.005 * E.speed, dt=E.dt, f_tanh=2.0)
    whitening = whitening_by(task, structure, values)
    elsewhere = {**values, "f_v": 0.2, "M_S": 1.0, "omega_S": 10.0, "f_d": -0.05}
    found, wanted = (refine(task, structure, begin, whitening, np.inf) for begin in (elsewhere, values))
    assert found.deviance == pytest.approx(wanted.deviance, abs=0.2)  # chance makes more than that


def test_refine__far_above_hopeless__stops_after_one_derivative(coloured):
    """What is left without friction is beyond all doubt: its exact optimum does not matter."""
    task, _, whitening = coloured
    bare = PAPER.parse("one_mass")
    whole = refine(task, bare, {"J1": 0.03}, whitening, np.inf)
    given_up = refine(task, bare, {"J1": 0.03}, whitening, 0.5 * whole.deviance)
    assert not given_up.finished
    assert given_up.spent.sets == 2  # the residual, and one derivative
    assert given_up.deviance > 0.5 * whole.deviance
    assert whole.finished
    assert whole.deviance <= given_up.deviance * (1.0 + 1e-3) or whole.spent.sets > given_up.spent.sets


def test_refined_fits__hopeless_fit__made_exact_when_it_is_asked_for(coloured):
    task, fitted, _ = coloured
    bare = PAPER.parse("one_mass")
    with thread_pool(None) as workers:
        fits = FitTable(task, [bare, TRUTH])
        fits.done[TRUTH] = fitted
        fits.done[bare] = StructureFit(bare, {"J1": 0.03}, 1e6 * fitted.cost, 1)
        refined = RefinedFits(task, fits, workers)
        with pytest.raises(RuntimeError, match="begin_round"):
            _ = refined.whitening
        refined.begin_round(TRUTH)
        first = refined.all(lambda least: 10.0)
        assert first[TRUTH].finished
        assert not first[bare].finished
        assert refined.of(bare).finished
        assert refined.of(TRUTH) is first[TRUTH]  # made once
        residual, jacobian, inside = refined.jacobian(TRUTH)
    assert residual @ residual == pytest.approx(first[TRUTH].cost)
    assert (jacobian.shape, inside) == ((residual.size, 3), (0, 1, 2))


@pytest.mark.parametrize(("f_v", "tells"), [(0.004, True), (0.0, False)])
def test_refined_fits__redundant_in_the_plain_cost__counts_if_the_whitened_one_shows_it(f_v, tells):
    values = {"J1": 0.014, "M_C": 0.3, "f_v": f_v}
    texts = ("one_mass+coulomb", "one_mass+coulomb+viscous", "one_mass+coulomb+viscous+gravity")
    without, own, larger = map(PAPER.parse, texts)
    task = simulated_task(str(own), values, E.torque(), 0.005 * E.speed, dt=E.dt, f_tanh=200.0)
    with thread_pool(None) as workers:
        fits = FitTable(task, [without, own, larger])
        fits.add([without, larger], workers)
        known = fits.done[without]
        redundant = {**known.values, "f_v": 1e-3}
        fits.done[own] = replace(known, structure=own, values=redundant, redundant_effects=("viscous",), equals=without)
        refined = RefinedFits(task, fits, workers)
        refined.begin_round(larger)
        found = refined.all(lambda least: np.inf)
    assert (own in found) == tells
    if tells:
        assert found[own].deviance < found[larger].deviance + 10.0 < found[without].deviance
        assert found[own].values["f_v"] == pytest.approx(f_v, rel=0.1)


@pytest.mark.parametrize("model_error", [False, True])
def test_refined_fits__ended_beside_the_optimum_of_a_larger_one__is_fitted_from_there(model_error):
    """A shaft that is far too stiff is a local optimum. The larger structure has friction that it hardly uses."""
    values = {"J1": 0.008, "J2": 0.006, "c1": 60.0, "d1": 0.05, "f_v": 0.004}
    own, larger = map(PAPER.parse, ("two_mass+viscous", "two_mass+coulomb+viscous"))
    task = simulated_task(str(own), values, E.torque(), 0.005 * E.speed, dt=E.dt, f_tanh=200.0)
    stiff = {**values, "c1": 500.0}
    with thread_pool(None) as workers:
        fits = FitTable(task, [own, larger])
        fits.fit_from(larger, {**values, "M_C": 1e-4}, workers)
        fits.done[own] = StructureFit(own, stiff, np.inf, 5)
        known = RefinedFits(task, fits, workers)
        known.begin_round(larger, model_error=model_error)
        alone = refine(task, own, stiff, known.whitening, np.inf)
        found = known.all(lambda least: np.inf)
    assert alone.finished
    assert alone.deviance > 10.0 * found[larger].deviance
    assert (found[own].deviance <= found[larger].deviance) != model_error
    assert (found[own].values["c1"] == pytest.approx(60.0, rel=0.02)) != model_error


def test_runaway__parameter_at_bound__unless_the_bound_is_the_users(coloured):
    """An inert mass that has run to its bound is a wall, or has vanished; the mass before it has not."""
    task, fitted, whitening = coloured
    three = PAPER.parse("three_mass+backlash")
    made = refine(task, TRUTH, fitted.values, whitening, np.inf)
    ran = Refined(three, {}, 0.0, 0.0, 8, ("J3", "d1"), True, made.spent)
    own = replace(task, bounds={"J3": (0.001, 0.01)})
    assert ran.runaway("three_mass", task)
    assert not ran.runaway("three_mass", own)
    assert not ran.runaway("backlash", task)
    assert replace(ran, at_bound=("alpha",)).runaway("backlash", task)
    assert not replace(ran, at_bound=("d1", "d2")).runaway("three_mass", task)
    assert not made.runaway("coulomb", task)


@pytest.mark.parametrize(("swings", "slowly"), [(1.9, True), (2.1, False)])
def test_swings_slowly__mode_of_two_masses__less_than_twice(coloured, swings, slowly):
    task, *_ = coloured
    duration = task.recordings[0].t[-1]
    values = {"J1": 0.02, "J2": 0.005, "c1": 0.004 * (2.0 * np.pi * swings / duration) ** 2, "d1": 1e-3}
    own = Refined(PAPER.parse("two_mass"), values, 0.0, 0.0, 4, (), True, SimulationCount())
    assert own.swings_slowly(task) is slowly


def test_swings_slowly__one_mass__no(coloured):
    assert not Refined(TRUTH, VALUES, 0.0, 0.0, 3, (), True, SimulationCount()).swings_slowly(coloured[0])
