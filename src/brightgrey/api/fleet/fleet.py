"""Identification of many axes with the same options, and the axes that differ from the others."""

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

__all__ = ["SUMMARY_TABLE", "Fleet", "Member", "identify_fleet"]

SUMMARY_TABLE = "summary.csv"
COMMON = "common"
_RESIDUAL = "residual of {}"
Read = Callable[[Path, Mapping[str, Any]], Recording]
Summary = Callable[[Result, Path], str]


@dataclass(frozen=True)
class Member:
    """Result of one axis.

    Attributes
    ----------
    name : str
    folder : Path
    model : Model or None
        None if the identification failed.
    compared : Model or None
        Model of the structure by which the whole fleet is compared.
    error : str or None
        Reason why there is no model, or no model to compare.
    stopped : bool
        The search was stopped, and the model is the best one so far.
    differs : tuple of str
        Quantities in which the axis differs from the others, each with its deviation.
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
    """Result of :func:`identify_fleet`.

    Attributes
    ----------
    members : tuple of Member
        In the order of the manifest.
    structure : str or None
        Structure by which the axes are compared.
    quantities : mapping of str to Compared
        Parameters, and the residual of every output.
    """

    members: tuple[Member, ...]
    structure: str | None
    quantities: Mapping[str, Compared] = field(repr=False)

    def csv(self) -> str:
        """Table with one row per axis, as CSV text; values in the recordings' units."""
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


def identify_fleet(
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
    summary: Summary = lambda result, folder: "",
    **options: Any,
) -> Fleet:
    """Identify every axis into a folder of its own, compare the axes and write ``summary.csv``.

    The axes are compared by the parameters of the given structure, or of the structure that was found most often. An
    axis with another structure is fitted with the common one, too, into its folder ``common``. The same call
    continues an interrupted run.

    Parameters
    ----------
    axes : sequence of Axis
    folder : str or Path
    read : callable
        ``read(path, options)`` returns the recording at `path`; the options are those of its axis.
    structure : str, optional
        Without it the structure of every axis is searched for.
    executor, budget, stop, restart
        As for :func:`identify_resumable`. The budget is that of each axis.
    done : callable
        Called with the `Member` of every axis that is finished.
    summary : callable
        ``summary(result, folder)`` returns the text that is stored with the result of an axis.
    options
        Further arguments of :func:`identify`.

    Returns
    -------
    Fleet

    Raises
    ------
    BrightgreyError
        If `folder` cannot be written to, or another process uses it. The error of a single axis is part of its
        `Member` instead.

    Examples
    --------
    >>> def read(path, options):
    ...     return read_recording(path, input="torque", outputs=["velocity"])
    >>> fleet = identify_fleet(read_manifest("fleet.csv"), "fleet", read, "one_mass+coulomb")  # doctest: +SKIP
    """
    target = check_folder(folder)
    same = {"executor": executor, "budget": budget, "stop": stop, "restart": restart}
    members = []
    with exclusive_folder(target):
        for axis in axes:
            into = target / axis.name
            if stop is not None and stop.requested:
                member = Member(axis.name, into, error="not started")
            else:
                member = _identify_axis(axis, into, read, summary, structure, {**same, **options})
            members.append(member)
            done(member)
        common = structure or _most_frequent_structure(members)
        if common is not None:
            alike = {**same, **_for_structure(common, options)}
            for number, (axis, m) in enumerate(zip(axes, members, strict=True)):
                if m.model is not None and not m.stopped:
                    own = str(m.model.structure) == common
                    other = m if own else _identify_axis(axis, m.folder / COMMON, read, summary, common, alike)
                    members[number] = replace(m, compared=other.model, error=other.error)
        quantities = _compare_models([m.compared for m in members])
        found = Fleet(tuple(_with_differences(m, i, quantities) for i, m in enumerate(members)), common, quantities)
        write_file(target / SUMMARY_TABLE, found.csv().encode())
    return found


def _identify_axis(
    axis: Axis, into: Path, read: Read, summary: Summary, structure: str | None, options: Mapping[str, Any]
) -> Member:
    """Identify one axis; an error is part of the result."""
    try:
        recordings = [read(path, axis.options) for path in axis.recordings]
        stored = identify_resumable(
            into, recordings, structure, summary=lambda result: summary(result, into), **options
        )
        return Member(axis.name, into, stored.model, stopped=stored.stopped)
    except (BrightgreyError, OSError) as error:
        return Member(axis.name, into, error=str(error))
    except Exception as error:  # whatever it is, the other axes go on
        return Member(axis.name, into, error=f"{type(error).__name__}: {error}")


def _for_structure(structure: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a search as options of a fit of one structure."""
    known = function_set().parse(structure).parameters
    left = {name: value for name, value in options.items() if name not in ("search", "grammar", "require", "exclude")}
    for name in ("bounds", "fixed"):
        left[name] = {p: value for p, value in (left.get(name) or {}).items() if p in known}
    return left


def _most_frequent_structure(members: Sequence[Member]) -> str | None:
    """Structure that was found most often; of several the one with the fewest parameters."""
    found = [m.model.structure for m in members if m.model is not None and not m.stopped]
    if not found:
        return None
    counts = Counter(found)
    return str(min(counts, key=lambda s: (-counts[s], len(s.parameters), str(s))))


def _compare_models(models: Sequence[Model | None]) -> dict[str, Compared]:
    """Compare parameters and residuals of the models that there are."""
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
    """Value and standard deviation of a parameter, or of its logarithm if `log`; NaN if it was not estimated."""
    part = model.parameters[name] if model else None
    if part is None or part.std is None or part.at_bound or not part.std > 0.0:
        return math.nan, math.nan
    return (math.log(part.value), part.std / part.value) if log else (part.value, part.std)


def _logarithm(value: float | None) -> float:
    return math.log(value) if value else math.nan


def _with_differences(member: Member, number: int, quantities: Mapping[str, Compared]) -> Member:
    """Add the quantities in which an axis differs from the others."""
    differs = tuple(
        f"{name} {c.deviation[number]:+.1f} (limit {c.threshold:.1f})"
        for name, c in quantities.items()
        if bool(c.different[number])
    )
    return replace(member, differs=differs)
