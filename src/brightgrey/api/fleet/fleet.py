"""Many axes with the same options: one folder and one row each, and which of them differs from its siblings."""

from __future__ import annotations

import csv
import io
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from brightgrey.api.fleet.manifest import Axis
from brightgrey.api.fleet.outliers import Compared, compare
from brightgrey.api.result import Result
from brightgrey.api.resumable import identify_resumable
from brightgrey.errors import BrightgreyError
from brightgrey.kit import function_set
from brightgrey.model.files import check_folder, write_file
from brightgrey.model.model import Model
from brightgrey.recordings import Recording
from brightgrey.runs import Budget, Stop
from brightgrey.runs.store import exclusive_folder

__all__ = ["SUMMARY", "Fleet", "Member", "fleet"]

SUMMARY = "summary.csv"
COMMON = "common"
_RESIDUAL = "residual of {}"
Read = Callable[[Path, Mapping[str, Any]], Recording]
Printed = Callable[[Result, Path], str]


@dataclass(frozen=True)
class Member:
    """What became of one axis.

    Attributes
    ----------
    name : str
    folder : Path
    model : Model or None
        Its own; None if there is none.
    compared : Model or None
        That of the structure which the whole fleet is compared by.
    error : str or None
        Why there is none, or why it cannot be compared.
    stopped : bool
        The search was stopped: this is the best so far.
    differs : tuple of str
        In what it differs from its siblings, each with its deviation.
    """

    name: str
    folder: Path
    model: Model | None = field(default=None, repr=False)
    compared: Model | None = field(default=None, repr=False)
    error: str | None = None
    stopped: bool = False
    differs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Fleet:
    """Result of :func:`fleet`.

    Attributes
    ----------
    members : tuple of Member
        In the order of the manifest.
    structure : str or None
        By which they are compared.
    quantities : mapping of str to Compared
        Parameters, and the residual of every output.
    """

    members: tuple[Member, ...]
    structure: str | None
    quantities: Mapping[str, Compared] = field(repr=False)

    def csv(self) -> str:
        """One row for each axis; values in the recordings' units."""
        names = list(dict.fromkeys(n for m in self.members if m.compared for n in m.compared.parameters))
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        columns = [cell for n in names for cell in (n, f"{n} std")]
        writer.writerow(("name", "state", "structure", "fit_percent", "outcome", "differs", *columns, "error"))
        for m in self.members:
            fits = [f.fit_percent for f in m.model.fit.train.values()] if m.model else []
            known = [f for f in fits if f is not None]
            parts = [m.compared.parameters.get(n) if m.compared else None for n in names]
            cells = [repr(v) if v is not None else "" for p in parts for v in ((p.value, p.std) if p else (None, None))]
            about = (
                ("+".join(m.model.effects), repr(float(np.mean(known))) if known else "", m.model.outcome.text)
                if m.model
                else ("", "", "")
            )
            state = "failed" if m.model is None else "stopped" if m.stopped else "done"
            writer.writerow((m.name, state, *about, "; ".join(m.differs), *cells, m.error or ""))
        return text.getvalue()


def fleet(
    axes: Sequence[Axis],
    folder: str | Path,
    read: Read,
    structure: str | None = None,
    *,
    executor: Executor | None = None,
    budget: Budget | None = None,
    stop: Stop | None = None,
    restart: bool = False,
    done: Callable[[Member], None] = lambda member: None,
    printed: Printed = lambda result, folder: "",
    **options: Any,
) -> Fleet:
    """Identify every axis into a folder of its own, compare them and write the summary.

    With a given structure its parameters are compared, else those of the structure that was found most often; axes
    where another one was found are fitted with it once more, into the folder ``common`` within theirs. Called again it
    goes on where it was interrupted.

    Parameters
    ----------
    axes : sequence of Axis
    folder : str or Path
    read : callable
        ``read(path, options of the axis)`` gives a recording.
    structure : str, optional
    executor, budget, stop, restart
        See :func:`brightgrey.api.resumable.identify_into`; the budget is that of each axis.
    done : callable
        Called with every axis that has come to its end.
    printed : callable
        ``printed(result, folder)``, see there.
    options
        Of :func:`brightgrey.identify`.

    Raises
    ------
    BrightgreyError
        If `folder` cannot be written to, or another process is at work in it. What goes wrong with an axis stands in
        its row.
    """
    target = check_folder(folder)
    same = {"executor": executor, "budget": budget, "stop": stop, "restart": restart}
    members = []
    with exclusive_folder(target):
        for axis in axes:
            into = target / axis.name
            if stop is not None and stop.told:
                member = Member(axis.name, into, error="not begun")
            else:
                member = _made(axis, into, read, printed, structure, {**same, **options})
            members.append(member)
            done(member)
        common = structure or _common(members)
        if common is not None:
            alike = {**same, **_for_structure(common, options)}
            for number, (axis, m) in enumerate(zip(axes, members, strict=True)):
                if m.model is not None and not m.stopped:
                    own = str(m.model.structure) == common
                    other = m if own else _made(axis, m.folder / COMMON, read, printed, common, alike)
                    members[number] = replace(m, compared=other.model, error=other.error)
        quantities = _compared([m.compared for m in members])
        found = Fleet(tuple(_judged(m, i, quantities) for i, m in enumerate(members)), common, quantities)
        write_file(target / SUMMARY, found.csv().encode())
    return found


def _made(
    axis: Axis, into: Path, read: Read, printed: Printed, structure: str | None, options: Mapping[str, Any]
) -> Member:
    """Identify one axis; what goes wrong is part of the result."""
    try:
        recordings = [read(path, axis.options) for path in axis.recordings]
        kept = identify_resumable(into, recordings, structure, printed=lambda result: printed(result, into), **options)
        return Member(axis.name, into, kept.model, stopped=kept.stopped)
    except (BrightgreyError, OSError) as error:
        return Member(axis.name, into, error=str(error))
    except Exception as error:  # whatever it is, the other axes go on
        return Member(axis.name, into, error=f"{type(error).__name__}: {error}")


def _for_structure(structure: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a search as options of a fit of one structure."""
    known = function_set().parse(structure).parameters
    left = {name: value for name, value in options.items() if name not in ("search", "require", "exclude")}
    for name in ("bounds", "fixed"):
        left[name] = {p: value for p, value in (left.get(name) or {}).items() if p in known}
    return left


def _common(members: Sequence[Member]) -> str | None:
    """Structure that was found most often; of several the one with the fewest parameters."""
    found = [m.model.structure for m in members if m.model is not None and not m.stopped]
    if not found:
        return None
    counts = Counter(found)
    return str(min(counts, key=lambda s: (-counts[s], len(s.parameters), str(s))))


def _compared(models: Sequence[Model | None]) -> dict[str, Compared]:
    """All quantities, of those models that there are."""
    one = next((m for m in models if m is not None), None)
    if one is None:
        return {}
    columns: dict[str, tuple[list[float], list[float]]] = {}
    for name, declared in one.structure.parameters.items():
        pairs = [_parameter(m, name, declared.scale == "log") for m in models]
        columns[name] = [x for x, _ in pairs], [s for _, s in pairs]
    for name in one.fit.train:
        size = [_logarithm(m.fit.train[name].rmse) if m and name in m.fit.train else math.nan for m in models]
        columns[_RESIDUAL.format(name)] = size, [0.0] * len(models)
    return compare(columns)


def _parameter(model: Model | None, name: str, log: bool) -> tuple[float, float]:
    """Value and standard deviation, of the logarithm where the parameter is always positive."""
    part = model.parameters[name] if model else None
    if part is None or part.std is None or part.at_bound or not part.std > 0.0:
        return math.nan, math.nan
    return (math.log(part.value), part.std / part.value) if log else (part.value, part.std)


def _logarithm(value: float | None) -> float:
    return math.log(value) if value else math.nan


def _judged(member: Member, number: int, quantities: Mapping[str, Compared]) -> Member:
    """Say in what an axis differs."""
    differs = tuple(
        f"{name} {c.deviation[number]:+.1f} (limit {c.threshold:.1f})"
        for name, c in quantities.items()
        if bool(c.different[number])
    )
    return replace(member, differs=differs)
