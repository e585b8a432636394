"""How the kernel is compiled: one place for numba's options and for a disk cache that cannot go stale.

numba's cache looks at the file of the compiled function only. A changed law stands in another file, so the
cache's folder is named by a hash of every source file the kernel is made of.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numba.core.config

__all__ = ["cached", "inner"]

_CONFIG: Any = numba.core.config
_OPTIONS: dict[str, Any] = {"nogil": True, "fastmath": {"contract"}, "error_model": "numpy"}

inner: Callable[[Callable[..., Any]], Any] = numba.njit(**_OPTIONS)
"""Compile a function that only compiled functions call."""


@cache
def cache_folder() -> Path:
    """Folder of the disk cache, named by the kernel's and all effects' sources."""
    package = Path(__file__).parent.parent
    digest = hashlib.sha256(numba.__version__.encode())
    for room in ("effects", "simulation"):
        for file in sorted((package / room).glob("*.py")):
            digest.update(file.read_bytes())
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    base = _CONFIG.CACHE_DIR or str(Path(home) / "brightgrey")
    return Path(base) / f"kernel-{digest.hexdigest()[:16]}"


def cached(function: Callable[..., Any]) -> Any:
    """Compile an entry point and keep the machine code on disk, or only in memory where no disk can be written.

    numba takes the folder from its configuration at decoration, and from nowhere else; it is put back at once.
    """
    before = _CONFIG.CACHE_DIR
    try:
        cache_folder().mkdir(parents=True, exist_ok=True)
        _CONFIG.CACHE_DIR = str(cache_folder())
        return numba.njit(cache=True, **_OPTIONS)(function)
    except (OSError, RuntimeError):
        return numba.njit(**_OPTIONS)(function)
    finally:
        _CONFIG.CACHE_DIR = before
