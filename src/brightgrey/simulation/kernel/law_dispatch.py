"""Dispatch by the number of a law: all laws of the function set are compiled once, for every structure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import brightgrey.simulation.kernel.machine.simd_functions  # noqa: F401  laws compile with these implementations
from brightgrey.effects import Law, registry
from brightgrey.effects.arithmetic import positive_part, tanh
from brightgrey.simulation.kernel.machine.compilation import inlined, inner
from brightgrey.simulation.kernel.machine.simd import get, splat, whole

__all__ = ["channel_force", "channel_forces", "dry_forces", "smooth_laws"]


def smooth_laws() -> tuple[Law, ...]:
    """Laws that the kernel solves for implicitly: one port, not affine. The position of a law is its number."""
    laws = (effect.law for effect in registry().values())
    return tuple(law for law in laws if law is not None and law.ports == 1 and not law.affine)


@inner
def _one(p: Any, first: Any, who: Any) -> Any:
    return (get(p, first, who),)


@inner
def _two(p: Any, first: Any, who: Any) -> Any:
    return get(p, first, who), get(p, first + 1, who)


@inner
def _three(p: Any, first: Any, who: Any) -> Any:
    return get(p, first, who), get(p, first + 1, who), get(p, first + 2, who)


@inner
def _four(p: Any, first: Any, who: Any) -> Any:
    return get(p, first, who), get(p, first + 1, who), get(p, first + 2, who), get(p, first + 3, who)


_TAKE = {1: _one, 2: _two, 3: _three, 4: _four}


@inner
def _none(which: Any, p: Any, first: Any, who: Any, z1: Any, z2: Any) -> Any:
    return splat(0.0, who), splat(0.0, who), splat(0.0, who), splat(0.0, who)


def _dispatch_one(number: int, value: Any, parameters: int, rest: Any) -> Any:
    """Function that evaluates ``value(z, p)`` for its number and calls `rest` for any other.

    It evaluates both stages of a step at once, because two independent chains of operations keep the processor busy.
    """
    if parameters not in _TAKE:
        raise TypeError(f"a law of {parameters} parameters: the kernel takes one to four")
    take = _TAKE[parameters]

    def link(which: Any, p: Any, first: Any, who: Any, z1: Any, z2: Any) -> Any:
        if which == number:
            own = take(p, first, who)
            value1, slope1 = value(z1, own)
            value2, slope2 = value(z2, own)
            return value1, slope1, value2, slope2
        return rest(which, p, first, who, z1, z2)

    return inner(link)


def _of_one_port(law: Law) -> Any:
    value = inner(law.value)

    def of_one_port(z: Any, p: Any) -> Any:
        phi, slopes = value((z,), p)
        return phi, slopes[0]

    return inner(of_one_port)


def _dispatcher(pick: Callable[[Law], tuple[Any, int] | None]) -> Any:
    """Make ``f(number, p, first, who, z1, z2) -> (value1, slope1, value2, slope2)``: 0 for laws that are not picked."""
    function: Any = _none
    for number, law in enumerate(smooth_laws()):
        picked = pick(law)
        if picked is not None:
            function = _dispatch_one(number, *picked, function)
    return function


_friction_amplitudes = _dispatcher(
    lambda law: (inner(law.amplitude), len(law.parameters) - 1) if law.amplitude else None
)
_other_laws = _dispatcher(lambda law: None if law.amplitude else (_of_one_port(law), len(law.parameters)))


@inlined
def channel_forces(shape: Any, plant: Any, k: Any, z1: Any, z2: Any, who: Any) -> Any:
    """Sum of all laws of channel k and its slope, at two ports: (F1, slope1, F2, slope2)."""
    a1, a2, rise1, rise2 = splat(0.0, who), splat(0.0, who), splat(0.0, who), splat(0.0, who)
    f1, f2, d1, d2 = splat(0.0, who), splat(0.0, who), splat(0.0, who), splat(0.0, who)
    for e in range(shape.elements):
        if whole(plant.channel, e) == k:
            law, first = whole(plant.law, e), whole(plant.first, e)
            v1, s1, v2, s2 = _friction_amplitudes(law, plant.p, first, who, z1, z2)
            a1, rise1, a2, rise2 = a1 + v1, rise1 + s1, a2 + v2, rise2 + s2
            v1, s1, v2, s2 = _other_laws(law, plant.p, first, who, z1, z2)
            f1, d1, f2, d2 = f1 + v1, d1 + s1, f2 + v2, d2 + s2
    if whole(plant.turning, k) >= 0:
        f_tanh = get(plant.p, whole(plant.turning, k), who)
        side1, side2 = tanh(f_tanh * z1), tanh(f_tanh * z2)
        f1, d1 = f1 - side1 * a1, d1 - (f_tanh * (1.0 - side1 * side1) * a1 + side1 * rise1)
        f2, d2 = f2 - side2 * a2, d2 - (f_tanh * (1.0 - side2 * side2) * a2 + side2 * rise2)
    return f1, d1, f2, d2


@inner
def channel_force(shape: Any, plant: Any, k: Any, z: Any, who: Any) -> Any:
    """Sum of all laws of channel k and its slope at one port."""
    force, slope, _, _ = channel_forces(shape, plant, k, z, z, who)
    return force, slope


@inner
def dry_forces(shape: Any, plant: Any, k: Any, z1: Any, z2: Any, side: Any, lane: Any) -> Any:
    """As `channel_forces`, with dry friction of a mass that slides to `side`; where side is 0, it has no friction here.

    On the wrong side of zero, the tangent continues the law.
    """
    off1, off2 = side * z1, side * z2
    speed1, speed2 = positive_part(off1), positive_part(off2)
    f1, d1, f2, d2 = splat(0.0, lane), splat(0.0, lane), splat(0.0, lane), splat(0.0, lane)
    for e in range(shape.elements):
        if whole(plant.channel, e) == k:
            law, first = whole(plant.law, e), whole(plant.first, e)
            a1, rise1, a2, rise2 = _friction_amplitudes(law, plant.p, first, lane, speed1, speed2)
            f1, d1 = f1 - side * (a1 + rise1 * (off1 - speed1)), d1 - side * side * rise1
            f2, d2 = f2 - side * (a2 + rise2 * (off2 - speed2)), d2 - side * side * rise2
            v1, s1, v2, s2 = _other_laws(law, plant.p, first, lane, z1, z2)
            f1, d1, f2, d2 = f1 + v1, d1 + s1, f2 + v2, d2 + s2
    return f1, d1, f2, d2
