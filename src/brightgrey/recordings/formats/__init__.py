"""File formats of recordings: one file each, found by listing this folder.

A module that defines ``FORMAT`` is a format. A file that none of them recognises is read as delimited text.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from brightgrey.recordings.formats.file_format import FileFormat

__all__ = ["file_formats"]


@cache
def file_formats() -> tuple[FileFormat, ...]:
    """All declared formats, in the order of their module names."""
    modules = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    return tuple(module.FORMAT for module in modules if hasattr(module, "FORMAT"))
