"""Symbol of an effect in the drawing of a drive, as data: lines, circles and letters, without drawing code."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["Stroke", "Symbol", "block", "friction_symbol"]

Stroke = tuple[tuple[float, float], ...]
"""Points of an open polygon."""


@dataclass(frozen=True)
class Symbol:
    """Symbol of an effect, or of one part of it.

    Lengths are in pixels of a drawing that is not scaled; x runs to the right and y down from the upper left corner.

    Attributes
    ----------
    at : {'body', 'spring', 'damper', 'series', 'ground', 'load', 'input'}
        What it is: the mass itself; the spring or the damper of a shaft, side by side; a part in series with them; a
        part between a mass and the ground; a load on a mass; a block before the torque.
    width, height : float
        Size of its box. Wires reach the middle of the left side, and that of the right side where it has two ends.
    lines : tuple of Stroke
    circles : tuple of (x, y, radius)
    letters : str
        Text in the middle of the box.
    shows : tuple of str or None
        Parameters that are written beside it; all of the effect's where it is None.
    place : int
        Mass or shaft of the part, for effects of the whole drive; 0 means the place of the effect.
    motion : {'any', 'rotary', 'linear'}
        Kind of drive that it is drawn in.
    """

    at: Literal["body", "spring", "damper", "series", "ground", "load", "input"]
    width: float
    height: float
    lines: tuple[Stroke, ...] = ()
    circles: tuple[tuple[float, float, float], ...] = ()
    letters: str = ""
    shows: tuple[str, ...] | None = None
    place: int = 0
    motion: Literal["any", "rotary", "linear"] = "any"


def friction_symbol(*curve: tuple[float, float]) -> Symbol:
    """Friction between a mass and the ground: a box with the friction over the speed.

    Parameters
    ----------
    *curve : tuple of (speed, friction)
        Points of the curve, both relative to the largest one, from -1 to 1. Friction is positive at positive speed.
    """
    frame = ((0.0, 0.0), (40.0, 0.0), (40.0, 32.0), (0.0, 32.0), (0.0, 0.0))
    axis = ((4.0, 16.0), (36.0, 16.0))
    return Symbol("ground", 40.0, 32.0, (frame, axis, tuple((20.0 + 14.0 * v, 16.0 - 10.0 * f) for v, f in curve)))


def block(*curve: tuple[float, float]) -> Symbol:
    """Block in the path of the input: a box with its response to a step.

    Parameters
    ----------
    *curve : tuple of (time, response)
        Points of the response, both relative to the last one, from 0 to 1.
    """
    frame = ((0.0, 0.0), (48.0, 0.0), (48.0, 36.0), (0.0, 36.0), (0.0, 0.0))
    return Symbol("input", 48.0, 36.0, (frame, tuple((6.0 + 36.0 * t, 29.0 - 22.0 * y) for t, y in curve)))
