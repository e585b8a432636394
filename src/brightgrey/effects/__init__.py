"""The function set: one file per physical effect, found by listing the folder ``library``.

A module of that folder that defines ``EFFECT`` is an effect. Nothing else has to be told of it.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from brightgrey.effects import library
from brightgrey.effects.declaration import (
    Caution,
    Circumstances,
    Dimension,
    Draft,
    Effect,
    Element,
    Fault,
    Law,
    Limits,
    Parameter,
    Scales,
    State,
)

__all__ = [
    "Caution",
    "Circumstances",
    "Dimension",
    "Draft",
    "Effect",
    "Element",
    "Fault",
    "Law",
    "Limits",
    "Parameter",
    "Scales",
    "State",
    "registry",
]


@cache
def registry() -> Mapping[str, Effect]:
    """All effects by name, in the order of their numbers (paper figure 7)."""
    modules = (importlib.import_module(f"{library.__name__}.{m.name}") for m in pkgutil.iter_modules(library.__path__))
    effects = [module.EFFECT for module in modules if hasattr(module, "EFFECT")]
    return MappingProxyType({e.name: e for e in sorted(effects, key=lambda e: (e.number, e.name))})
