"""A recording under examination: what several checks need of it, computed once."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache, cached_property
from math import factorial

import numpy as np

from brightgrey.arrays import Array
from brightgrey.recordings.recording import Recording
from brightgrey.recordings.sample_values import difference_noise, is_constant, resolution
from brightgrey.recordings.units.signals import KINDS
from brightgrey.recordings.window import decimate

__all__ = ["Examined", "SmoothedMotion", "noise_of"]


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    reach: float = 4.0
    """Standard deviations at which a Gaussian kernel is cut off."""
    many: int = 30_000
    """Samples from the double of which a recording is decimated before it is smoothed."""
    enough: int = 3000
    """Samples of a smoothed motion that are kept, about."""
    clean: float = 0.01
    """Part of noise in the variance of an acceleration that is smoothed enough."""


POLICY = _Policy()


def noise_of(x: Array) -> float:
    """Standard deviation of the noise of a signal, from its third differences, in which a smooth motion is small.

    It is a median, so that jumps do not count, and at least what rounding to the signal's resolution makes.
    """
    noise = float(difference_noise(x, 3)) if x.size > 3 else 0.0
    return float(max(noise, resolution(x) / np.sqrt(12.0)))


@dataclass(frozen=True)
class SmoothedMotion:
    """Smoothed motion and input, without the ends at which a smoothing kernel lacks samples."""

    t: Array  #: s, shape (samples,).
    u: Array  #: SI.
    position: Array  #: From an arbitrary zero if it is summed up.
    velocity: Array
    acceleration: Array
    width: float  #: Standard deviation of the kernel in samples.
    clean: bool  #: The acceleration is free of noise but for a hundredth of its variance.


@dataclass(frozen=True)
class Examined:
    """A recording under examination."""

    recording: Recording
    _smoothed: dict[tuple[int, float], SmoothedMotion] = field(default_factory=dict, repr=False)

    @property
    def dt(self) -> float:
        """Sampling interval in s."""
        return self.recording.dt

    @cached_property
    def coarse(self) -> Examined:
        """The same with so few samples that all widths of smoothing take a second or two."""
        factor = self.recording.samples // POLICY.many
        return Examined(decimate(self.recording, factor)) if factor > 1 else self

    @cached_property
    def steps(self) -> tuple[float, ...]:
        """Steps of the resolution of the input and of each output, SI."""
        return (resolution(self.recording.u), *self.recording.resolution.tolist())

    @cached_property
    def noise(self) -> tuple[float, ...]:
        """Standard deviation of the noise of each output, SI."""
        return tuple(max(noise_of(y), 1e-300) for y in self.recording.y)

    @cached_property
    def moves(self) -> bool:
        """True if input and first output change."""
        r = self.recording
        return not (is_constant(r.u) or is_constant(r.y[0]))

    def smooth(self, x: Array, width: float, order: int = 0) -> Array:
        """Derivative of a signal, smoothed by a Gaussian kernel, without the ends.

        Parameters
        ----------
        x : ndarray, shape (samples,)
        width : float
            Standard deviation of the kernel in samples.
        order : int
            Of the derivative.
        """
        kernel = _kernel(width, order) / self.dt**order
        size = 1 << (x.size + kernel.size).bit_length()
        level = float(x.mean())  # without it, rounding would grow with the derivative
        whole = np.fft.irfft(np.fft.rfft(x - level, size) * np.fft.rfft(kernel, size), size)
        return np.asarray(whole[kernel.size - 1 : x.size] + (level if order == 0 else 0.0))

    @cached_property
    def widths(self) -> tuple[float, ...]:
        """Standard deviations of kernels that the recording has room for, in samples, each the double of the last."""
        most = self.recording.samples / 40.0
        return tuple(2.0**k for k in range(1, 20) if 2.0**k <= most) or (2.0,)

    def motions(self) -> list[SmoothedMotion]:
        """Motion by the first output, smoothed by all kernels from the narrowest that leaves it clean."""
        first = self.motion()
        if first is None:
            return []
        return [self.motion_smoothed(0, width) for width in self.widths if width >= first.width]

    def motion(self, output: int = 0) -> SmoothedMotion | None:
        """Motion by an output, smoothed as little as its noise allows; None if it has no sign or does not change."""
        if self.recording.outputs[output].kind == "speed" or is_constant(self.recording.y[output]):
            return None
        for width in self.widths:
            found = self.motion_smoothed(output, width)
            if found.clean:
                return found
        return found

    def motion_smoothed(self, output: int, width: float) -> SmoothedMotion:
        """Motion by an output, smoothed by a kernel of a width in samples."""
        if (output, width) not in self._smoothed:
            self._smoothed[output, width] = self._motion(output, width)
        return self._smoothed[output, width]

    def is_clean(self, x: Array, noise: float, width: float) -> bool:
        """True if a kernel takes noise of a standard deviation off the slope of a signal."""
        power = noise**2 / (4.0 * np.sqrt(np.pi) * width**3 * self.dt**2)
        return bool(power < POLICY.clean * float(np.var(self.smooth(x, width, 1))))

    def higher(self, motion: SmoothedMotion, order: int) -> tuple[Array, Array]:
        """Derivatives of the input and of the acceleration by the first output, at the instants of a motion."""
        r, thin = self.recording, self._thinned(motion.width)
        kind = KINDS[r.outputs[0].kind]
        u = self.smooth(r.u, motion.width, order)
        return u[thin], self.smooth(r.y[0], motion.width, order + 2 - kind)[thin]

    def _thinned(self, width: float) -> slice:
        """Samples that are kept after smoothing: neighbours say the same, and a few thousand are enough."""
        return slice(None, None, max(1, int(width / 2.0), self.recording.samples // POLICY.enough))

    def _motion(self, output: int, width: float) -> SmoothedMotion:
        r, dt = self.recording, self.dt
        order = KINDS[r.outputs[output].kind]
        y = r.y[output]
        summed = [y]  # the signal and its integrals
        for _ in range(order):
            mid = 0.5 * (summed[-1][1:] + summed[-1][:-1])
            summed.append(np.concatenate([[0.0], np.cumsum(mid) * dt]))
        by_order = [self.smooth(x, width) for x in reversed(summed)]
        by_order += [self.smooth(y, width, k) for k in range(1, 3 - order)]
        position, velocity, acceleration = by_order
        kernel = _kernel(width, 2 - order) / dt ** (2 - order)
        error = self.noise[output] ** 2 * float(np.square(kernel).sum())
        clean = error <= POLICY.clean * float(np.var(acceleration))
        cut = _kernel_reach(width)
        thin = self._thinned(width)
        t = r.t[cut : r.samples - cut]
        u = self.smooth(r.u, width)
        return SmoothedMotion(t[thin], u[thin], position[thin], velocity[thin], acceleration[thin], width, clean)


def _kernel_reach(width: float) -> int:
    """Samples at either end that smoothing leaves out."""
    return int(POLICY.reach * width + 0.5)


@cache
def _kernel(width: float, order: int) -> Array:
    """Derivative of a Gaussian kernel by samples, shape (2 reach + 1,).

    It is the Gaussian times its orthogonal polynomial on the samples, which is exact for polynomials up to the order. A
    sampled derivative is not: its second one leaves a part of the signal itself, which over dt² is more than the
    acceleration.
    """
    x = np.arange(-_kernel_reach(width), _kernel_reach(width) + 1.0)
    root = np.exp(-0.25 * np.square(x / width))
    orthogonal = np.linalg.qr(root[:, None] * np.vander(x / width, order + 1, increasing=True))[0][:, -1]
    kernel = root * orthogonal
    return np.asarray(kernel * factorial(order) / float(kernel @ (-x) ** order))
