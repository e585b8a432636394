"""The command as it was given, so that a report can say how to repeat it."""

from __future__ import annotations

import shlex
from typing import Any

import typer

__all__ = ["given"]

# A result does not depend on them.
ELSEWHERE = {"out", "workers", "processes", "dask", "max_evaluations", "max_seconds", "restart", "quiet", "json"}


def given(context: typer.Context) -> str:
    """Command with the arguments and options that were given, without those that change no result."""
    words = ["brightgrey", context.info_name or ""]
    for parameter in context.command.params:
        name = parameter.name or ""
        source = context.get_parameter_source(name)
        if name in ELSEWHERE or source is None or source.name in ("DEFAULT", "DEFAULT_MAP"):
            continue
        value = context.params[name]
        option = max(parameter.opts, key=len) if parameter.param_type_name == "option" else ""
        words += _words(option, value)
    return shlex.join(words)


def _words(option: str, value: Any) -> list[str]:
    several = value if isinstance(value, list | tuple) else [value]
    if value is True:
        return [option]
    return [word for each in several for word in ((option, str(each)) if option else (str(each),))]
