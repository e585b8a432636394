"""Arguments and results of evaluations as text: the same value gives the same text, and floats read back exactly."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from brightgrey.estimation.optimisation.least_squares import Optimum
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.kit import Structure
from brightgrey.recordings import Recording

__all__ = ["call_text", "canonical", "digest", "name_of", "source_hash", "text_of", "to_plain", "value_of"]

_KIND = "~"


@cache
def _results() -> Mapping[str, type[Any]]:
    """Types of results by name; those of a search are imported where one is read, not with every given structure."""
    from brightgrey.search.criteria import Misfit
    from brightgrey.search.fitting.refined_fit import Refined
    from brightgrey.search.fitting.structure_fit import StructureFit
    from brightgrey.search.genetic.evaluation import Evaluated

    kinds = (Optimum, Evaluated, StructureFit, Misfit, Refined, SimulationCount)
    return {kind.__name__: kind for kind in kinds}


def digest(*parts: str | bytes) -> str:
    """SHA-256 of several texts as 64 hexadecimal digits; their boundaries count."""
    whole = hashlib.sha256()
    for part in parts:
        content = part.encode() if isinstance(part, str) else part
        whole.update(len(content).to_bytes(8, "little"))
        whole.update(content)
    return whole.hexdigest()


def canonical(plain: Any) -> str:
    """JSON of plain data on one line, keys sorted; a float is its shortest text that reads back the same."""
    return json.dumps(plain, ensure_ascii=False, sort_keys=True, separators=(",", ":"))


@cache
def source_hash() -> str:
    """Hash of the sources of this package."""
    root = Path(__file__).parent.parent
    files = sorted(root.rglob("*.py"))
    return digest(*(part for f in files for part in (f.relative_to(root).as_posix(), f.read_bytes())))[:16]


def to_plain(value: Any) -> Any:
    """Plain data from which :func:`value_of` restores `value`.

    Raises
    ------
    TypeError
        For a type that cannot be stored.
    """
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return float(value)
    if isinstance(value, np.bool_ | np.integer):
        return value.item()
    if isinstance(value, Structure):
        return {_KIND: "Structure", "names": list(value.names)}
    if isinstance(value, Recording):
        return {_KIND: "Recording", "fingerprint": value.fingerprint}
    if isinstance(value, np.ndarray):
        numbers = np.asarray(value, "<f8")
        return {_KIND: "array", "shape": list(numbers.shape), "bytes": numbers.tobytes().hex()}
    if isinstance(value, Mapping):
        return {_KIND: "mapping", "items": [[to_plain(k), to_plain(v)] for k, v in value.items()]}
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return {_KIND: type(value).__name__, **{f: to_plain(v) for f, v in zip(value._fields, value, strict=True)}}
    if isinstance(value, tuple):
        return {_KIND: "tuple", "items": [to_plain(v) for v in value]}
    if isinstance(value, list):
        return [to_plain(v) for v in value]
    if is_dataclass(value):
        return {_KIND: type(value).__name__, **{f.name: to_plain(getattr(value, f.name)) for f in fields(value)}}
    raise TypeError(f"a {type(value).__name__} cannot be stored as text")


def _from_plain(data: Any) -> Any:
    if isinstance(data, list):
        return [_from_plain(item) for item in data]
    if not isinstance(data, dict):
        return data
    kind = data.pop(_KIND)
    if kind == "Structure":
        return Structure.of(data["names"])
    if kind == "array":
        return np.frombuffer(bytes.fromhex(data["bytes"]), "<f8").reshape(data["shape"]).astype(np.float64)
    if kind == "mapping":
        return {_from_plain(k): _from_plain(v) for k, v in data["items"]}
    if kind == "tuple":
        return tuple(_from_plain(item) for item in data["items"])
    return _results()[kind](**{name: _from_plain(item) for name, item in data.items()})


def text_of(result: Any) -> str:
    """Text of the result of an evaluation."""
    return canonical(to_plain(result))


def value_of(text: str) -> Any:
    """Result of an evaluation from its text."""
    return _from_plain(json.loads(text))


def name_of(function: Callable[..., Any]) -> str:
    """Name of a function, or of the class of an object that is called."""
    named = function if hasattr(function, "__qualname__") else type(function)
    return f"{named.__module__}.{named.__qualname__}"


def call_text(function: Callable[..., Any], arguments: tuple[Any, ...]) -> str:
    """Text of a call, with the state of an object that is called."""
    state: Any = function
    own = to_plain(state) if is_dataclass(state) else None
    return canonical([name_of(function), own, [to_plain(a) for a in arguments]])
