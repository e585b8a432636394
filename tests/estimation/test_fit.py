"""Whole fits: what must be found again, and what must be said where it cannot be."""

import sys
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from scipy.signal import lfilter

from brightgrey.errors import SettingsError
from brightgrey.estimation import fit, predict
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER, Structure
from brightgrey.recordings import read_recording
from brightgrey.simulation import shared_cores
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

RIGID = PAPER.parse("one_mass+coulomb+viscous+gravity")
TURNING = Structure.parse("one_mass+coulomb+viscous+pendulum")


@pytest.fixture(scope="module")
def demo():
    path = files("brightgrey.excitation").joinpath("data/demo.csv")
    return read_recording(str(path), input="torque", outputs=["velocity:velocity"], time="t")


@pytest.fixture(scope="module")
def demo_fit(demo):
    structure = PAPER.parse(PAPER_EXPERIMENT.structure)
    return fit(structure, [demo], f_tanh=PAPER_EXPERIMENT.f_tanh, starts=4, level="fast")


def still(u):
    return make_recording(u * np.ones(300), np.zeros(300), name="still")


def test_fit__demo__is_recovered(demo, demo_fit):
    # The recording is one draw of noise: its parameters scatter as the Cramér-Rao bounds in excitation.experiment
    # say (0.06 to 1.8 %). Four of them is beyond one draw in 15,000 per parameter.
    bound = {"J1": 0.06, "J2": 0.09, "c1": 0.03, "d1": 0.3, "M_C": 0.4, "f_v": 0.7, "M_S": 0.5, "omega_S": 1.8}
    for name, true in PAPER_EXPERIMENT.values.items():
        assert demo_fit.estimates[name].value == pytest.approx(true, rel=4e-2 * bound[name]), name
    # Noise of 0.1 % of the peak and rounding to 0.01 rad/s.
    noise = np.hypot(1e-3 * np.abs(demo.y).max(), 0.01 / np.sqrt(12))
    assert demo_fit.train["velocity"].rmse == pytest.approx(noise, rel=0.05)
    assert demo_fit.outcome.kind == "converged"


def test_fit__intervals__are_as_wide_as_the_noise_makes_them(demo_fit):
    bound = {"J1": 0.06, "J2": 0.09, "c1": 0.03, "d1": 0.3}
    for name, percent in bound.items():
        e = demo_fit.estimates[name]
        assert e.std / e.value == pytest.approx(percent / 100, rel=0.35), name
        assert e.ci95[0] < e.value < e.ci95[1]


def test_predict__agrees_with_the_fit(demo, demo_fit):
    values = {name: e.value for name, e in demo_fit.estimates.items()}
    (initial,) = demo_fit.initial_states
    y = predict(demo_fit.structure, values, demo, demo_fit.settings, initial)
    assert np.sum((y - demo.y) ** 2) == pytest.approx(demo_fit.train["velocity"].rss, rel=1e-6)


def test_fit__same_seed__same_numbers(demo):
    structure = PAPER.parse("one_mass+coulomb")
    one, two = (fit(structure, [demo], seed=5, starts=3, level="fast") for _ in range(2))
    assert one == two
    with shared_cores(2):
        assert fit(structure, [demo], seed=5, starts=3, level="fast") == one


def test_fit__fixed_and_bounded_parameters__stay(demo):
    f = fit(RIGID, [demo], bounds={"J1": (0.05, 0.06)}, fixed={"M_G": 0.0}, starts=2, level="fast")
    assert f.estimates["M_G"].value == 0.0
    assert f.estimates["M_G"].std == 0.0
    assert 0.05 <= f.estimates["J1"].value <= 0.06  # the drive has 0.02, so it runs to its low bound
    assert f.estimates["J1"].at_bound == "low"
    assert f.outcome.kind in ("at bound", "not identifiable")
    assert "M_G" not in f.bounds


def test_fit__wrong_names__are_refused(demo):
    with pytest.raises(SettingsError, match="Did you mean 'M_C'"):
        fit(RIGID, [demo], bounds={"m_c": (1.0, 2.0)})


@pytest.mark.parametrize("u", [0.0, 1.0])
def test_fit__standstill__ends_in_an_outcome(u):
    f = fit(RIGID, [still(u)], starts=2, level="fast")
    assert f.outcome.kind != "converged"
    assert f.outcome.text
    assert set(f.estimates) == set(RIGID.parameters)


def test_fit__emps__is_close_to_the_published_values(measured):
    r = read_recording(
        measured("emps/DATA_EMPS.mat"),
        input="vir",
        outputs=["qm:position"],
        time="t",
        input_gain=35.15065,
        units={"vir": "N", "qm": "m"},
    )
    f = fit(RIGID, [r], f_tanh=1000.0, starts=2, level="fast")
    found = {name: e.value for name, e in f.estimates.items()}
    assert found["J1"] == pytest.approx(91.0, abs=1.5)
    assert found["f_v"] == pytest.approx(190.0, abs=6.0)
    assert found["M_C"] == pytest.approx(22.2, abs=0.5)
    assert found["M_G"] == pytest.approx(3.36, abs=0.1)
    assert f.train["qm"].rmse <= 2.65e-3
    assert f.initial_states[0]["v1"] == 0.0


@pytest.mark.long
def test_fit__mte360__needs_the_second_mass(measured):
    r = read_recording(
        measured("mte360/velocity_response_1_5.mat"),
        input="u",
        outputs=["v1:velocity-differenced"],
        time="t",
        units={"u": "V", "v1": "mm/s"},
    )
    # `rigid` is the best of all 64 one-mass structures here. The elastic one has two optima, 88.65 and 87.89 %;
    # few starts reach the better one, so this needs the default number of them.
    rigid = PAPER.parse("one_mass+viscous+stribeck+gravity+current_control+delay")
    elastic = PAPER.parse("two_mass+coulomb+viscous+gravity")
    one, two = (fit(s, [r], level="fast").train["v1"].fit_percent for s in (rigid, elastic))
    assert two > one + 0.3
    assert two > 88.0


@pytest.mark.long
def test_fit__given_start_on_a_motion_that_begins_in_one_direction__is_not_left_for_a_worse_optimum(measured):
    """The first part of the recording, on which descents begin, tells friction and constant load hardly apart."""
    r = read_recording(
        measured("epos/drive2_start_stop_50.csv"),
        input="Torque actual value averaged",
        outputs=["Velocity actual value averaged:velocity"],
        rated={"torque": "9.84 mN m"},
    )
    structure = PAPER.parse("one_mass+coulomb+viscous+stribeck+gravity")
    known = fit(structure, [r], patience=2)
    start = {name: estimate.value for name, estimate in known.estimates.items()}
    start["friction_width"] = known.friction_width.value
    assert fit(structure, [r], start=start, patience=0).cost < 1.001 * known.cost


@pytest.mark.parametrize("estimator", ["least-squares", "pattern-search"])
def test_fit__start_given__the_declared_one_is_tried_beside_it(estimator):
    """The user's may be far off."""
    structure, u = PAPER.parse("one_mass+viscous"), np.sin(np.arange(300) / 20.0)
    (y,) = reference(str(structure), {"J1": 0.02, "f_v": 0.05}, u, 0.002, f_tanh=10.0)
    recording = make_recording(u, y, dt=0.002)
    known = {"starts": 1, "patience": 0, "estimator": estimator}
    alone = fit(structure, [recording], **known).starts[0].start
    tried = fit(structure, [recording], start={"J1": 0.05}, **known).starts
    inertias = {float(f"{s.start['J1']:.6g}") for s in tried}
    assert {0.05, float(f"{alone['J1']:.6g}")} <= inertias


@pytest.mark.parametrize("seed", range(4))
def test_fit__given_start_with_a_gap__is_not_left_for_a_worse_optimum(seed):
    """Descents begin on a short part of the recording there, which may lead away from what is known already."""
    structure, e = PAPER.parse("two_mass+coulomb+backlash+delay"), PAPER_EXPERIMENT
    truth = {"J1": 0.012, "J2": 0.008, "c1": 40.0, "d1": 5e-3, "M_C": 0.1, "alpha": 0.3, "T_d": 3e-3}
    (y,) = reference(str(structure), truth, e.torque(), e.dt, f_tanh=e.f_tanh)
    y += 0.03 * np.abs(y).max() * np.random.default_rng(1).standard_normal(y.size)
    r = make_recording(e.torque(), y, dt=e.dt, names=("torque", "velocity"), name="loose")
    found = fit(structure, [r], f_tanh=e.f_tanh, start=truth, starts=1, patience=0, seed=seed)
    exact = {name: np.array([value]) for name, value in truth.items()}
    assert found.cost <= SimulationErrorProblem.of(structure, [r]).costs(exact, found.settings)[0]


def turning_load(k, kind, noise):
    """Recording of an eccentric load that turns on and on, with noise in parts of the peak, and its parameters."""
    dt, draw = 2e-3, np.random.default_rng(0)
    t = dt * np.arange(5000)
    torque = np.zeros(t.size)
    for start, size in zip(draw.uniform(0.0, 9.0, 14), draw.uniform(-1.0, 2.0, 14), strict=True):
        torque[(t >= start) & (t < start + 1.0)] += size
    truth = {"J1": 0.02, "f_v": 0.03, "M_C": 0.15, "G": 0.3, "k": k, "phi_0": 0.4}
    (y,) = reference(str(TURNING), truth, torque, dt, f_tanh=200.0, outputs=[kind])
    y += noise * np.abs(y).max() * draw.standard_normal(y.size)
    return make_recording(torque, y, dt=dt, kind=kind), truth


# An eccentric load that turns on and on, and cogging.
@pytest.mark.parametrize("k", [1.0, pytest.param(3.0, marks=pytest.mark.long)])
def test_fit__load_with_many_periods_over_the_travel__is_recovered(k):
    recording, truth = turning_load(k, "velocity", 0.01)
    assert np.ptp(np.cumsum(recording.y) * recording.dt) > 20 * 2.0 * np.pi
    found = fit(TURNING, [recording], starts=4, patience=1)
    for name in ("J1", "f_v", "M_C", "G", "k"):
        e = found.estimates[name]
        assert abs(e.value - truth[name]) < 4.0 * e.std, name


@pytest.mark.parametrize("k", [1.0, 3.0])
def test_fit__given_start_of_a_load_over_the_position__is_not_left_for_a_worse_optimum(k):
    """Descents begin on a short part of the recording there, which may lead away from what is known already."""
    recording, truth = turning_load(k, "position", 2e-4)
    found = fit(TURNING, [recording], f_tanh=200.0, start=truth, starts=1, patience=0, initial="rest")
    exact = {name: np.array([value]) for name, value in truth.items()}
    problem = SimulationErrorProblem.of(TURNING, [recording], initial="rest")
    assert found.cost <= problem.costs(exact, found.settings)[0]


@pytest.mark.parametrize(("pole", "batches"), [(0.0, ["all"]), (0.9, ["all", "every fifth", "all"])])
def test_fit__long_slow_motion__later_descents_begin_with_a_part_of_the_samples(monkeypatch, pole, batches):
    module, descended = sys.modules["brightgrey.estimation.fit"], list[int]()

    def counted(function):
        def call(problem, *args, **options):
            descended.append(problem.samples)
            return function(problem, *args, **options)

        return call

    for name in ("multistart", "fit_many"):
        monkeypatch.setattr(module, name, counted(getattr(module, name)))
    structure = Structure.parse("two_mass+viscous")
    values = {"J1": 0.02, "J2": 0.01, "c1": 1.0, "d1": 0.02, "f_v": 0.05}
    t = 1e-3 * np.arange(10_001)
    u = np.sin(2.0 * np.pi * 0.7 * t) + np.sin(2.0 * np.pi * 2.1 * t)
    (v,) = reference(structure, values, u, 1e-3, f_tanh=1e3)
    noise = lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], np.random.default_rng(0).normal(size=v.size))
    recording = make_recording(u, v + 0.02 * v.std() * noise)
    fitted = fit(structure, [recording], starts=4, patience=1)
    assert descended == [{"all": 10_001, "every fifth": 2_001}[part] for part in batches]
    for name, true in values.items():
        estimate = fitted.estimates[name]
        assert abs(estimate.value - true) < 4.0 * estimate.std, name
    spread = np.sqrt((1.0 + pole**2) / (1.0 - pole**2) / (2.0 * v.size))  # of the RMS of such noise
    assert fitted.train["v"].rmse == pytest.approx(0.02 * v.std(), rel=4.0 * spread)
    problem = SimulationErrorProblem.of(structure, [recording])
    for start in fitted.starts:
        ends = {name: np.array([value]) for name, value in start.end.items()}
        assert start.cost == pytest.approx(problem.costs(ends, replace(fitted.settings, level="fast"))[0], rel=1e-9)
