"""Elementary functions for floats and vector registers: implementations of :mod:`brightgrey.effects.arithmetic`."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import overload

from brightgrey.effects import arithmetic
from brightgrey.simulation.kernel.machine.simd import (
    DOUBLE,
    LANES,
    VECTOR,
    WORD,
    choose_less,
    intrinsic,
    lanes,
    register_jitable,
)

__all__ = ["vector_exponential", "vector_sine"]

_WORDS = ir.VectorType(WORD, LANES)


@intrinsic
def _add_exponent(typing: Any, p: Any, t: Any) -> Any:
    """P times 2^k, where k stands in the last bits of t = k + 1.5 * 2^52."""
    wide = p == lanes
    word = _WORDS if wide else WORD

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        shift = ir.Constant(_WORDS, [52] * LANES) if wide else ir.Constant(WORD, 52)
        k = builder.shl(builder.bitcast(args[1], word), shift)
        return builder.bitcast(builder.add(builder.bitcast(args[0], word), k), VECTOR if wide else DOUBLE)

    return p(p, t), generate


_MAGIC = 1.5 * 2.0**52  # adding it leaves the nearest whole number in the last bits
_LOG2_E = float(np.log2(np.e))
_LN2_HIGH = 0.693147180369123816490  # ln 2 in two parts (fdlibm): k * high is exact
_LN2_LOW = 1.90821492927058770002e-10
# (e^r - 1)/r on |r| <= ln(2)/2 by Chebyshev interpolation: e^0 stays 1, so that tanh(0) stays 0.
_SERIES = (
    0.9999999999999994,
    0.49999999999797834,
    0.1666666666666345,
    0.04166666689104534,
    0.008333333346829657,
    0.001388882165909482,
    0.0001984121861477155,
    2.4876174580951866e-05,
    2.7620744701922868e-06,
)


@register_jitable
def vector_exponential(z: Any) -> Any:
    """e^z to 4e-14 relative for |z| <= 700, cut off beyond: 2^k times a polynomial on |r| <= ln(2)/2."""
    z = choose_less(z, 700.0, z, 700.0)
    z = choose_less(-700.0, z, z, -700.0)
    t = z * _LOG2_E + _MAGIC
    k = t - _MAGIC
    r = (z - k * _LN2_HIGH) - k * _LN2_LOW
    p = r * _SERIES[8] + _SERIES[7]
    p = p * r + _SERIES[6]
    p = p * r + _SERIES[5]
    p = p * r + _SERIES[4]
    p = p * r + _SERIES[3]
    p = p * r + _SERIES[2]
    p = p * r + _SERIES[1]
    p = p * r + _SERIES[0]
    p = p * r + 1.0
    return _add_exponent(p, t)


_PI_HIGH = 3.1415926218032837  # pi in two parts (Cody and Waite): k * high is exact up to |k| = 2^26
_PI_LOW = 3.178650954705639e-08
# sin(r)/r over r^2 on |r| <= pi/2 by Chebyshev interpolation
_SINE_SERIES = (
    1.0,
    -0.16666666666666666,
    0.00833333333333318,
    -0.0001984126984120718,
    2.7557319211034157e-06,
    -2.5052106875371277e-08,
    1.6058940177206624e-10,
    -7.643008906055446e-13,
    2.7213893166649284e-15,
)


@register_jitable
def vector_sine(z: Any) -> Any:
    """sin(z) to 1e-15 for |z| <= 1e6: (-1)^k sin(r) with r = z - k pi."""
    k = (z * (1.0 / np.pi) + _MAGIC) - _MAGIC
    odd = k - ((k * 0.5 + _MAGIC) - _MAGIC) * 2.0
    r = (z - k * _PI_HIGH) - k * _PI_LOW
    s = r * r
    p = s * _SINE_SERIES[8] + _SINE_SERIES[7]
    p = p * s + _SINE_SERIES[6]
    p = p * s + _SINE_SERIES[5]
    p = p * s + _SINE_SERIES[4]
    p = p * s + _SINE_SERIES[3]
    p = p * s + _SINE_SERIES[2]
    p = p * s + _SINE_SERIES[1]
    p = p * s + _SINE_SERIES[0]
    return r * p * (1.0 - odd * odd * 2.0)


def _implement(function: Any, implementation: Any) -> None:
    """Offer `implementation` for floats and registers wherever a compiled law calls `function`."""

    def offer(z: Any) -> Any:
        return implementation if z == lanes or isinstance(z, types.Float) else None

    overload(function, strict=False)(offer)


def _magnitude(z: Any) -> Any:
    return choose_less(z, 0.0, -z, z)


def _sign(z: Any) -> Any:
    return choose_less(z, 0.0, -1.0 + 0.0 * z, 1.0 + 0.0 * z)


def _tanh(z: Any) -> Any:
    e = vector_exponential(choose_less(z, 0.0, z, -z) * 2.0)
    t = (1.0 - e) / (1.0 + e)
    return choose_less(z, 0.0, -t, t)


_implement(arithmetic.exp, lambda z: vector_exponential(z))
_implement(arithmetic.sin, lambda z: vector_sine(z))
_implement(arithmetic.cos, lambda z: vector_sine(z + 0.5 * np.pi))
_implement(arithmetic.magnitude, _magnitude)
_implement(arithmetic.sign, _sign)
_implement(arithmetic.tanh, _tanh)
_implement(arithmetic.positive_part, lambda z: choose_less(z, 0.0, 0.0, z))
_implement(arithmetic.negative_part, lambda z: choose_less(z, 0.0, z, 0.0))
