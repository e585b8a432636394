"""Start-up of the command line: whole processes, beside the imports that they cannot do without.

    python bench/startup.py [--rounds 5]

Rounds of all processes alternate, and medians of differences within one round are quoted. `identify` searches nothing:
the structure of the demo recording is given. The kernel's cache is warm.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from importlib.resources import files

from brightgrey.excitation import PAPER_EXPERIMENT
from support.results import Table, arguments, publish

LIBRARIES = "import numpy, scipy.linalg, numba, pint"
DEMO = str(files("brightgrey.excitation").joinpath("data/demo.csv"))


def seconds(command: Sequence[str]) -> float:
    """Wall time of a process."""
    begin = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin


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
            "brightgrey identify, structure given": [*program, "identify", DEMO, *given, "--out", f"{folder}/out"],
        }
        for command in commands.values():
            seconds(command)  # fills the caches
        times: dict[str, list[float]] = {name: [] for name in commands}
        for _ in range(options.rounds):
            for name, command in commands.items():
                times[name].append(seconds(command))
    bare, shown, libraries, package, identify = times
    rows = [[f"`{name}`", f"{statistics.median(taken):.2f}"] for name, taken in times.items()]

    def beyond(name: str, base: str, goal: str) -> list[str]:
        """Difference of two processes within one round, median of the rounds."""
        apart = statistics.median(a - b for a, b in zip(times[name], times[base], strict=True))
        return [f"`{name}`", f"`{base}`", f"{apart:.2f}", goal]

    differences = [
        beyond(shown, bare, "0.3"),
        beyond(package, bare, ""),
        beyond(identify, libraries, "1.0"),
    ]
    tables = [
        Table("Whole processes", ["process", "median s"], rows),
        Table("Beyond a process that does less", ["process", "beyond", "s", "goal, at most"], differences),
    ]
    publish("startup", tables, to_file=options.save)


if __name__ == "__main__":
    main()
