"""Profile likelihood: agreement with the quadratic interval where the cost is a parabola, and its text elsewhere."""

import numpy as np
import pytest

from brightgrey.errors import SettingsError
from brightgrey.estimation import fit
from brightgrey.estimation.profile_likelihood import profile
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

F_TANH = 2.5


def drawn(text, values, noise, seed=0):
    u, dt = PAPER_EXPERIMENT.torque(), PAPER_EXPERIMENT.dt
    y = reference(text, values, u, dt, f_tanh=F_TANH).reshape(-1)
    y = y + noise * np.abs(y).max() * np.random.default_rng(seed).standard_normal(y.shape)
    return make_recording(u, y, dt=dt, names=("torque", "v"), name="drawn")


def test_profile__parabolic_cost__confirms_the_interval():
    r = drawn("one_mass+coulomb+viscous", {"J1": 0.02, "M_C": 0.9, "f_v": 0.02}, 1e-3)
    found = fit(PAPER.parse("one_mass+coulomb+viscous"), [r], f_tanh=F_TANH, starts=2, level="fast")
    for name in ("J1", "M_C"):
        p, quadratic = profile(found, [r], name), found.estimates[name].ci95
        assert p.quadratic, p.text
        assert p.open == ()
        half = 0.5 * (quadratic[1] - quadratic[0])
        np.testing.assert_allclose(p.ci95, quadratic, atol=0.1 * half)
        assert min(p.costs) == pytest.approx(found.cost, rel=1e-6)
        assert np.all(np.diff(p.values) > 0.0)


def test_profile__side_without_a_limit__is_named():
    # A lag far below a sample: nothing tells it from none at all.
    r = drawn("one_mass+coulomb+current_control", {"J1": 0.02, "M_C": 0.9, "T_1": 1e-4}, 2e-2)
    found = fit(PAPER.parse("one_mass+coulomb+current_control"), [r], f_tanh=F_TANH, starts=2, level="fast")
    p = profile(found, [r], "T_1")
    assert p.open == ("low",)
    assert not p.quadratic
    assert "no lower limit" in p.text
    assert p.ci95[1] > 1e-4


def test_profile__parameter_not_estimated__is_refused():
    r = drawn("one_mass+coulomb", {"J1": 0.02, "M_C": 0.9}, 1e-3)
    found = fit(PAPER.parse("one_mass+coulomb"), [r], fixed={"M_C": 0.9}, starts=1, level="fast")
    with pytest.raises(SettingsError, match="J2"):
        profile(found, [r], "J2")
    with pytest.raises(SettingsError, match="M_C"):
        profile(found, [r], "M_C")
