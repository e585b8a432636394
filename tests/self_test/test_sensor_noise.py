"""Noise of simulated sensors against the statistics that it is to have."""

import numpy as np
import pytest

from brightgrey.api.to_si import identification_task
from brightgrey.estimation.noise.autoregression import Autoregression, levinson
from brightgrey.kit import PAPER
from brightgrey.self_test.sensor_noise import SensorNoise, draw_noise, sensor_noises
from support.recordings import make_recording

SAMPLES, DRAWS = 2000, 60
LAGS = 4


def lagged_products(x):
    """Sample autocovariances about the known mean 0, shape (LAGS,)."""
    return np.array([x[: x.size - k] @ x[k:] / (x.size - k) for k in range(LAGS)])


def assert_autocovariance(noises, expected, lags=LAGS):
    """Compare the mean over independent draws; a normal error is below five standard errors in all but 6e-7 of them."""
    found = np.array([lagged_products(x) for x in noises])[:, :lags]
    error = found.mean(axis=0) - expected[:lags]
    assert np.all(np.abs(error) < 5.0 * found.std(axis=0, ddof=1) / np.sqrt(len(found)))


@pytest.mark.parametrize("a", [(1.0,), (1.0, -0.9), (1.0, -1.6, 0.8)])
def test_draw_noise__autoregression__has_its_autocovariance(a):
    model, rng = Autoregression(a, 0.3), np.random.default_rng(1)
    assert_autocovariance([draw_noise(model, SAMPLES, rng) for _ in range(DRAWS)], model.autocovariance(LAGS))


def test_draw_noise__no_variance__is_zero():
    assert not draw_noise(Autoregression((1.0, -0.5), 0.0), 50, np.random.default_rng(1)).any()


@pytest.mark.parametrize("step", [0.01, 1.0, 2.0])  # up to two standard deviations rounding errors are uniform
def test_measure__rounded_output__residual_is_that_of_the_recording_and_values_are_on_the_lattice(step):
    c = Autoregression((1.0, -0.8), 1.0 - 0.64).autocovariance(3 * LAGS)
    c[0] += step**2 / 12.0
    residual = levinson(c)
    noise, rng = SensorNoise(residual, step, 0.3, differenced=False), np.random.default_rng(2)
    y = 50.0 * np.sin(0.01 * np.arange(SAMPLES))
    made = [noise.measure(y, rng) for _ in range(DRAWS)]
    counts = (np.array(made) - 0.3) / step
    assert np.abs(counts - np.rint(counts)).max() < 1e-9 * np.abs(counts).max()
    assert_autocovariance([x - y for x in made], c)


def test_measure__differenced_output__has_the_colour_of_a_difference():
    step = 1.0
    c = np.array([0.5 + step**2 / 6.0, -(step**2) / 12.0])  # white noise, and the difference of rounded positions
    residual = levinson(c)
    noise, rng = SensorNoise(residual, step, 0.0, differenced=True), np.random.default_rng(3)
    y = 7.3 * np.sin(0.01 * np.arange(SAMPLES))
    made = [noise.measure(y, rng) for _ in range(DRAWS)]
    assert np.array_equal(made, np.rint(made))
    assert_autocovariance([x - y for x in made], c, lags=2)


def test_measure__residual_is_nothing_but_rounding__adds_no_noise():
    noise = SensorNoise(Autoregression((1.0,), 0.9 / 12.0), 1.0, 0.0, differenced=False)
    y = np.linspace(0.0, 40.0, 100)
    assert np.array_equal(noise.measure(y, np.random.default_rng(0)), np.round(y))


def test_sensor_noises__of_a_recording__has_its_size_colour_and_step():
    rng, step = np.random.default_rng(4), 0.01
    u = np.sign(np.sin(2.0 * np.pi * 2.0 * 1e-3 * np.arange(SAMPLES)))
    v = np.cumsum(u) * 1e-3 / 0.02
    true = Autoregression((1.0, -0.9), (1.0 - 0.81) * 0.2**2)
    recording = make_recording(u, step * np.round((v + draw_noise(true, SAMPLES, rng)) / step))
    structure = PAPER.parse("one_mass")
    task = identification_task([recording], structure, {}, {}, None)
    (noise,) = sensor_noises(task, structure, {"J1": 0.02})
    assert noise.step == pytest.approx(step)
    # The variance of 2000 samples with pole 0.9 is that of 2000 / (1 + 2 * 0.81 / 0.19) = 210 independent ones:
    # it scatters by sqrt(2 / 210) = 10 %, here five times that.
    assert noise.residual.autocovariance(1)[0] == pytest.approx(0.2**2, rel=0.5)
    c = noise.residual.autocovariance(2)
    # The pole scatters by sqrt((1 - 0.81) / 2000) = 0.01; five times that.
    assert c[1] / c[0] == pytest.approx(0.9, abs=0.05)
