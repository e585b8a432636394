"""Files of drives: which are read, what is repaired, and how long a large one takes. Damaged ones: bench/fuzz.py.

    python bench/formats.py [--rows 10000000]

Recorded files come from ../shared/data or the folder BRIGHTGREY_DATA; they are read with the options that `inspect`
suggests. A large file is read in a process of its own, whose memory is that of its peak; 0 rows leave it out.
"""

from __future__ import annotations

import gzip
import io
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from brightgrey import inspect
from support.measured import DATA
from support.results import Table, arguments, publish

SUFFIXES = (".csv", ".mat", ".tdms", ".mf4")
REPAIR = re.compile(r"hole|jitter|interpolat|rounded|left out|missing|repeated|skipped|clock|sampled every")
READ_LARGE = """
import resource, sys, time
start = time.perf_counter()
from brightgrey import read_recording
recording = read_recording(sys.argv[1], input="torque", outputs="velocity")
taken = time.perf_counter() - start
used = resource.getrusage(resource.RUSAGE_SELF)
print(recording.samples, taken, used.ru_utime + used.ru_stime, used.ru_maxrss / 1e6)
"""


def file_rows() -> list[list[str]]:
    """Rows of the recorded files; files of a folder that differ in nothing share one."""
    found: dict[tuple[str, ...], list[str]] = {}
    for path in sorted(p for p in DATA.rglob("*") if p.suffix in SUFFIXES):
        content = inspect(path)
        steps = sorted({f"{1e3 * c.dt:.4g}" for c in content.channels if c.dt}, key=float)
        rate = "not in the file" if content.options.get("dt") or not steps else ", ".join(steps)
        repairs = "; ".join(note for note in content.notes if REPAIR.search(note)) or "none"
        key = (path.parent.name, content.format, str(content.samples), str(len(content.channels)), rate, repairs)
        found.setdefault(key, []).append(path.name)
    rows = []
    for (folder, *rest), names in found.items():
        shown = f"{folder}/{names[0]}" + (f" and {len(names) - 1} more" if len(names) > 1 else "")
        rows.append([shown, *rest])
    return rows


HEAD = "t,torque,velocity,position"
SCOPE = "Name,axis,,,\n\nName,torque,velocity,position\nSampleTime[ms],0.1,0.1,0.1\nUnit,Nm (M),rad/s (V),rad (P)\n"
LARGE: tuple[tuple[str, str, str, float, Callable[..., Any]], ...] = (
    ("delimited", HEAD, ",", 1.0, Path.open),
    ("delimited, decimal comma", HEAD, ";", 1.0, Path.open),
    ("delimited, decimal comma, compressed", HEAD, ";", 1.0, partial(gzip.open, compresslevel=1)),
    ("TwinCAT Scope, decimal comma", SCOPE, "\t", 0.4, Path.open),
)
"""Large texts: what they are, head, delimiter, part of the rows, and how they are written."""


def large_rows(rows: int) -> Iterator[list[str]]:
    """Rows of large files of four columns."""
    for title, head, mark, part, opened in LARGE:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "large.csv"
            with opened(path, "wt") as file:
                file.write(head.replace(",", mark) + "\n")
                for start in range(0, int(part * rows), 100_000):
                    file.write(some_lines(start, min(int(part * rows), start + 100_000), mark))
            command = [sys.executable, "-c", READ_LARGE, str(path)]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
            samples, wall, seconds, gigabytes = done.stdout.split()
            size = f"{path.stat().st_size / 1e6:.0f}"
            yield [title, samples, size, f"{float(wall):.0f}", f"{float(seconds):.0f}", f"{float(gigabytes):.2f}"]
            print(title, done.stdout, flush=True)


def some_lines(start: int, end: int, mark: str) -> str:
    """Lines of a large file."""
    k = np.arange(start, end)
    numbers = np.column_stack([k * 1e-4, np.sin(k * 1e-3), np.cos(k * 1e-3), k * 1e-5])
    if mark == "\t":
        numbers[:, 0] *= 1e3  # ms
    text = io.StringIO()
    np.savetxt(text, numbers, fmt="%.9f", delimiter=mark)
    return text.getvalue() if mark == "," else text.getvalue().replace(".", ",")


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--rows", type=int, default=10_000_000)
    options = parser.parse_args()
    tables = [Table("Recorded files", ["file", "format", "samples", "channels", "every ms", "repairs"], file_rows())]
    if options.rows:
        tables.append(
            Table(
                "Large texts",
                ["text", "samples", "MB", "wall s", "processor s", "peak GB"],
                list(large_rows(options.rows)),
            )
        )
    publish("formats", tables, to_file=options.save)


if __name__ == "__main__":
    main()
