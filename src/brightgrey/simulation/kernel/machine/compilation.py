"""Compilation of the kernel: numba's options, and a disk cache that cannot go stale.

numba's own cache only looks at the file of the compiled function, but a changed law stands in another file. The
folder of the cache is therefore named by a hash of every source file of the kernel and of the effects.

The kernel is cut into a few entries that call each other by address. A function that calls another one directly
takes over its machine code and optimises it once more, at every level of calls. Without the cut, a third of the
compile time went into code that had been compiled before.
"""

from __future__ import annotations

import hashlib
import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any

import numba
import numba.core.config
from numba.core import types

__all__ = ["Entry", "cache_folder", "cached", "compile_for_integers", "inlined", "inner", "merged"]

_CONFIG: Any = numba.core.config
_OPTIONS: dict[str, Any] = {"nogil": True, "fastmath": {"contract"}, "error_model": "numpy"}
_UNWRAPPED: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Without entries for callers from Python and C, which take a fifth of the compile time."""
_LOCK = Lock()

inner: Callable[[Callable[..., Any]], Any] = numba.njit(**_OPTIONS, **_UNWRAPPED)
"""Compile a function that only compiled functions call."""

inlined: Callable[[Callable[..., Any]], Any] = numba.njit(**_OPTIONS, **_UNWRAPPED, forceinline=True)
"""As `inner`, but merged into its caller. For functions that run at every step, where passing the addresses of all
tables on the stack would cost as much as the arithmetic."""

merged: Callable[[Callable[..., Any]], Any] = numba.njit(**_OPTIONS, **_UNWRAPPED, inline="always")
"""As `inlined`, for a large function with one caller: merged before it is compiled, so that it is compiled once."""


@cache
def cache_folder(package: Path = Path(__file__).parents[3]) -> Path:
    """Folder of the disk cache, named by a hash of all source files of the effects and of the kernel.

    Parameters
    ----------
    package : Path
        Folder of the package whose sources are hashed.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for room in ("effects", "simulation/kernel"):
        for file in sorted((package / room).rglob("*.py")):
            digest.update(file.read_bytes())
    base = Path(_CONFIG.CACHE_DIR) if _CONFIG.CACHE_DIR else _user_folder()
    return base / f"kernel-{digest.hexdigest()[:16]}"


def _user_folder() -> Path:
    """Folder for caches of this user; without a home, as of an unnamed user in a container, a temporary one."""
    if os.environ.get("XDG_CACHE_HOME"):
        return Path(os.environ["XDG_CACHE_HOME"]) / "brightgrey"
    try:
        return Path.home() / ".cache" / "brightgrey"
    except RuntimeError:
        folder = Path(tempfile.gettempdir()) / f"brightgrey-{os.getuid()}"
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    found = folder.lstat()
    own = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o022
    return folder if own else Path(tempfile.mkdtemp(prefix="brightgrey-"))  # machine code of others must not be run


@contextmanager
def _folder_set() -> Iterator[None]:
    """Make numba write to our folder, which it reads from its configuration only when a function is decorated."""
    folder = cache_folder()
    folder.mkdir(parents=True, exist_ok=True)
    with _LOCK:
        before = _CONFIG.CACHE_DIR
        _CONFIG.CACHE_DIR = str(folder)
        try:
            yield
        finally:
            _CONFIG.CACHE_DIR = before


def cached(function: Callable[..., Any]) -> Any:
    """Compile an entry point at its first call; the machine code is kept on disk if one can be written."""
    try:
        with _folder_set():
            return numba.njit(cache=True, **_OPTIONS)(function)
    except (OSError, RuntimeError):
        return numba.njit(**_OPTIONS)(function)


def compile_for_integers(function: Any, count: int) -> None:
    """Compile a :func:`cached` function of `count` integers into the disk cache, as its first call would."""
    function.compile((types.int64,) * count)


class Entry:
    """Decorator for a function of integers, ``(block, ...) -> None``, that compiled code calls by its address."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._compiled: Any = None

    def address(self) -> int:
        """Address of the machine code, compiled at the first call."""
        if self._compiled is None:
            count = self._function.__code__.co_argcount
            signature = types.void(*[types.int64] * count)
            try:
                with _folder_set():
                    self._compiled = numba.cfunc(signature, cache=True, **_OPTIONS)(self._function)
            except (OSError, RuntimeError):
                self._compiled = numba.cfunc(signature, **_OPTIONS)(self._function)
        return int(self._compiled.address)
