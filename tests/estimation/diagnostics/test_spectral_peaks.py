"""Spectra of a residual by sine tapers."""

import numpy as np
import pytest

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


def test_highest_peak__line_in_noise__has_its_frequency_and_is_coherent_with_the_input():
    rng, t = np.random.default_rng(2), 1e-3 * np.arange(4000)
    u = np.sin(2.0 * np.pi * 37.0 * t) + rng.standard_normal(t.size)
    residual = np.sin(2.0 * np.pi * 37.0 * t + 0.4) + rng.standard_normal(t.size)
    found = highest_peak(residual, rng.standard_normal(t.size), (), 1e-3, 0.01)
    assert found.frequency == pytest.approx(37.0, abs=2.0)
    assert not found.coherent
    assert highest_peak(residual, u, (), 1e-3, 0.01) is None  # the input has the same line
