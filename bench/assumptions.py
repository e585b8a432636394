"""Do verdicts depend on numbers that the user does not give? Each is halved and doubled over random drives.

    python bench/assumptions.py run 0 50 --seed 23     drives 0 to 49, added to the file of the seed
    python bench/assumptions.py table --seed 23

A drive of the paper's function set, with 1 % noise, is searched once. Then its fits are refined and decided anew with
each number halved and doubled. Structures that a decision asks for are fitted, too. What a search with another number
would have missed is not asked.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from unittest import mock

from brightgrey.api.to_si import identification_task
from brightgrey.estimation.diagnostics.options import DIAGNOSTIC_DEFAULTS
from brightgrey.estimation.noise import autoregression, error_floor
from brightgrey.kit import PAPER, Placed, Structure
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.search.border import Border
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.decision import evidence_of
from brightgrey.search.lattice import Lattice, has
from brightgrey.search.parallel import InlineExecutor
from brightgrey.search.policy import SELECTION
from brightgrey.search.task import IdentificationTask
from recovery import visible
from support.drives import RandomDrive
from support.results import RESULTS, Table, code_version, publish
from support.rows import add_rows, drives_left, read_rows, row_arguments
from support.statistics import share_of

NOISE = 0.01
FACTORS = (0.5, 2.0)


@contextmanager
def changed(options: object, name: str, value: float) -> Iterator[None]:
    """A field of a frozen dataclass has another value."""
    before = getattr(options, name)
    object.__setattr__(options, name, value)
    try:
        yield
    finally:
        object.__setattr__(options, name, before)


def as_given(task: IdentificationTask, factor: float) -> IdentificationTask:
    """The task as it is."""
    return task


def unchanged(factor: float) -> AbstractContextManager[object]:
    """Nothing is changed."""
    return nullcontext()


def with_scale(name: str) -> Callable[[IdentificationTask, float], IdentificationTask]:
    """Change a scale of the recording."""
    return lambda task, factor: replace(
        task, scales=replace(task.scales, **{name: factor * getattr(task.scales, name)})
    )


def with_width(task: IdentificationTask, factor: float) -> IdentificationTask:
    """Change both ends of the range of the width of friction's reversal."""
    width = task.friction_width
    assert width is not None
    return replace(task, friction_width=replace(width, low=factor * width.low, high=factor * width.high))


def trusted_accuracy(factor: float) -> AbstractContextManager[object]:
    """Change the trusted accuracy of simulation and sensor."""
    return mock.patch.object(error_floor.error_variances, "__defaults__", (factor * error_floor.TRUSTED_ACCURACY,))


def highest_order(factor: float) -> AbstractContextManager[object]:
    """Change the highest order of the noise model."""
    burg = autoregression.burg
    return mock.patch.object(autoregression, "burg", lambda x, highest: burg(x, max(int(factor * highest), 1)))


def size_that_matters(factor: float) -> AbstractContextManager[object]:
    """Change the size of every effect from which it matters."""
    relevant = Placed.relevant_size

    def size(placed: Placed, scales: object, values: Mapping[str, float]) -> dict[str, float]:
        return {name: factor * value for name, value in relevant(placed, scales, values).items()}

    return mock.patch.object(Placed, "relevant_size", size)


def of_selection(name: str, offset: float = 0.0) -> Callable[[float], AbstractContextManager[object]]:
    """Change the distance of a number of `SelectionPolicy` from `offset`."""
    value = getattr(SELECTION, name)
    return lambda factor: changed(SELECTION, name, offset + factor * (value - offset))


@dataclass(frozen=True)
class Assumption:
    """A number, and how it is changed: in the task, or while the search runs."""

    name: str
    value: str
    of_task: Callable[[IdentificationTask, float], IdentificationTask] = as_given
    during: Callable[[float], AbstractContextManager[object]] = unchanged


NOTHING = Assumption("nothing", "")
ASSUMPTIONS = (
    Assumption("range of the width of friction's reversal", "1e-4 to 0.1 of the largest speed", with_width),
    Assumption("largest speed", "of the recording", with_scale("speed")),
    Assumption("largest torque", "of the recording", with_scale("torque")),
    Assumption("highest order of the noise model", "10 log10(samples)", during=highest_order),
    Assumption("level of a false alarm", "2 %", during=of_selection("false_alarm_level")),
    Assumption("difference that matters", "0.5 % of the sum of squares", during=of_selection("min_rss_ratio", 1.0)),
    Assumption("size that matters", "of each effect", during=size_that_matters),
    Assumption("probability of missing an effect of that size", "20 %", during=of_selection("min_power", 1.0)),
    Assumption("trusted accuracy", "1e-4 of the standard deviation", during=trusted_accuracy),
    Assumption(
        "level of a sign of model error",
        "1 %",
        during=lambda f: changed(DIAGNOSTIC_DEFAULTS, "symptom_level", f * DIAGNOSTIC_DEFAULTS.symptom_level),
    ),
)


def said(search: BorderSearch, border: Border, truth: Structure) -> dict[str, object]:
    """What is kept of one decision."""
    found = evidence_of(search, border, PAPER, ask=False)
    return {
        "verdicts": {c.effect: c.verdict for c in found.cards},
        "minimal": [str(r.structure) for r in found.minimal],
        "optional": list(found.optional),
        "covered": any(visible(r.structure, truth, found.optional) for r in found.minimal),
    }


def examine(seed: int, number: int) -> dict[str, object]:
    """One row of the file."""
    drive = RandomDrive(seed, number, list(PAPER.structures()))
    task = identification_task([drive.recordings(NOISE)[0]], None, {}, {}, None)
    begin = time.process_time()
    executor, lattice = InlineExecutor(lambda: False), Lattice.of(PAPER)
    search = BorderSearch(task.decimated(), lattice, executor, drive.seed)
    search.run()

    def decided(assumption: Assumption = NOTHING, factor: float = 1.0) -> dict[str, object]:
        """Decide anew from the fits of the search."""
        own = BorderSearch(assumption.of_task(task.decimated(), factor), lattice, executor, drive.seed)
        own.fits.done.update(search.fits.done)
        own.fits.anchors.update(search.fits.anchors)
        own.fits.agreeing.update(search.fits.agreeing)
        own.restarts, own.tops, own.thorough = dict(search.restarts), set(search.tops), search.thorough
        with assumption.during(factor):
            return said(own, own.in_rounds(), drive.truth)

    return {
        "code": code_version(),
        "seed": seed,
        "number": number,
        "truth": str(drive.truth),
        "nothing": decided(),
        "changed": {a.name: {str(f): decided(a, f) for f in FACTORS} for a in ASSUMPTIONS},
        "seconds": round(time.process_time() - begin, 1),
    }


def other_verdicts(row: Mapping, found: Mapping, verdict: str) -> list[str]:
    """Effects that have a verdict now and had another one, or the reverse."""
    before, now = row["nothing"]["verdicts"], found["verdicts"]
    return [e for e in before if (before[e] == verdict) != (now.get(e) == verdict)]


def line(row: Mapping) -> str:
    """One drive in words."""
    changes = {
        f"{name} x {factor}": other_verdicts(row, found, "needed")
        for name, by_factor in row["changed"].items()
        for factor, found in by_factor.items()
    }
    changes = {what: effects for what, effects in changes.items() if effects}
    return f"{row['number']:4d} {row['truth']} {row['seconds']} s: {changes or 'the same effects are needed'}"


def cells(rows: Sequence[Mapping], found: Callable[[Mapping], Mapping]) -> list[str]:
    """Drives in which effects lose or get a verdict, drives that are covered, and effects falsely needed."""
    shown = [found(row) for row in rows]
    changes = [
        str(sum(bool(other_verdicts(row, f, verdict)) for row, f in zip(rows, shown, strict=True)))
        for verdict in ("needed", "not needed")
    ]
    needed = [
        has(Structure.parse(row["truth"]), e)
        for row, f in zip(rows, shown, strict=True)
        for e, verdict in f["verdicts"].items()
        if verdict == "needed"
    ]
    false = f"{len(needed) - sum(needed)} of {len(needed)}"
    return [*changes, share_of([bool(f["covered"]) for f in shown]), false]


def tables(rows: Sequence[Mapping]) -> list[Table]:
    """Drives by what is changed."""
    made = [["nothing", "", "", *cells(rows, lambda row: row["nothing"])]]
    for a in ASSUMPTIONS:
        for factor, word in zip(FACTORS, ("halved", "doubled"), strict=True):
            found = cells(rows, lambda row, a=a, factor=factor: row["changed"][a.name][str(factor)])
            made.append([a.name, a.value, word, *found])
    columns = ["number", "value", "", "*needed* changes", "*not needed* changes", "covered", "falsely *needed*"]
    return [Table(f"Verdicts on {len(rows)} random drives with a number changed", columns, made)]


def main() -> None:
    """Run or show."""
    limit_blas_threads()
    parser = row_arguments(__doc__, last=50, seed=23)
    options = parser.parse_args()
    path = RESULTS / f"assumptions_seed{options.seed}.jsonl.gz"
    if options.what == "run":
        code_version()  # before anybody changes it while rows are made
        left = drives_left(path, options.seed, options.first, options.last)
        add_rows(path, left, lambda number: [examine(options.seed, number)], line)
    publish("assumptions", tables(read_rows(path)), to_file=options.save)


if __name__ == "__main__":
    main()
