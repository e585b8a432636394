"""Families of motions, one file each. A module of this folder with a ``FAMILY`` is one."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from brightgrey.planning.families.family import Family

__all__ = ["families"]


@cache
def families() -> tuple[Family, ...]:
    """All families, in the order of the files' names."""
    modules = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    return tuple(module.FAMILY for module in modules if hasattr(module, "FAMILY"))
