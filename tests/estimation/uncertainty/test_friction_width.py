"""Width of friction's reversal: a width that is there is found, an exact sign is as sharp as can be shown."""

import numpy as np
import pytest

from brightgrey.estimation import fit, profile
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER
from brightgrey.recordings import Units
from brightgrey.report.text.tables import friction_width_text
from brightgrey.simulation.reference import reference
from support.models import make_model
from support.recordings import make_recording

STRUCTURE = PAPER.parse("one_mass+coulomb+viscous")
TRUTH = {"J1": 0.02, "M_C": 0.9, "f_v": 0.015}


def recording(f_tanh):
    """The paper's excitation, noise of 0.1 % of the peak, rounded."""
    e = PAPER_EXPERIMENT
    u = e.torque()[:1000]
    v = reference(str(STRUCTURE), TRUTH, u, e.dt, f_tanh=f_tanh)[0]
    noise = 1e-3 * np.abs(v).max() * np.random.default_rng(4).standard_normal(v.size)
    return make_recording(u, np.round(v + noise, 3), dt=e.dt)


@pytest.fixture(scope="module")
def smooth():
    return recording(2.5)


def test_fit__friction_reverses_within_a_width__finds_it_within_its_interval(smooth):
    found = fit(STRUCTURE, [smooth], patience=0)
    low, high = found.friction_width.ci95
    assert low < 0.4 < high
    assert high / low < 1.5
    assert found.settings.f_tanh == pytest.approx(1.0 / found.friction_width.value)
    for name, truth in TRUTH.items():
        assert abs(found.estimates[name].value - truth) < 4.0 * found.estimates[name].std, name


def test_fit__friction_reverses_at_once__is_as_sharp_as_the_recording_can_show():
    found = fit(STRUCTURE, [recording(np.inf)], patience=0)
    assert found.friction_width.is_sharp
    assert 0.0 < found.friction_width.ci95[1] < 0.2
    assert found.settings.f_tanh == np.inf
    assert found.friction_width.value == 0.0
    for name, truth in TRUTH.items():
        assert abs(found.estimates[name].value - truth) < 4.0 * found.estimates[name].std, name


def test_fit__friction_reverses_at_once_and_no_noise__is_as_sharp_as_can_be():
    """The sharpest width makes an error of its own, far below what a sensor shows."""
    e = PAPER_EXPERIMENT
    u = e.torque()[:1000]
    v = reference(str(STRUCTURE), TRUTH, u, e.dt, f_tanh=np.inf)[0]
    assert fit(STRUCTURE, [make_recording(u, v, dt=e.dt)], patience=0).friction_width.is_sharp


def test_fit__mass_that_would_stick_if_friction_reversed_at_once__keeps_the_sharpest_width():
    """It creeps through the peak of Stribeck friction, which is lower than the friction at rest."""
    structure, dt, speed = PAPER.parse("one_mass+coulomb+viscous+stribeck"), 1e-3, 47.5
    truth = {"J1": 0.002, "M_C": 0.3, "f_v": 0.02, "M_S": 1.0, "omega_S": 1.1e-3 * speed}
    u = 1.25 * np.sign(np.sin(2.0 * np.pi * 1.3 * dt * np.arange(2000) + 0.1))  # 1.3 would break it away
    v = reference(str(structure), truth, u, dt, f_tanh=1e4 / speed)[0]
    noise = 1e-3 * np.abs(v).max() * np.random.default_rng(4).standard_normal(v.size)
    found = fit(structure, [make_recording(u, np.round(v + noise, 3), dt=dt)], start=truth, patience=0)
    assert not found.friction_width.is_sharp
    assert np.isfinite(found.settings.f_tanh)
    assert found.train["v"].fit_percent > 99.0


def test_fit__gain_is_given__estimates_no_width(smooth):
    found = fit(STRUCTURE, [smooth], f_tanh=2.5, patience=0)
    assert found.friction_width is None
    assert found.settings.f_tanh == 2.5


def test_fit__nothing_reverses__estimates_no_width(smooth):
    assert fit(PAPER.parse("one_mass+viscous"), [smooth], patience=0).friction_width is None


def test_profile__width_is_estimated__is_fitted_again_with_it(smooth):
    found = fit(STRUCTURE, [smooth], patience=0)
    low, high = profile(found, [smooth], "M_C").ci95
    assert low < TRUTH["M_C"] < high


@pytest.mark.parametrize(
    ("interval", "words"),
    [
        (None, "within 0.400 rad/s (given)"),
        ((0.0, 0.02), "as sharply as this recording can show: within less than 0.020 rad/s"),
        ((0.38, 0.42), "within 0.400 rad/s (0.380 … 0.420)"),
        ((0.38, None), "within 0.38 rad/s or more: this recording gives no upper limit"),
        ((0.0, None), "within a speed that this recording does not tell"),
    ],
)
def test_text__every_case__says_what_is_known(interval, words):
    model = make_model(
        "one_mass",
        {"J1": {"value": 1.0, "unit": "kg m²", "std": None, "ci95": None, "at_bound": None}},
        [("velocity", "velocity", "rad/s")],
        Units("N m", "rad"),
        dt=1e-3,
        f_tanh=2.5,
        speed=40.0,
    )
    settings = model.settings.model_copy(update={"friction_width_ci95": interval})
    assert friction_width_text(settings) == words
