"""Start-up of the command line: whole processes, beside the imports that they cannot do without.

    python bench/startup.py [--rounds 5]

Rounds of all processes alternate, and medians of differences within one round are quoted, as wall and as CPU time: on a
machine that others use, too, only the latter holds. `identify` searches nothing, because the structure of the demo
recording is given; each of its runs has a folder of its own, since a finished run would only be shown again. The
kernel's cache is warm, and the bytecode of the package is on the disk, as after an installation.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from importlib.resources import files

import numpy as np

from brightgrey.excitation import PAPER_EXPERIMENT
from support.results import Table, arguments, publish

LIBRARIES = "import numpy, scipy.linalg, numba"
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
DEMO = str(files("brightgrey.excitation").joinpath("data/demo.csv"))


def seconds(command: Sequence[str]) -> np.ndarray:
    """Wall time and CPU time of a process."""
    wall, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=ENVIRONMENT)
    wall, after = time.perf_counter() - wall, resource.getrusage(resource.RUSAGE_CHILDREN)
    return np.array([wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime])


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    python, program = [sys.executable, "-c"], [sys.executable, "-m", "brightgrey"]
    with tempfile.TemporaryDirectory() as folder:
        given = ["--structure", PAPER_EXPERIMENT.structure, "--input", "torque", "--output", "velocity"]
        commands = {
            "python -c pass": [*python, "pass"],
            "brightgrey --help": [*program, "--help"],
            f"python -c '{LIBRARIES}'": [*python, LIBRARIES],
            "import brightgrey": [*python, "import brightgrey"],
            "brightgrey identify, structure given": [*program, "identify", DEMO, *given, "--out", f"{folder}/{{}}"],
        }
        times: dict[str, list[np.ndarray]] = {name: [] for name in commands}
        for run in range(1 + options.rounds):  # the first one fills the caches
            for name, command in commands.items():
                taken = seconds([part.format(run) if part.startswith(folder) else part for part in command])
                times[name] += [taken] if run else []
    bare, shown, libraries, package, identify = times

    def cells(differences: Iterable[np.ndarray]) -> list[str]:
        """Medians of wall time and CPU time."""
        return [f"{t:.2f}" for t in np.median(list(differences), axis=0)]

    def beyond(name: str, base: str, goal: str) -> list[str]:
        """Row of the differences of two processes within one round."""
        apart = [a - b for a, b in zip(times[name], times[base], strict=True)]
        return [f"`{name}`", f"`{base}`", *cells(apart), goal]

    processes = [[f"`{name}`", *cells(taken)] for name, taken in times.items()]
    differences = [beyond(shown, bare, "0.3"), beyond(package, bare, ""), beyond(identify, libraries, "1.0")]
    columns = ["process", "beyond", "wall s", "CPU s", "goal, at most"]
    tables = [
        Table("Whole processes", ["process", "wall s", "CPU s"], processes),
        Table("Beyond a process that does less", columns, differences),
    ]
    publish("startup", tables, to_file=options.save)


if __name__ == "__main__":
    main()
