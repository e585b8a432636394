"""The function set: one file per physical effect, found by listing the folder ``library``.

A module of that folder defines ``EFFECT``, or ``EFFECTS`` if it holds several. Nothing else names an effect.
Everything that the author of an effect needs is imported from here.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from brightgrey.effects import library
from brightgrey.effects.effect import Caution, Circumstances, Effect, Fault, LimitingCase, Parameter, SearchHints, Stage
from brightgrey.effects.law import Law, friction_law
from brightgrey.effects.modelica import Modelica, force_on_mass
from brightgrey.effects.quantities import (
    ANGLE,
    DAMPING,
    INERTIA,
    PER_POSITION,
    PER_SPEED,
    POSITION,
    SPEED,
    STIFFNESS,
    TIME,
    TORQUE,
    Dimension,
    Scales,
)
from brightgrey.effects.symbol import Symbol, block, friction_symbol
from brightgrey.effects.system import Draft, Element, Limits, State, Values, friction_stamp, position_stamp

__all__ = [
    "ANGLE",
    "DAMPING",
    "INERTIA",
    "PER_POSITION",
    "PER_SPEED",
    "POSITION",
    "SPEED",
    "STIFFNESS",
    "TIME",
    "TORQUE",
    "Caution",
    "Circumstances",
    "Dimension",
    "Draft",
    "Effect",
    "Element",
    "Fault",
    "Law",
    "LimitingCase",
    "Limits",
    "Modelica",
    "Parameter",
    "Scales",
    "SearchHints",
    "Stage",
    "State",
    "Symbol",
    "Values",
    "block",
    "force_on_mass",
    "friction_law",
    "friction_stamp",
    "friction_symbol",
    "position_stamp",
    "registry",
]


@cache
def registry() -> Mapping[str, Effect]:
    """All effects by name, in the order of their numbers (paper figure 7)."""
    modules = [importlib.import_module(f"{library.__name__}.{m.name}") for m in pkgutil.iter_modules(library.__path__)]
    effects = [effect for module in modules for effect in getattr(module, "EFFECTS", None) or (module.EFFECT,)]
    return MappingProxyType({e.name: e for e in sorted(effects, key=lambda e: (e.number, e.name))})
