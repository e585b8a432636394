"""How an effect is drawn with the components of other tools."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Modelica", "force_on_mass"]


@dataclass(frozen=True)
class Modelica:
    """How an effect is drawn in Modelica, with the components of its standard library where they exist.

    Texts may hold ``$`` words: ``$place`` and ``$next`` (place + 1), ``$name`` (of the placed effect), the effect's
    parameters by symbol, ``$law`` (the law, written out), and what differs between rotation and translation:
    ``$library $Mass $m $Force $f $q $v``. Masses are components called ``mass1``, ``mass2``, ..., shafts ``shaft1``,
    ``shaft2``, ...; the start of state q1 is the parameter ``start_q1``.

    Attributes
    ----------
    components : tuple of (class, name, modifiers)
    equations : tuple of str
    port : str
        What the law's port reads.
    instead : tuple of (name, class, modifiers) or None
        Component of another effect that becomes one of this class, with more modifiers.
    block : tuple of (class, modifiers) or None
        Block with input u and output y in the signal path of the input.
    model : str
        Text of a class of its own that is needed.
    """

    components: tuple[tuple[str, str, str], ...] = ()
    equations: tuple[str, ...] = ()
    port: str = ""
    instead: tuple[str, str, str] | None = None
    block: tuple[str, str] | None = None
    model: str = ""


def force_on_mass() -> Modelica:
    """Drawing of a law that gives a torque on the mass at its place, from that mass's speed."""
    return Modelica(
        components=(("$library.Sources.$Force", "$name", ""),),
        equations=("$name.$f = $law", "connect($name.flange, mass$place.flange_b)"),
        port="mass$place.$v",
    )
