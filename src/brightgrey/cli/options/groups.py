"""Options of the command line as frozen groups: each option is declared once, and commands take whole groups."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import MISSING, fields, is_dataclass
from functools import wraps
from typing import Any, get_type_hints

__all__ = ["ESTIMATION", "GENETIC", "OUTPUT", "RECORDING", "RUN", "STRUCTURE", "with_options"]

# Headings of the help pages.
RECORDING = "Recording"
STRUCTURE = "Structure"
ESTIMATION = "Estimation"
GENETIC = "Genetic programming"
RUN = "Run"
OUTPUT = "Output"


def with_options(command: Callable[..., None]) -> Callable[..., None]:
    """Make a command that has the fields of its parameters' dataclasses as options.

    Parameters
    ----------
    command : callable
        Parameters whose annotation is a dataclass are groups of options. The fields of the class are annotated with
        ``typer.Option``; their defaults are those of the options.

    Returns
    -------
    callable
        With one parameter for each field.
    """
    hints = get_type_hints(command, include_extras=True)
    groups = {name: hint for name, hint in hints.items() if isinstance(hint, type) and is_dataclass(hint)}
    members = {name: [field.name for field in fields(group)] for name, group in groups.items()}

    @wraps(command)
    def run(**given: Any) -> None:
        own = {name: given[name] for name in hints if name in given and name not in groups}
        collected = {name: group(**{n: given[n] for n in members[name]}) for name, group in groups.items()}
        command(**own, **collected)

    parameters = []
    for name, parameter in inspect.signature(command).parameters.items():
        if name not in groups:
            parameters.append(parameter.replace(annotation=hints[name], kind=inspect.Parameter.KEYWORD_ONLY))
            continue
        types = get_type_hints(groups[name], include_extras=True)
        parameters += [
            inspect.Parameter(
                field.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=inspect.Parameter.empty if field.default is MISSING else field.default,
                annotation=types[field.name],
            )
            for field in fields(groups[name])
        ]
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run
