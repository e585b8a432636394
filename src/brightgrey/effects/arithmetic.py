"""The functions that laws are written with.

A law is one Python function. In plain Python it runs on floats and arrays; compiled, it runs on floats and on vector
registers. It may use ``+ - * /`` and the functions below; the compiled kernel has implementations of its own for them
(:mod:`brightgrey.simulation.kernel.machine.simd`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["cos", "exp", "magnitude", "negative_part", "positive_part", "sign", "sin", "tanh"]


def exp(z: Any) -> Any:
    """Exponential e^z."""
    return np.exp(z)


def tanh(z: Any) -> Any:
    """Hyperbolic tangent."""
    return np.tanh(z)


def sin(z: Any) -> Any:
    """Sine of an angle in rad."""
    return np.sin(z)


def cos(z: Any) -> Any:
    """Cosine of an angle in rad."""
    return np.cos(z)


def magnitude(z: Any) -> Any:
    """Absolute value |z|."""
    return np.abs(z)


def sign(z: Any) -> Any:
    """1 for z >= 0, else -1: a definite side at standstill."""
    return np.where(np.greater_equal(z, 0.0), 1.0, -1.0)


def positive_part(z: Any) -> Any:
    """max(0, z)."""
    return np.maximum(z, 0.0)


def negative_part(z: Any) -> Any:
    """min(0, z)."""
    return np.minimum(z, 0.0)
