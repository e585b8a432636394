"""Accuracy of both levels against the reference solver, over all structures of the paper's grammar.

Every structure is drawn `--per-structure` times with random parameters in plausible ranges and excited by the
torque of the paper's experiment. Errors are relative to the peak of position and velocity, and for acceleration,
which jumps at contacts, RMS relative to RMS. Drives that are chaotic by measurement are listed apart.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np

from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER, Structure, assemble
from brightgrey.simulation import Settings, response
from brightgrey.simulation.reference import UnsettledError, compare_solvers

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
    """Errors of one random drive, or why there is no reference."""
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--per-structure", type=int, default=2)
    parser.add_argument("--every", type=int, default=1, help="only every n-th structure")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--both", action="store_true", help="solve by the slower reference method too")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    names = [str(s) for s in PAPER.structures()][:: options.every]
    jobs = [(name, i, options.seed, options.both) for name in names for i in range(options.per_structure)]
    with ProcessPoolExecutor(options.workers) as pool:
        results = list(pool.map(examine, jobs, chunksize=4))
    unsettled = [r for r in results if isinstance(r, str)]
    found = [r for r in results if isinstance(r, Result)]
    regular = [r for r in found if not r.chaotic]
    print(f"{len(jobs)} drives of {len(names)} structures, seed {options.seed}")
    print(f"without a settled reference {len(unsettled)}, chaotic {len(found) - len(regular)}")
    for line in unsettled:
        print("  ", line)
    if options.both:
        print(f"reference methods apart: worst {max(r.difference for r in regular):.1e} of peak")
    for level, target in TARGETS.items():
        for i, kind in enumerate(OUTPUTS):
            e = np.array([r.errors[level][i] for r in regular])
            above = int((e > target).sum())
            text = f"above {target:.0e}: {above} of {len(e)}" if i < 2 else "(RMS)"
            print(f"{level:9} {kind:13} median {np.median(e):.1e}  worst {np.nanmax(e):.1e}  {text}")
        worst = sorted(regular, key=lambda r: -max(r.errors[level][:2]))[:6]
        for r in worst:
            print(f"    {max(r.errors[level][:2]):.1e}  {r.structure} #{r.number}")
    for r in found:
        if r.chaotic:
            print(f"chaotic: {max(r.errors['accurate'][:2]):.1e}  {r.structure} #{r.number}")


if __name__ == "__main__":
    main()
