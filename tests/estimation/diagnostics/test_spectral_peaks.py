"""Spectra of a residual by sine tapers."""

import numpy as np
import pytest
from scipy.signal import lfilter

from brightgrey.estimation.diagnostics import spectral_peaks
from brightgrey.estimation.diagnostics.spectral_peaks import highest_peak


@pytest.mark.parametrize("samples", [50, 51, 400])
def test_tapers__from_one_transform__are_those_of_the_tapered_signal(samples):
    """Riedel and Sidorenko (1995): the sine taper of number k."""
    tapers, t = 7, np.arange(1, samples + 1)
    x = np.random.default_rng(0).standard_normal(samples) + 3.0
    line = spectral_peaks._line_spectrum(x)
    frequencies = np.arange(len(line) // 4 + 1)
    waves = np.exp(-2j * np.pi * np.outer(frequencies, t) / (samples + 1))
    sines = [np.sqrt(2.0 / (samples + 1)) * np.sin(np.pi * k * t / (samples + 1)) for k in range(1, tapers + 1)]
    direct = np.array([waves @ ((x - x.mean()) * sine) for sine in sines])
    np.testing.assert_allclose(spectral_peaks._tapered_power(line, tapers), np.mean(np.abs(direct) ** 2, axis=0))
    np.testing.assert_allclose(np.abs(spectral_peaks._tapered(line, 9, tapers)), np.abs(direct[:, 9]), atol=1e-12)


@pytest.fixture
def line():
    """White noise with a line at 37 Hz, sampled at 1 kHz."""
    return np.sin(2.0 * np.pi * 37.0 * 1e-3 * np.arange(4000)) + np.random.default_rng(2).standard_normal(4000)


def test_highest_peak__line_beside_another_input__has_its_frequency_and_is_not_coherent(line):
    found = highest_peak(line, np.random.default_rng(3).standard_normal(line.size), (), 1e-3, 0.01)
    assert found.frequency == pytest.approx(37.0, abs=2.0)
    assert not found.coherent


def test_highest_peak__line_of_the_input__is_none(line):
    assert highest_peak(line, line, (), 1e-3, 0.01) is None


def test_highest_peak__resonance_that_white_input_excites__is_coherent():
    u, omega = np.random.default_rng(4).standard_normal(4000), 2.0 * np.pi * 37.0e-3
    pole = 0.98 * np.exp(1j * omega)
    residual = lfilter([1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], u)
    found = highest_peak(residual, u, (), 1e-3, 0.01)
    assert found.frequency == pytest.approx(37.0, abs=3.0)
    assert found.coherent
