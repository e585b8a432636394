"""Accuracy of both levels against the reference solver, over all structures of the paper's grammar.

Every structure is drawn `--per-structure` times with random parameters in plausible ranges and excited by the
torque of the paper's experiment. Errors are relative to the peak of position and velocity, and for acceleration,
which jumps at contacts, RMS relative to RMS. Drives that are chaotic by measurement are listed apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np

from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER, Structure, assemble
from brightgrey.simulation import Settings, response
from brightgrey.simulation.reference import UnsettledError, compare_solvers
from support.results import Table, arguments, publish

OUTPUTS = ("position", "velocity", "acceleration")
TARGETS = {"accurate": 1e-4, "fast": 5e-3}


class Result(NamedTuple):
    """One random drive."""

    structure: str
    number: int
    chaotic: bool
    difference: float
    errors: dict[str, tuple[float, float, float]]


def examine(job: tuple[str, int, int, bool]) -> Result | str:
    """Errors of one random drive, or the reason why there is no reference."""
    name, number, seed, both = job
    structure = Structure.parse(name)
    order = [str(s) for s in PAPER.structures()].index(name)
    rng = np.random.default_rng([seed, order, number])
    values = random_values(structure.parameters, rng)
    experiment = PAPER_EXPERIMENT
    u, dt, f_tanh = experiment.torque(), experiment.dt, experiment.f_tanh
    try:
        known = compare_solvers(structure, values, u, dt, f_tanh=f_tanh, both=both)
    except UnsettledError as why:
        return str(why)
    speed = float(np.abs(known.y[1]).max())
    system = assemble(structure, values, f_tanh, OUTPUTS)
    errors = {}
    for level in ("accurate", "fast"):
        settings = Settings(f_tanh, speed, level)
        y = response(system, u, dt, system.rest(u=u[0]), settings).y[:, :, 0]
        apart = y - known.y
        peaks = [float(np.abs(apart[i]).max() / np.abs(known.y[i]).max()) for i in range(2)]
        rms = float(np.sqrt(np.mean(apart[2] ** 2) / np.mean(known.y[2] ** 2)))
        errors[level] = (peaks[0], peaks[1], rms)
    return Result(name, number, known.chaotic, float(np.nanmax([*known.difference[:2], 0.0])), errors)


def tables(results: Mapping[int, Sequence[Result]]) -> list[Table]:
    """Errors of every output at both levels, the drives with the largest errors, and the chaotic drives."""
    errors: list[list[list[str]]] = [[], [], []]
    largest, chaotic = [], []
    for seed, found in results.items():
        regular = [r for r in found if not r.chaotic]
        e = np.array([[r.errors[level] for level in TARGETS] for r in regular])  # drives, levels, outputs
        for i, rows in enumerate(errors):
            sizes = [f"{size(e[:, k, i]):.1e}" for k in range(len(TARGETS)) for size in (np.median, np.nanmax)]
            rows.append([str(seed), f"{len(regular)}, {len(found) - len(regular)}", *sizes])
        for k, (level, target) in enumerate(TARGETS.items()):
            peaks = e[:, k, :2].max(axis=1)
            worst = ", ".join(f"`{regular[j].structure}` {peaks[j]:.1e}" for j in np.argsort(-peaks)[:3])
            above = f"{int((peaks > target).sum())} of {len(regular)} above {target:.0e}"
            largest.append([str(seed), f"`{level}`", above, worst])
        chaotic += [[str(seed), f"`{r.structure}`", f"{max(r.errors['accurate'][:2]):.1e}"] for r in found if r.chaotic]
    columns = [
        "seed",
        "drives, chaotic apart",
        *(f"`{level}`: {size}" for level in TARGETS for size in ("median", "worst")),
    ]
    return [
        Table("Error of position relative to the peak", columns, errors[0]),
        Table("Error of velocity relative to the peak", columns, errors[1]),
        Table("Error of acceleration, RMS relative to RMS", columns, errors[2]),
        Table("Largest errors of position or velocity", ["seed", "level", "above the limit", "worst drives"], largest),
        Table("Chaotic drives, left out above", ["seed", "structure", "error at `accurate`"], chaotic),
    ]


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--per-structure", type=int, default=2)
    parser.add_argument("--every", type=int, default=1, help="only every n-th structure")
    parser.add_argument("--seed", type=int, nargs="+", default=[1])
    parser.add_argument("--both", action="store_true", help="solve by the slower reference method too")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    names = [str(s) for s in PAPER.structures()][:: options.every]
    results: dict[int, list[Result]] = {}
    for seed in options.seed:
        jobs = [(name, i, seed, options.both) for name in names for i in range(options.per_structure)]
        with ProcessPoolExecutor(options.workers) as pool:
            found = list(pool.map(examine, jobs, chunksize=4))
        results[seed] = [r for r in found if isinstance(r, Result)]
        unsettled = [r for r in found if isinstance(r, str)]
        print(f"seed {seed}: {len(jobs)} drives of {len(names)} structures, {len(unsettled)} without a reference")
        print(*(f"  {line}" for line in unsettled), sep="\n", flush=True)
        if options.both:
            apart = max(r.difference for r in results[seed] if not r.chaotic)
            print(f"reference methods apart: worst {apart:.1e} of peak")
    publish("accuracy", tables(results), to_file=options.save)


if __name__ == "__main__":
    main()
