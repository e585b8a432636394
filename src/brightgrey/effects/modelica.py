"""Drawing of an effect with the components of the Modelica standard library."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["Modelica", "force_on_mass"]


@dataclass(frozen=True)
class Modelica:
    """Drawing of an effect in Modelica, with components of the standard library where they exist.

    Texts may contain words with ``$``: ``$place`` and ``$next`` (place + 1), ``$name`` (of the placed effect),
    ``$law`` (the law, written out) and the effect's parameters by symbol. ``$library $Mass $m $Force $f $q $v`` stand
    for the names that differ between rotation and translation. Masses are components called ``mass1``, ``mass2``, and
    so on, shafts are called ``shaft1``, ``shaft2``. The initial value of state q1 is the parameter ``start_q1``.

    Attributes
    ----------
    components : tuple of (class, name, modifiers)
    equations : tuple of str
    port : str
        Variable that the law's port reads.
    instead : tuple of (name, class, modifiers) or None
        Component of another effect that is replaced by one of this class, with further modifiers.
    block : tuple of (class, modifiers) or None
        Block with input u and output y in the signal path of the input.
    model : str
        Text of a class that the drawing needs.
    """

    components: tuple[tuple[str, str, str], ...] = ()
    equations: tuple[str, ...] = ()
    port: str = ""
    instead: tuple[str, str, str] | None = None
    block: tuple[str, str] | None = None
    model: str = ""


def force_on_mass(reads: Literal["speed", "position"] = "speed") -> Modelica:
    """Draw a law that gives a torque on the mass at its place, from that mass's speed or position."""
    return Modelica(
        components=(("$library.Sources.$Force", "$name", ""),),
        equations=("$name.$f = $law", "connect($name.flange, mass$place.flange_b)"),
        port=f"mass$place.{'$v' if reads == 'speed' else '$q'}",
    )
