"""Scalar laws of elements, with their derivatives by the ports."""

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
    ports : int
        Number of ports, two at most.
    affine : bool
        The law is a straight line in its ports, so that it can be added to A and a constant.
    odd : bool
        phi(-z) = -phi(z).
    dissipative : bool
        z phi(z) <= 0: the law only takes energy.
    amplitude : callable or None
        Amplitude of a law made by :func:`friction_law`. The kernel compiles it instead of `value`: it sums the
        amplitudes of all friction at a mass before it gives them the sign of the motion.
    """

    parameters: tuple[str, ...]
    value: Callable[[tuple[Any, ...], tuple[Any, ...]], tuple[Any, tuple[Any, ...]]]
    ports: int = 1
    affine: bool = False
    odd: bool = False
    dissipative: bool = False
    amplitude: Callable[[Any, tuple[Any, ...]], tuple[Any, Any]] | None = None


def friction_law(
    parameters: tuple[str, ...],
    amplitude: Callable[[Any, tuple[Any, ...]], tuple[Any, Any]],
) -> Law:
    """Friction that reverses with the motion: ``phi(v) = -tanh(f_tanh v) a(v)`` (eq. 2).

    Parameters
    ----------
    parameters : tuple of str
        Parameters of the amplitude; ``f_tanh`` is added behind them.
    amplitude : callable
        ``amplitude(v, p) -> (a, slope)``: the torque a >= 0, even in v, and its derivative by v.
    """

    def value(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
        f_tanh, side = p[-1], tanh(p[-1] * z[0])
        a, slope = amplitude(z[0], p[:-1])
        return -side * a, (-f_tanh * (1.0 - side * side) * a - side * slope,)

    return Law((*parameters, "f_tanh"), value, odd=True, dissipative=True, amplitude=amplitude)
