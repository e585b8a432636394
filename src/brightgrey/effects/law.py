"""Scalar laws of elements, with their derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from brightgrey.effects.arithmetic import tanh

__all__ = ["Law", "friction_law"]


@dataclass(frozen=True)
class Law:
    """Scalar law phi(z; p) of an element.

    Attributes
    ----------
    parameters : tuple of str
        Names of p in order. ``f_tanh`` may be among them: it is fixed upfront, not estimated.
    value : callable
        ``value(z, p) -> (phi, slopes)`` for tuples of ports z and parameters p; slopes are the derivatives of phi
        by each port. It is compiled, so it may only use :mod:`brightgrey.effects.arithmetic`.
    gradient : callable
        ``gradient(z, p) -> tuple`` of the derivatives of phi by each parameter, in the order of `parameters`.
    ports : int
        Number of ports, two at most.
    affine : bool
        The law is a straight line in its ports, so that it may be counted to A and a constant.
    odd : bool
        phi(-z) = -phi(z).
    dissipative : bool
        z phi(z) <= 0: takes energy only.
    amplitude : callable or None
        Of a law made by :func:`friction_law`; the kernel sums amplitudes before it turns them, and compiles this
        instead of `value`.
    """

    parameters: tuple[str, ...]
    value: Callable[[tuple[Any, ...], tuple[Any, ...]], tuple[Any, tuple[Any, ...]]]
    gradient: Callable[[tuple[Any, ...], tuple[Any, ...]], tuple[Any, ...]]
    ports: int = 1
    affine: bool = False
    odd: bool = False
    dissipative: bool = False
    amplitude: Callable[[Any, tuple[Any, ...]], tuple[Any, Any]] | None = None


def friction_law(
    parameters: tuple[str, ...],
    amplitude: Callable[[Any, tuple[Any, ...]], tuple[Any, Any]],
    gradient: Callable[[Any, tuple[Any, ...]], tuple[Any, ...]],
) -> Law:
    """Law of friction that turns with the motion: ``phi(v) = -tanh(f_tanh v) a(v)`` (eq. 2).

    Parameters
    ----------
    parameters : tuple of str
        Names of those of the amplitude; ``f_tanh`` is added behind them.
    amplitude : callable
        ``amplitude(v, p) -> (a, slope)``: a >= 0, even in v, and its derivative by v.
    gradient : callable
        ``gradient(v, p) -> tuple`` of the derivatives of a by each parameter.
    """

    def value(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
        f_tanh, side = p[-1], tanh(p[-1] * z[0])
        a, slope = amplitude(z[0], p[:-1])
        return -side * a, (-f_tanh * (1.0 - side * side) * a - side * slope,)

    def by_parameters(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, ...]:
        side = tanh(p[-1] * z[0])
        a, _ = amplitude(z[0], p[:-1])
        return (*(-side * g for g in gradient(z[0], p[:-1])), -z[0] * (1.0 - side * side) * a)

    return Law((*parameters, "f_tanh"), value, by_parameters, odd=True, dissipative=True, amplitude=amplitude)
