"""Noise of a sensor as a recording shows it: its colour, its size and its rounding."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.fft import irfft, rfft

from brightgrey.arrays import Array
from brightgrey.estimation.noise.autoregression import Autoregression, levinson, noise_models
from brightgrey.estimation.problem.segments import segment_lengths, segments
from brightgrey.kit import Structure
from brightgrey.search import IdentificationTask
from brightgrey.search.fitting.refined_fit import residual_and_jacobian

__all__ = ["SensorNoise", "draw_noise", "sensor_noises"]


@dataclass(frozen=True)
class SensorNoise:
    """Noise of one output of one recording, in SI, and the steps that the output is rounded to."""

    residual: Autoregression  #: Model of the residual: noise and rounding together.
    step: float  #: Resolution of the output.
    offset: float  #: A value of the output that is no rounded one's neighbour but on a step.
    differenced: bool  #: The output is the difference of a rounded position.

    @property
    def before_rounding(self) -> Autoregression:
        """Noise to which rounding adds what the residual has."""
        variance = self.step**2 / 12.0  # of an error that is uniform within a step
        rounding = np.zeros(self.residual.order + 1)
        rounding[0] = variance
        if self.differenced:
            rounding[0] = 2.0 * variance
            rounding[1:2] = -variance
        c = self.residual.autocovariance(rounding.size)
        left = levinson(c - rounding)
        if left is not None:
            return left
        share = max(1.0 - float(rounding[0]) / float(c[0]), 0.0) if c[0] > 0.0 else 0.0
        return Autoregression(self.residual.a, share * self.residual.variance)

    def measure(self, y: Array, rng: np.random.Generator) -> Array:
        """Output as the sensor would give it, shape (samples,).

        Parameters
        ----------
        y : ndarray, shape (samples,)
            Simulated output without noise.
        rng : numpy.random.Generator
        """
        noisy = y + draw_noise(self.before_rounding, y.size, rng)
        if self.differenced:
            steps = np.round(np.cumsum(noisy) / self.step)
            return np.asarray(np.diff(steps, prepend=0.0) * self.step)
        return np.asarray(self.offset + np.round((noisy - self.offset) / self.step) * self.step)


def draw_noise(model: Autoregression, samples: int, rng: np.random.Generator) -> Array:
    """Draw stationary Gaussian noise with the autocovariance of a model, shape (samples,).

    White noise is filtered by the root of the spectrum of a circle that is twice as long (circulant embedding: Dietrich
    and Newsam 1997, doi:10.1137/S1064827592240555).
    """
    c = model.autocovariance(samples + 1)
    circle = np.concatenate([c, c[-2:0:-1]])
    white = rng.standard_normal(circle.size)
    spectrum = np.maximum(rfft(circle).real, 0.0)
    return np.asarray(irfft(np.sqrt(spectrum) * rfft(white), circle.size)[:samples])


def sensor_noises(
    task: IdentificationTask, structure: Structure, values: Mapping[str, float]
) -> tuple[SensorNoise, ...]:
    """Noise of every output of every recording, from the residual of a model.

    Parameters
    ----------
    task : IdentificationTask
    structure : Structure
    values : mapping of str to float
        SI.
    """
    residual, jacobian, inside = residual_and_jacobian(task, structure, values)
    weights = task.problem(structure).weights
    models = noise_models(residual, jacobian[:, list(inside)], segment_lengths(task.recordings))
    return tuple(
        SensorNoise(
            Autoregression(model.a, model.variance / float(weights[part.output]) ** 2),
            float(part.recording.resolution[part.output]),
            float(part.recording.y[part.output, 0]),
            part.recording.outputs[part.output].kind == "velocity-differenced",
        )
        for model, part in zip(models, segments(task.recordings), strict=True)
    )
