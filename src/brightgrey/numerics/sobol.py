"""Scrambled Sobol sequences, bit for bit those of ``scipy.stats.qmc.Sobol``."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array

__all__ = ["sobol_points"]

_BITS = 30  # of every coordinate
_Bits = NDArray[np.uint32]


def sobol_points(dimensions: int, exponent: int, rng: np.random.Generator) -> Array:
    """Draw 2 ** `exponent` points that fill the unit cube evenly.

    A Sobol sequence with the direction numbers of Joe and Kuo 2008, doi:10.1137/070709359, scrambled by a random linear
    matrix and a random digital shift (Matousek 1998, doi:10.1006/jcom.1998.0489).

    Parameters
    ----------
    dimensions : int
        From 1 to 128.
    exponent : int
        From 0 to 30.
    rng : numpy.random.Generator
        A generator is spawned from it.

    Returns
    -------
    ndarray, shape (2 ** exponent, dimensions)
        From 0 to below 1.
    """
    (own,) = rng.spawn(1)
    falling = np.arange(_BITS - 1, -1, -1, dtype=np.uint32)
    shift = own.integers(0, 2, size=(dimensions, _BITS), dtype=np.uint32) @ (np.uint32(1) << falling[::-1])
    matrices = np.tril(own.integers(0, 2, size=(dimensions, _BITS, _BITS), dtype=np.uint32))
    matrices[:, range(_BITS), range(_BITS)] = 1
    digits = (_direction_numbers()[:dimensions, :, None] >> falling) & 1  # the most significant first
    scrambled = ((digits @ matrices.transpose(0, 2, 1)) & 1) @ (np.uint32(1) << falling)
    number = np.arange(1, 2**exponent)
    lowest_bit = np.log2(number & -number).astype(int)
    points = np.bitwise_xor.accumulate(np.concatenate([shift[None], scrambled[:, lowest_bit].T]))
    return np.asarray(points * 2.0**-_BITS)


@cache
def _direction_numbers() -> _Bits:
    """Direction numbers by dimension and bit, shape (128, bits)."""
    text = files("brightgrey.numerics").joinpath("joe_kuo.txt").read_text(encoding="utf-8")
    rows = [[int(word) for word in line.split()] for line in text.splitlines() if not line.startswith("#")]
    numbers = np.ones((len(rows) + 1, _BITS), np.uint64)
    for v, (polynomial, *first) in zip(numbers[1:], rows, strict=True):
        degree = len(first)
        m = list(first)
        for j in range(degree, _BITS):
            value = m[j - degree]
            for k in range(1, degree + 1):
                if polynomial >> (degree - k) & 1:
                    value ^= m[j - k] << k
            m.append(value)
        v[:] = m
    return (numbers << np.arange(_BITS - 1, -1, -1, dtype=np.uint64)).astype(np.uint32)
