"""Check of the arguments of functions that users call from Python.

A name of a parameter means the same everywhere, so that one table by name says what each may be. What the values
themselves must fulfil, a unit or a name of a column, is checked where they are used.
"""

from __future__ import annotations

import functools
import inspect
import math
import os
from collections.abc import Callable, Collection, Mapping
from numbers import Integral, Real
from typing import Any, ParamSpec, TypeVar

from brightgrey.errors import SettingsError, nearest

__all__ = ["bind_checked", "checked_arguments"]

P = ParamSpec("P")
R = TypeVar("R")

Rule = Callable[[Any], bool]


def _is_a(value: Any, *classes: str) -> bool:
    """True if a class of the value has one of these names; the classes themselves stand in rooms above."""
    return any(known.__name__ in classes for known in type(value).__mro__)


def _is_real(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _is_finite_number(value: Any) -> bool:
    return _is_real(value) and math.isfinite(value)


def _is_whole(value: Any, least: int) -> bool:
    return _is_finite_number(value) and (isinstance(value, Integral) or float(value).is_integer()) and value >= least


def _is_path(value: Any) -> bool:
    return isinstance(value, str | os.PathLike)


def _are_texts(value: Any) -> bool:
    return isinstance(value, Collection) and not isinstance(value, str) and all(isinstance(v, str) for v in value)


def _maps_to(value: Any, rule: Rule) -> bool:
    return isinstance(value, Mapping) and all(isinstance(k, str) and rule(v) for k, v in value.items())


def _is_range(value: Any) -> bool:
    pair = isinstance(value, Collection) and not isinstance(value, str) and len(value) == 2
    return pair and all(map(_is_real, value))


def _is_output(value: Any) -> bool:
    pair = isinstance(value, tuple | list) and len(value) == 2 and all(isinstance(v, str) for v in value)
    return isinstance(value, str) or pair


def _are_recordings(value: Any) -> bool:
    several = isinstance(value, Collection) and not isinstance(value, str | Mapping)
    return _is_a(value, "Recording") or (several and all(_is_a(r, "Recording") for r in value))


_A_RECORDING = (lambda value: _is_a(value, "Recording"), "a recording, from read_recording(...) or recording_from(...)")
_MODEL = (lambda value: _is_a(value, "Model"), "a model, from load_model(...) or result.model")
_TEXT = (lambda value: isinstance(value, str), "a text")
_PATH = (_is_path, "a path")
_NUMBER = (_is_finite_number, "a finite number")
_REAL = (_is_real, "a number")
_COUNT = (lambda value: _is_whole(value, 1), "a whole number from 1")
_TEXTS = (_are_texts, "several texts, like ['coulomb']")
_NUMBERS = (lambda value: _maps_to(value, _is_real), "numbers by name, like {'J1': 0.01}")
_UNITS = (lambda value: _maps_to(value, lambda v: isinstance(v, str)), "texts by column, like {'torque': 'N m'}")

RULES: Mapping[str, tuple[Rule, str]] = {
    "recordings": (_are_recordings, "one or several recordings, from read_recording(...)"),
    **dict.fromkeys(("recording", "test", "baseline"), _A_RECORDING),
    **dict.fromkeys(("model", "start"), _MODEL),
    "structure": (lambda value: isinstance(value, str) or _is_a(value, "Structure"), "a text like 'one_mass+coulomb'"),
    **dict.fromkeys(("path", "folder"), _PATH),
    **dict.fromkeys(("input", "time", "hold", "contact", "to", "name"), _TEXT),
    "torque_constant": (_TEXT[0], "a text like '0.05 N m/A'"),
    **dict.fromkeys(("delimiter", "decimal", "initial", "level", "estimator", "grammar", "loop"), _TEXT),
    "beside": (
        lambda value: isinstance(value, Collection) and not isinstance(value, str) and all(map(_is_path, value)),
        "several paths, like ['position.csv']",
    ),
    **dict.fromkeys(("header", "check", "fast", "stretches"), (lambda value: isinstance(value, bool), "True or False")),
    "outputs": (
        lambda value: (
            isinstance(value, str)
            or (isinstance(value, Collection) and not isinstance(value, Mapping) and all(map(_is_output, value)))
        ),
        "one or several columns, like ['velocity:velocity']",
    ),
    "columns": (lambda value: hasattr(value, "keys"), "arrays by name, like {'t': ..., 'torque': ...}"),
    **dict.fromkeys(("require", "exclude", "decide"), _TEXTS),
    **dict.fromkeys(("profile", "per_recording"), (_are_texts, "several parameters, like ['f_v']")),
    "bounds": (lambda value: _maps_to(value, _is_range), "pairs by parameter, like {'J1': (0.001, 0.1)}"),
    **dict.fromkeys(("fixed", "limits", "controller"), _NUMBERS),
    **dict.fromkeys(("counts", "gear", "shift"), (_NUMBERS[0], "numbers by column, like {'position': 4096}")),
    "units": _UNITS,
    "rated": (_UNITS[0], "texts by column, like {'torque': '9.84 mN m'}"),
    **dict.fromkeys(("starts", "workers", "decimate", "draws", "actuator"), _COUNT),
    "seed": (lambda value: isinstance(value, Integral) and _is_whole(value, 0), "a whole number from 0"),
    "search": (lambda value: isinstance(value, str) or _is_a(value, "GeneticSettings"), "a name like 'auto'"),
    **dict.fromkeys(("input_gain", "dt", "f_tanh", "min_change", "confidence", "seconds"), _REAL),
    **dict.fromkeys(("speed", "torque", "sampling_time", "computing_time", "settling_time"), _NUMBER),
}
"""Rule by the name of a parameter, and what it expects, in words."""


def _refuse_unknown(function: str, signature: inspect.Signature, named: Collection[str]) -> None:
    """Refuse names of arguments that a function has not (TypeError), with the nearest right one."""
    declared = signature.parameters.values()
    if any(parameter.kind is inspect.Parameter.VAR_KEYWORD for parameter in declared):
        return
    for name in named:
        if name not in signature.parameters:
            guess = nearest(name, signature.parameters)
            hint = f" Did you mean '{guess}'?" if guess else f" It has {', '.join(signature.parameters)}"
            raise TypeError(f"{function}() has no argument '{name}'.{hint}")


def checked_arguments(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function refuse arguments that are none of what `RULES` expects, with what came.

    A default may always be given. Arguments without a rule are passed on as they are.
    """

    @functools.wraps(function)
    def checked(*given: P.args, **named: P.kwargs) -> R:
        bind_checked(function, *given, **named)
        return function(*given, **named)

    return checked


def bind_checked(function: Callable[..., Any], *given: Any, **named: Any) -> dict[str, Any]:
    """Return the arguments of a call by name, defaults included; refuse what `RULES` does not expect."""
    signature = inspect.signature(function)
    _refuse_unknown(function.__name__, signature, named)
    try:
        bound = signature.bind(*given, **named)
    except TypeError as error:
        raise TypeError(f"{function.__name__}(): {error}") from None
    for name, value in bound.arguments.items():
        default = signature.parameters[name].default
        if name in RULES and value is not default and not RULES[name][0](value):
            came = repr(value)
            came = came if len(came) <= 100 else f"{came[:100]}..."
            raise SettingsError(f"{name} is {came}; expected: {RULES[name][1]}")
    bound.apply_defaults()
    return bound.arguments
