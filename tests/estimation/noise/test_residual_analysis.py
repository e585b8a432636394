"""Residual analysis: what white and coloured residuals and those that follow the input look like."""

import numpy as np
import pytest
from scipy.signal import lfilter

from brightgrey.errors import SettingsError
from brightgrey.estimation.noise.residual_analysis import residual_analysis

SAMPLES = 2000


def draws(pole, seed):
    rng = np.random.default_rng(seed)
    e = lfilter([1.0], [1.0, -pole], rng.standard_normal(SAMPLES + 500))[500:]
    u = lfilter([1.0], [1.0, -0.95], rng.standard_normal(SAMPLES + 500))[500:]
    return e, u


def test_residual_analysis__white_residuals__are_accepted_at_the_level():
    found = [residual_analysis(*draws(0.0, seed)) for seed in range(100)]
    # 5 % are called coloured: beyond 13 of 100 once in a thousand.
    assert sum(not r.white for r in found) <= 13
    assert sum(r.follows_input for r in found) <= 13
    outside = np.mean([np.abs(r.autocorrelation[1:]) > r.band for r in found])
    assert outside == pytest.approx(0.05, abs=0.015)


def test_residual_analysis__coloured__stay_within_bartletts_band():
    found = [residual_analysis(*draws(0.9, seed)) for seed in range(200)]
    outside = np.mean([np.abs(r.cross_correlation) > r.cross_band for r in found])
    assert outside == pytest.approx(0.05, abs=0.025)
    assert not any(r.white for r in found)


def test_residual_analysis__coloured__fewer_effective_samples():
    found = np.median([residual_analysis(*draws(0.9, seed)).effective_samples for seed in range(20)])
    assert found == pytest.approx(SAMPLES * 0.1 / 1.9, rel=0.15)


def test_residual_analysis__delayed_input__correlates_at_its_lag():
    e, u = draws(0.0, 1)
    u = np.diff(u, prepend=0.0)
    late = e + 0.5 * np.std(e) / np.std(u) * np.roll(u, 7)
    found = residual_analysis(late, u)
    assert int(np.argmax(found.cross_correlation)) - 50 == 7
    assert found.follows_input


def test_residual_analysis__autocorrelation__agrees_with_its_definition():
    e, u = draws(0.5, 3)
    found = residual_analysis(e, u, lags=5)
    about = e - e.mean()
    expected = [about[: SAMPLES - k] @ about[k:] / (about @ about) for k in range(6)]
    np.testing.assert_allclose(found.autocorrelation, expected, atol=1e-12)


def test_residual_analysis__constant_signals__correlate_with_nothing():
    e, u = draws(0.0, 1)
    still = residual_analysis(e, 0 * u + 3.0)
    assert not still.follows_input
    perfect = residual_analysis(0 * e, u)
    assert perfect.white
    assert perfect.effective_samples == SAMPLES


def test_residual_analysis__wrong_arguments__are_refused():
    e, u = draws(0.0, 1)
    with pytest.raises(SettingsError, match="do not fit"):
        residual_analysis(e, u[1:])
    with pytest.raises(SettingsError, match="lags"):
        residual_analysis(e, u, lags=SAMPLES)
