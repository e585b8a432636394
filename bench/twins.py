"""Which effects can no recording tell apart? Pairs of effects, each fitted to noise-free data of the other.

    python bench/twins.py run 0 300 --seed 5     pairs 0 to 299, added to the file of the seed
    python bench/twins.py table --seed 5

A pair is a random structure with one effect of two: the data are those of the first, from the reference solver, and the
second is fitted to them by multistart. What is left is divided by the variance of the output. The structure without
either is fitted, too: where it leaves as little, the effect does not show. Below 1e-6 two effects are twins.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.api.to_si import identification_task
from brightgrey.kit import Placed, Structure, grammar_named
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.search.fitting.structure_fit import Options, fit_multistart, last_descent
from brightgrey.search.task import IdentificationTask
from support.drives import RandomDrive, drawn_structure, last_places
from support.results import RESULTS, Table, code_version, publish
from support.rows import add_rows, drives_left, read_rows, row_arguments

TWIN = 1e-6
SHOWS = 1e-5  # ten times as much: less is neither

EFFORT = Options(fresh=8, patience=1)


@dataclass(frozen=True)
class Pair:
    """Structures that differ in one effect, and what they have in common."""

    common: Structure
    first: Placed
    second: Placed

    @property
    def truth(self) -> Structure:
        """Structure with the first effect."""
        return Structure((*self.common.placed, self.first))

    @property
    def rival(self) -> Structure:
        """Structure with the second effect."""
        return Structure((*self.common.placed, self.second))


def drawn_pair(rng: np.random.Generator) -> Pair:
    """Draw a structure of the function set `drive` and two effects that it may have."""
    grammar = grammar_named("drive").whole
    while True:
        common = drawn_structure(rng)
        chain = next(p for p in common.placed if p.effect.masses)
        last = last_places(chain)
        legal = []
        for p in grammar.placed:
            beside = not p.effect.masses and p not in common.placed and p.place <= last[p.effect.where]
            second_gap = p.effect.has_hard_limit and common.has_hard_limit  # the reference solves one
            if beside and not second_gap and not grammar.broken_rule(Structure((*common.placed, p))):
                legal.append(p)
        if len(legal) > 1:
            first, second = rng.permutation(len(legal))[:2]
            return Pair(common, legal[first], legal[second])


def left_over(task: IdentificationTask, structure: Structure, seed: int) -> float:
    """Mean square of the residual of the best fit over the variance of the output."""
    found = fit_multistart(task, structure, EFFORT, seed)
    names = task.space(structure, nuisances=True).names
    end = last_descent(task, structure, np.array([found.values[n] for n in names]))
    (recording,) = task.recordings
    weight = float(task.problem(structure).weights[0])
    return float(end.cost / weight**2 / recording.samples / recording.y.var())


def examine(seed: int, number: int) -> dict[str, object]:
    """One row of the file."""
    rng = np.random.default_rng([seed, number])
    pair = drawn_pair(rng)
    drive = RandomDrive(seed, number, draw=lambda _: pair.truth)
    task = identification_task([drive.recordings(0.0)[0]], None, {}, {}, None)
    begin = time.process_time()
    rival = left_over(task, pair.rival, seed)
    without = left_over(task, pair.common, seed) if rival < SHOWS else np.nan
    return {
        "code": code_version(),
        "seed": seed,
        "number": number,
        "truth": str(pair.truth),
        "first": str(pair.first),
        "second": str(pair.second),
        "motion": drive.motion,
        "left": rival,
        "without": without,
        "seconds": round(time.process_time() - begin, 1),
    }


def kind(row: Mapping) -> str:
    """What a row says of its pair."""
    if row["left"] >= TWIN:
        return "told apart"
    return "does not show" if row["without"] < SHOWS else "twins"


def line(row: Mapping) -> str:
    """One pair in words."""
    return (
        f"{row['number']:4d} {row['truth']}: {row['first']} by {row['second']} leaves {row['left']:.1e},"
        f" neither {row['without']:.1e}: {kind(row)}, {row['seconds']} s"
    )


def tables(rows: Sequence[Mapping]) -> list[Table]:
    """Counts of all pairs, and the pairs that are alike."""
    kinds = ("told apart", "does not show", "twins")
    counts = [[k, str(sum(kind(r) == k for r in rows))] for k in kinds]
    alike = [
        [f"`{r['truth']}`", f"`{r['first']}`", f"`{r['second']}`", f"{r['left']:.1e}", f"{r['without']:.1e}"]
        for r in rows
        if kind(r) == "twins"
    ]
    columns = ["drive", "its effect", "in its place", "left of the variance", "left without either"]
    return [Table("Pairs of effects", ["pair", "number"], counts), Table("Twins", columns, alike)]


def main() -> None:
    """Run or show."""
    limit_blas_threads()
    parser = row_arguments(__doc__, last=300, seed=5)
    options = parser.parse_args()
    path = RESULTS / f"twins_seed{options.seed}.jsonl.gz"
    if options.what == "run":
        code_version()  # before anybody changes it while rows are made
        left = drives_left(path, options.seed, options.first, options.last)
        add_rows(path, left, lambda number: [examine(options.seed, number)], line)
    publish("twins", tables(read_rows(path)), to_file=options.save)


if __name__ == "__main__":
    main()
