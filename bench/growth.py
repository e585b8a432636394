"""How a fit and a search grow: time and memory over the samples, and over the number of effects that may be there.

    python bench/growth.py samples [1000 10000 100000 1000000] [--save]
    python bench/growth.py atoms [13 16 20 24] [--save]
    python bench/growth.py picture

All data come from the reference solver, with 0.2 % noise, rounded to four digits. Each line of a table is measured in a
process of its own, with the kernel compiled before. `samples` fits a given structure and searches with nothing given,
each for recordings of one drive that differ in length. `atoms` searches in the paper's function set with friction and
gravity at every mass and a gap in every shaft, in this order. The drive has three effects that the paper has not.
"""

from __future__ import annotations

import json
import multiprocessing
import resource
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from brightgrey import identify
from brightgrey.arrays import Array
from brightgrey.estimation.problem.scales import scales
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER, Grammar, Structure
from brightgrey.recordings import Recording
from brightgrey.report.charts.chart import Chart, Line, Panel
from brightgrey.report.drawing.matplotlib_figure import draw, picture
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.search.decision import decide_structures
from brightgrey.search.evidence import Evidence
from brightgrey.search.lattice import Lattice
from brightgrey.search.task import IdentificationTask
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference
from support.drives import excitation, simulated_recording
from support.results import RESULTS, Table, arguments, publish

DIAGRAM = Path(RESULTS).parents[1] / "docs" / "pictures" / "growth.svg"
VALUES = {
    "J1": 0.012,
    "J2": 0.008,
    "c1": 60.0,
    "d1": 0.03,
    "M_C": 0.5,
    "f_v": 0.01,
    "M_C@2": 0.6,
    "f_v@2": 0.02,
    "M_G@2": 0.5,
}
MANY_EFFECTS = "two_mass+coulomb+viscous+coulomb@2+viscous@2+gravity@2"
FURTHER = (
    *(("coulomb", 2), ("viscous", 2), ("gravity", 2), ("stribeck", 2), ("backlash", 2)),
    *(("coulomb", 3), ("viscous", 3), ("gravity", 3), ("stribeck", 3), ("backlash", 3)),
    *(("coulomb", 4), ("viscous", 4), ("gravity", 4), ("stribeck", 4)),
)
PAPER_ATOMS = 10
LONG = "two_mass+coulomb+viscous"
NOISE = 2e-3
MOST_SEARCHED = 100_000  # samples: ten times as many have not been searched to the end
Found = Mapping[str, Sequence[str]]
GIVEN, NOTHING_GIVEN = "structure given", "nothing given"
BY_SAMPLES = f"Samples of one recording; the drive is `{LONG}`"
BY_ATOMS = f"Effects that may be there; the drive is `{MANY_EFFECTS}`"


class Measured(NamedTuple):
    """What a process took, and what it found."""

    wall: float  #: s.
    cpu: float  #: s.
    memory: float  #: MB at most.
    found: Found


def measured(task: Callable[[int], Measured], size: int) -> Measured:
    """Run a task in a fresh process."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(1) as pool:
        return pool.apply(_within, (task, size))


def _within(task: Callable[[int], Measured], size: int) -> Measured:
    limit_blas_threads()
    identify(recording(LONG, motion(PAPER_EXPERIMENT.samples)), LONG)  # compiles both solvers
    return task(size)


def timed(run: Callable[[], Found]) -> Measured:
    """What a part of this process takes."""
    before, began = resource.getrusage(resource.RUSAGE_SELF), time.perf_counter()
    found = run()
    wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_SELF)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Measured(wall, cpu, after.ru_maxrss / 1e3, found)


def motion(samples: int) -> Array:
    """Multisines of 1,800 samples one after another, each with phases of its own, in N m."""
    rng, pieces = np.random.default_rng(7), -(-samples // PAPER_EXPERIMENT.samples)
    return np.concatenate([excitation("multisine", rng) for _ in range(pieces)])[:samples]


def recording(structure: str, u: Array) -> Recording:
    """A recording by the reference solver."""
    e, own = PAPER_EXPERIMENT, Structure.parse(structure).parameters
    (v,) = reference(structure, {name: VALUES[name] for name in own}, u, e.dt, f_tanh=e.f_tanh)
    v += NOISE * float(np.abs(v).max()) * np.random.default_rng(8).standard_normal(v.size)
    return simulated_recording(u, np.round(v, 4))


def fit_given(samples: int) -> Measured:
    """Fit the drive's own structure."""
    made = recording(LONG, motion(samples))

    def run() -> Found:
        estimates = identify(made, LONG, check=False).fit.estimates
        return {"off": [f"{abs(estimates[name].value / VALUES[name] - 1.0):.1e}" for name in ("J1", "J2", "c1")]}

    return timed(run)


def search_nothing_given(samples: int) -> Measured:
    """Search for the structure."""
    made = recording(LONG, motion(samples))
    return timed(lambda: decided(identify(made, workers=2, check=False).evidence))


def decided(found: Evidence | None) -> Found:
    """What is told of a search."""
    assert found is not None
    return {
        "fits": [str(found.certificate.fitted)],
        "minimal": [str(r.structure) for r in found.minimal],
        "needed": [c.effect for c in found.cards if c.verdict == "needed"],
    }


def function_set(atoms: int) -> Grammar:
    """The paper's effects and as many further places as make so many atoms."""
    places = {name: list(at) for name, at in PAPER.places.items()}
    for name, place in FURTHER[: atoms - PAPER_ATOMS]:
        places[name].append(place)
    return Grammar(f"{atoms} atoms", {name: tuple(at) for name, at in places.items()})


def search_among(atoms: int) -> Measured:
    """Search in a function set of so many atoms."""
    made = recording(MANY_EFFECTS, excitation("reversing", np.random.default_rng(7)))
    known = scales([made])
    task = IdentificationTask((made,), known, Settings(PAPER_EXPERIMENT.f_tanh, known.speed, "fast"))
    with ThreadPoolExecutor(2) as workers:
        return timed(lambda: decided(decide_structures(task, function_set(atoms), executor=workers).evidence))


def samples_table(sizes: Sequence[int]) -> Table:
    """Time and memory over the samples."""
    rows = []
    searched = [n for n in sizes if n <= MOST_SEARCHED]
    for kind, task, numbers in ((GIVEN, fit_given, sizes), (NOTHING_GIVEN, search_nothing_given, searched)):
        for samples in numbers:
            took = measured(task, samples)
            off = f"inertias and spring off by {', '.join(took.found.get('off', ()))}"
            found = off if kind == GIVEN else minimal(took.found, LONG)
            rows.append([kind, f"{samples:,}", f"{took.wall:.1f}", f"{took.cpu:.1f}", f"{took.memory:.0f}", found])
            print(rows[-1], flush=True)
    return Table(BY_SAMPLES, ["search", "samples", "wall s", "CPU s", "memory MB", "found"], rows)


def atoms_table(sizes: Sequence[int]) -> Table:
    """Time and memory over the effects that may be there."""
    rows = []
    for atoms in sizes:
        took = measured(search_among, atoms)
        structures, (fits,) = f"{Lattice.of(function_set(atoms)).size:,}", took.found["fits"]
        numbers = [f"{took.wall:.0f}", f"{took.cpu:.0f}", f"{took.memory:.0f}"]
        needed = ", ".join(took.found["needed"])
        rows.append([str(atoms), structures, fits, *numbers, minimal(took.found, MANY_EFFECTS), needed])
        print(rows[-1], flush=True)
    columns = ["atoms", "structures", "fits", "wall s", "CPU s", "memory MB", "minimal structures", "needed"]
    return Table(BY_ATOMS, columns, rows)


def minimal(found: Found, truth: str) -> str:
    """Number of minimal structures, and whether the truth is among them."""
    own = found["minimal"]
    return f"{len(own)} minimal{', the truth among them' if str(Structure.parse(truth)) in own else ''}"


def diagram() -> str:
    """Time and memory over the samples, from the table that was saved last."""
    tables = json.loads((RESULTS / "growth.json").read_text(encoding="utf-8"))["tables"]
    (rows,) = (t["rows"] for t in tables if t["title"] == BY_SAMPLES)
    panels = []
    for column, label in ((3, "CPU time in s"), (4, "memory in MB")):
        lines = []
        for kind, colour in ((GIVEN, "measured"), (NOTHING_GIVEN, "simulated")):
            points = [(float(r[1].replace(",", "")), float(r[column])) for r in rows if r[0] == kind]
            x, y = np.array(points).T
            lines.append(Line(x, y, kind, colour))
        panels.append(Panel(label, tuple(lines), "samples", x_log=True, y_log=True))
    return picture(draw([Chart("growth", tuple(panels))]), "svg").decode()


def main() -> None:
    """Measure or draw."""
    limit_blas_threads()
    parser = arguments(__doc__)
    parser.add_argument("what", choices=("samples", "atoms", "picture"))
    parser.add_argument("sizes", type=int, nargs="*")
    options = parser.parse_args()
    if options.what == "picture":
        DIAGRAM.write_text(diagram(), encoding="utf-8")
    elif options.what == "samples":
        publish("growth", [samples_table(options.sizes or [1000, 10_000, 100_000, 1_000_000])], to_file=options.save)
    else:
        publish("growth", [atoms_table(options.sizes or [13, 16, 20, 24])], to_file=options.save)


if __name__ == "__main__":
    main()
