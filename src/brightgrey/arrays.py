"""Types of numpy arrays by their content, and division and logarithms that are safe at zero."""

from __future__ import annotations

from typing import overload

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array", "Complex", "Indices", "log_ratio", "positive"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Indices = NDArray[np.intp]

_SMALLEST = 1e-300  # far above the smallest float, so that its inverse is finite


@overload
def positive(x: float) -> float: ...
@overload
def positive(x: Array) -> Array: ...
def positive(x: float | Array) -> float | Array:
    """Return `x`, raised to 1e-300 where it is smaller, so that it has a finite inverse and a logarithm."""
    return np.maximum(x, _SMALLEST) if isinstance(x, np.ndarray) else max(float(x), _SMALLEST)


def log_ratio(a: float, b: float) -> float:
    """Natural logarithm of ``a / b`` for two numbers that are not negative; finite if one of them is zero."""
    return float(np.log(positive(a) / positive(b)))
