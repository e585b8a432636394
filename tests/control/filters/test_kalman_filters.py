"""Kalman filters: state transition, consistency of the innovations, estimated states."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.stats import chi2

from brightgrey.control.filters.discretisation import ElementBatch, matrix_exponential, propagate_states
from brightgrey.control.filters.extended_kalman import Noise, extended_kalman_filter
from brightgrey.control.filters.gaussian_sum import gaussian_sum_filter
from brightgrey.control.filters.setup import estimate_noise, prepare, shaft_torque
from brightgrey.control.filters.state_transition import ProcessModel
from brightgrey.control.filters.unscented_kalman import unscented_kalman_filter
from brightgrey.control.linear.twist_coordinates import to_twist_coordinates
from brightgrey.kit import Structure, assemble
from brightgrey.recordings import Signal
from brightgrey.simulation import response
from brightgrey.simulation.reference import reference
from support.drives import SETTINGS, VALUES, E, recorded, system_of, values_of
from support.recordings import make_recording

FULL = "two_mass+coulomb+viscous+stribeck+gravity+backlash+current_control+delay"


def test_matrix_exponential__agrees_with_scipy():
    M = np.random.default_rng(0).normal(size=(4, 5, 5)) * np.array([0.1, 1.0, 10.0, 100.0])[:, None, None]
    for mine, matrix in zip(matrix_exponential(M), M, strict=True):
        exact = expm(matrix)
        assert_allclose(mine, exact, atol=1e-9 * np.abs(exact).max())


def simulate_by_transitions(text, u, hold, **changed):
    """First output by the transitions of the filter from rest, and by the reference solver."""
    structure, values = Structure.parse(text), values_of(text, **changed)
    recording = make_recording(u, 0.01 * u, dt=E.dt, names=("torque", "velocity"), hold=hold)
    prepared = prepare(structure, values, recording, SETTINGS)
    filter_input, process = prepared.filter_input, ProcessModel.of(prepared.filter_input)
    at_rest = system_of(text, **changed).rest(0.0, 0.0, float(u[0]))[None]
    x, _ = process.augment(
        at_rest @ prepared.twist_model.W.T, filter_input.P0, np.zeros(1), filter_input.system.state_names.index("v1")
    )
    y = [process.predict_outputs(0, x)[0][0, 0]]
    for k in range(len(u) - 1):
        x = process.transition(k, x).x
        y.append(process.predict_outputs(k + 1, x)[0][0, 0])
    return np.array(y), reference(structure, values, u, E.dt, f_tanh=E.f_tanh, hold=hold)[0]


@pytest.mark.parametrize("text", ["two_mass+coulomb+viscous+stribeck+gravity+current_control", FULL])
def test_transition__non_linear_drive__agrees_with_reference_solver(text):
    mine, exact = simulate_by_transitions(text, E.torque()[:900], "linear")
    assert np.abs(mine - exact).max() < 2e-3 * np.abs(exact).max()


@pytest.mark.parametrize("hold", ["linear", "zoh"])
@pytest.mark.parametrize("samples", [0.3, 1.0, 1.6, 2.0])
def test_transition__fractional_dead_time__is_exact(hold, samples):
    u = np.random.default_rng(3).normal(size=60)
    mine, exact = simulate_by_transitions("one_mass+viscous+current_control+delay", u, hold, T_d=samples * E.dt)
    assert np.abs(mine - exact).max() < 1e-9 * np.abs(exact).max()


def test_propagate_states__derivatives__agree_with_differences():
    system = to_twist_coordinates(system_of("two_mass+coulomb+viscous+stribeck+current_control")).system
    lanes = ElementBatch.of(system)
    z, u = np.array([[0.01, 0.3, 0.1, 1.0]]), np.array([2.0])
    step = propagate_states(lanes, z, u, u, E.dt, np.full(1, np.inf))
    size = 1e-6
    for i in range(4):
        moved = propagate_states(lanes, z + size * np.eye(4)[i], u, u, E.dt, np.full(1, np.inf)).z - step.z
        assert_allclose(moved[0] / size, step.by_state[0, :, i], atol=1e-2 * np.abs(step.by_state).max())
    moved = propagate_states(lanes, z, u + size, u + size, E.dt, np.full(1, np.inf)).z - step.z
    assert_allclose(moved[0] / size, step.by_input[0], rtol=1e-2, atol=1e-6)


def test_propagate_states__batch__equals_single_sets():
    system = to_twist_coordinates(system_of(FULL)).system
    z = np.random.default_rng(1).normal(size=(5, len(system.states))) * 0.01
    u = np.linspace(-5.0, 5.0, 5)
    together = propagate_states(ElementBatch.of(system, 5), z, u, u, 1e-3, np.full(5, 1e-5))
    alone = [
        propagate_states(ElementBatch.of(system), z[i : i + 1], u[i : i + 1], u[i : i + 1], 1e-3, np.full(1, 1e-5))
        for i in range(5)
    ]
    for whole, *parts in zip(together, *alone, strict=True):
        assert_allclose(whole, np.concatenate(parts), rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("run", [extended_kalman_filter, unscented_kalman_filter])
def test_kalman_filters__true_model__have_consistent_innovations(run):
    """One recording inside a band that a right filter leaves once in 10,000 times."""
    text, torque = "two_mass+coulomb+viscous+stribeck", 0.05
    recording = recorded(text, 4, torque=torque)
    prepared = prepare(Structure.parse(text), values_of(text), recording, SETTINGS)
    found = run(prepared.filter_input, Noise(torque, np.array([0.02])))
    low, high = chi2.ppf([5e-5, 1 - 5e-5], recording.samples)
    assert low < found.nis.sum() < high


EXACT = replace(SETTINGS, f_tanh=math.inf)


@pytest.mark.parametrize(
    ("text", "run", "seeds"),
    [
        ("two_mass+coulomb+viscous+stribeck+gravity", extended_kalman_filter, 2),
        ("two_mass+coulomb+viscous+stribeck+gravity", unscented_kalman_filter, 1),
        pytest.param("two_mass+coulomb+viscous+backlash", gaussian_sum_filter, 1, marks=pytest.mark.long),
    ],
)
def test_filters__exact_friction__are_consistent_in_reversals_and_at_rest(text, run, seeds):
    """A right filter leaves such a band once in 10,000 times."""
    torque, noise = 0.05, np.array([0.02])
    still, moving = np.zeros(2), np.zeros(2)
    for seed in range(seeds):
        recording = recorded(text, seed, torque=torque, f_tanh=math.inf)
        prepared = prepare(Structure.parse(text), values_of(text), recording, EXACT)
        found = run(prepared.filter_input, Noise(torque, noise))
        slow = np.abs(recording.y[0]) < 0.1
        near = np.convolve(slow, np.ones(7), mode="same") > 0.0  # rest and reversals, and three samples around them
        for total, samples in ((still, near), (moving, ~near)):
            total += found.nis[samples].sum(), np.count_nonzero(samples)
    for total, samples in (still, moving):
        low, high = chi2.ppf([5e-5, 1 - 5e-5], samples)
        assert low < total < high


def test_extended_filter__exact_friction_at_rest__does_not_drift():
    """Under 0.9 of breakaway the estimated speed stays within the noise, and the variance is bounded."""
    values = values_of("one_mass+coulomb")
    y = 0.02 * np.random.default_rng(1).normal(size=400)
    recording = make_recording(np.full(400, 0.9 * values["M_C"]), y)
    filter_input = prepare(Structure.parse("one_mass+coulomb"), values, recording, EXACT).filter_input
    found = extended_kalman_filter(filter_input, Noise(0.05, np.array([0.02])))
    assert np.abs(found.z[20:, 0, 0]).max() < 0.01
    assert found.std[20:, 0, 0].max() < 0.01


@pytest.mark.parametrize("text", ["two_mass+viscous+current_control+delay", "two_mass+viscous+delay"])
@pytest.mark.parametrize("kind", ["velocity", "acceleration"])
def test_extended_filter__delayed_or_direct_disturbance__is_consistent(text, kind):
    """A light motor, whose innovations are the disturbance: eight drives' sum in its band."""
    structure, values = Structure.parse(text), values_of(text, J1=0.0004, T_d=1.6e-3)
    system, size = assemble(structure, values, E.f_tanh, (kind,)), 0.02 if kind == "velocity" else 2.0
    total = 0.0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        u = E.torque()[:500]
        pushed = u + 0.05 * rng.normal(size=500)
        y = response(system, pushed, E.dt, system.rest(), replace(SETTINGS, hold="zoh")).y[0, :, 0]
        y = y + size * rng.normal(size=500)
        recording = make_recording(u, y, dt=E.dt, kind=kind, hold="zoh")
        filter_input = prepare(structure, values, recording, SETTINGS).filter_input
        total += float(extended_kalman_filter(filter_input, Noise(0.05, np.array([size]))).nis.sum())
    low, high = chi2.ppf([5e-5, 1 - 5e-5], 2000)
    assert low < total < high


@pytest.mark.long
def test_gaussian_sum__unknown_gap_position__is_consistent():
    text = "two_mass+coulomb+viscous+backlash"
    structure, values = Structure.parse(text), values_of(text, alpha=0.2, c1=700.0, d1=0.1)
    system = assemble(structure, values, E.f_tanh)
    u, totals = E.torque()[:400], []
    for seed in range(2):
        rng = np.random.default_rng(seed)
        x0 = system.rest()
        x0[system.state_names.index("lambda1")] = at = -0.4 * rng.random()
        x0[system.state_names.index("q2")] = -at
        pushed = u + 0.05 * rng.normal(size=len(u))
        y = response(system, pushed, E.dt, x0, replace(SETTINGS, hold="zoh")).y[0, :, 0]
        y = y + 0.02 * rng.normal(size=len(u))
        recording = make_recording(u, y, dt=E.dt, hold="zoh")
        filter_input = prepare(structure, values, recording, SETTINGS).filter_input
        totals.append(float(gaussian_sum_filter(filter_input, Noise(0.05, np.array([0.02]))).nis.sum()))
    low, high = chi2.ppf([5e-5, 1 - 5e-5], len(u))
    assert all(low < total < high for total in totals)


def test_gaussian_sum__without_gap__is_the_extended_filter():
    text = "two_mass+coulomb+viscous"
    filter_input = prepare(Structure.parse(text), values_of(text), recorded(text, 2), SETTINGS).filter_input
    noise = Noise(0.05, np.array([0.02]))
    assert_allclose(
        gaussian_sum_filter(filter_input, noise).z, extended_kalman_filter(filter_input, noise).z, rtol=0.0, atol=0.0
    )


def test_propagate_states__nearly_closed_contact__stays_closed():
    system = to_twist_coordinates(system_of(FULL, alpha=1e-4, c1=1700.0, d1=0.1)).system
    names, lanes = system.state_names, ElementBatch.of(system)
    z = np.zeros((1, len(names)))
    z[0, names.index("twist1")] = -3.8e-3
    u, tolerance = np.zeros(1), np.full(1, 1e-3)
    after = []
    for off in (0.0, 1e-15):
        z[0, names.index("lambda1")] = -2e-4 + off
        after.append(propagate_states(lanes, z, u, u, 1e-3, tolerance).z)
    assert_allclose(after[1], after[0], rtol=1e-6, atol=1e-9)


def test_gaussian_sum__speed_only__estimates_load_gap_and_shaft_torque():
    text = "two_mass+coulomb+viscous+backlash"
    recording = recorded(text, 2)
    hidden = reference(
        text, values_of(text), recording.u, recording.dt, f_tanh=E.f_tanh, outputs=("v2", "lambda1", "q1", "q2", "v1")
    )
    v2, gap, q1, q2, v1 = hidden
    prepared = prepare(Structure.parse(text), values_of(text), recording, SETTINGS)
    found = gaussian_sum_filter(prepared.filter_input, Noise(1e-3, np.array([0.02])))
    names = prepared.filter_input.system.state_names
    settled = slice(len(v2) // 3, None)
    assert np.sqrt(np.mean((found.z[settled, 0, names.index("v2")] - v2[settled]) ** 2)) < 0.02 * np.abs(v2).max()
    assert np.sqrt(np.mean((found.z[settled, 0, names.index("lambda1")] - gap[settled]) ** 2)) < 0.1 * VALUES["alpha"]
    wound = VALUES["c1"] * (q1 - q2 - gap)
    rates = np.gradient(q1 - q2 - gap, recording.dt)
    torque = shaft_torque(prepared.filter_input.system, found.most_likely[:, 0])
    exact = wound + VALUES["d1"] * rates
    assert np.sqrt(np.mean((torque - exact)[settled] ** 2)) < 0.05 * np.abs(exact).max()
    assert np.abs(v1).max() > 1.0


def test_extended_filter__differenced_velocity__is_modelled():
    text = "one_mass+coulomb+viscous"
    plain = recorded(text, 1, noise=0.0)
    q = reference(text, values_of(text), plain.u, plain.dt, f_tanh=E.f_tanh, outputs=("position",))[0]
    y = np.diff(q, prepend=q[0]) / plain.dt
    recording = replace(plain, y=y[None], outputs=(Signal("velocity", "velocity-differenced", "rad/s"),))
    found = []
    for watched in (recording, replace(recording, outputs=(Signal("velocity", "velocity", "rad/s"),))):
        prepared = prepare(Structure.parse(text), values_of(text), watched, SETTINGS)
        found.append(
            float(
                np.abs(extended_kalman_filter(prepared.filter_input, Noise(1e-3, np.array([0.02]))).innovations).max()
            )
        )
    assert found[0] < 0.02 * found[1]


def test_estimate_noise__simulated_recording__finds_both_levels():
    text = "one_mass+coulomb+viscous"
    found = estimate_noise(Structure.parse(text), values_of(text), recorded(text, 7, torque=0.1), SETTINGS)
    assert found.outputs[0] == pytest.approx(0.02, rel=0.3)
    assert found.torque == pytest.approx(0.1, rel=0.5)
