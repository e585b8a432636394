"""Brightgrey finds out which physical effects are at work in an electric drive train, and how large they are."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from brightgrey.version import __version__

if TYPE_CHECKING:
    from brightgrey.api import Result, Simulation, identify, simulate
    from brightgrey.errors import BrightgreyError
    from brightgrey.kit.structure import Structure
    from brightgrey.model.model import Model
    from brightgrey.recordings import Recording, read_recording

__all__ = [
    "BrightgreyError",
    "Model",
    "Recording",
    "Result",
    "Simulation",
    "Structure",
    "__version__",
    "identify",
    "read_recording",
    "simulate",
]

_HOME = {
    "BrightgreyError": "brightgrey.errors",
    "Model": "brightgrey.model.model",
    "Recording": "brightgrey.recordings",
    "Result": "brightgrey.api",
    "Simulation": "brightgrey.api",
    "Structure": "brightgrey.kit.structure",
    "identify": "brightgrey.api",
    "read_recording": "brightgrey.recordings",
    "simulate": "brightgrey.api",
}


def __getattr__(name: str) -> Any:
    """Import on first use (PEP 562): ``brightgrey --help`` must not wait for numba and scipy."""
    if name not in _HOME:
        raise AttributeError(f"module 'brightgrey' has no attribute '{name}'")
    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
