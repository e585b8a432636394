"""Files of drives: which are read, what is repaired, what damaged ones do, and how long a large one takes.

    python bench/formats.py [--mutations 20000] [--library-mutations 200] [--rows 10000000]

Recorded files come from ../shared/data or the folder BRIGHTGREY_DATA; they are read with the options that `inspect`
suggests. Mutated files are those of tests/recordings/data and files written here, with bytes, tokens and lines changed,
doubled and left out. The large file is read in a process of its own, whose memory is that of its peak.
"""

from __future__ import annotations

import gzip
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import scipy.io

from brightgrey import BrightgreyError, inspect
from brightgrey.recordings.file import open_table
from support.measured import DATA
from support.results import Table, arguments, publish

SUFFIXES = (".csv", ".mat", ".tdms", ".mf4")
REPAIR = re.compile(r"hole|jitter|interpolat|rounded|left out|missing|repeated|skipped|clock|sampled every")
CUTS = Path(__file__).parents[1] / "tests" / "recordings" / "data"
TOKENS = [b"", b"nan", b"1e400", b"-1e31", b"9.91E+37", b"1" * 500, b"\x00", b'"', b";", b",,", b"\xff\xfe", b"1.234,5"]
READ_LARGE = """
import resource, sys, time
start = time.perf_counter()
from brightgrey import read_recording
recording = read_recording(sys.argv[1], input="torque", outputs="velocity")
taken = time.perf_counter() - start
print(recording.samples, taken, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6)
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


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """Return a file with one to four changes."""
    for _ in range(int(rng.integers(1, 5))):
        at, end = sorted(rng.integers(0, len(data) + 1, 2).tolist())
        end = min(end, at + int(rng.integers(1, 200)))
        part, kind = data[at:end], int(rng.integers(0, 6))
        junk = rng.integers(0, 256, max(end - at, 1), dtype=np.uint8).tobytes()
        token = TOKENS[int(rng.integers(0, len(TOKENS)))]
        data = data[:at] + (b"", part + part, junk, token, part[::-1], part.replace(b"0", b"9"))[kind] + data[end:]
    return data


def text_files() -> list[bytes]:
    """Texts to mutate: cut exports, and delimited text with names, plain and compressed."""
    k = np.arange(60)
    lines = ["t [s],torque [N m],velocity [rad/s]", *(f"{i / 100:g},{np.sin(i):.5g},{np.cos(i):.5g}" for i in k)]
    plain = "\n".join(lines).encode()
    german = plain.replace(b",", b";").replace(b".", b",")
    return [*(path.read_bytes() for path in sorted(CUTS.rglob("*.csv"))), plain, german, gzip.compress(plain)]


def library_files() -> list[bytes]:
    """Files of libraries to mutate, of which MAT files are written here."""
    k = np.arange(60.0)
    written = []
    with tempfile.TemporaryDirectory() as folder:
        for options in ({}, {"do_compression": True}, {"format": "4"}):
            path = Path(folder) / "run.mat"
            scipy.io.savemat(path, {"t": k / 100, "u": np.sin(k), "v": np.cos(k)}, **options)
            written.append(path.read_bytes())
    recorded = [p for p in DATA.glob("formats/*") if p.suffix in (".tdms", ".mf4") and p.stat().st_size < 200_000]
    return [*written, *(path.read_bytes() for path in recorded)]


def outcomes(name: str, files: Callable[[], list[bytes]], count: int, seed: int) -> list[str]:
    """Row of what mutated files do to the readers."""
    rng, sources = np.random.default_rng(seed), files()
    ends: Counter[str] = Counter()
    longest = 0.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        for number in range(count):
            path.write_bytes(mutated(sources[number % len(sources)], rng))
            start = time.perf_counter()
            try:
                table, _ = open_table(path)
                table.load([i for i, column in enumerate(table.columns) if column.name][:50])
                ends["read"] += 1
            except BrightgreyError as error:
                ends["refused" if str(error).isprintable() and len(str(error)) <= 1000 else "bad message"] += 1
            except Exception as error:
                ends["other"] += 1
                print(f"{name} {number}: {type(error).__name__}: {error}", file=sys.stderr)
            longest = max(longest, time.perf_counter() - start)
    counts = [str(ends[key]) for key in ("read", "refused", "bad message", "other")]
    return [name, str(count), *counts, f"{longest:.2f}"]


def large_rows(rows: int) -> Iterator[list[str]]:
    """Row of one large file of four columns."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "large.csv"
        with path.open("w") as file:
            file.write("t,torque,velocity,position\n")
            for start in range(0, rows, 100_000):
                k = np.arange(start, min(rows, start + 100_000))
                numbers = np.column_stack([k * 1e-4, np.sin(k * 1e-3), np.cos(k * 1e-3), k * 1e-5])
                np.savetxt(file, numbers, fmt="%.9f", delimiter=",")
        command = [sys.executable, "-c", READ_LARGE, str(path)]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        samples, seconds, gigabytes = done.stdout.split()
        yield [samples, f"{path.stat().st_size / 1e6:.0f}", f"{float(seconds):.0f}", f"{float(gigabytes):.2f}"]


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--mutations", type=int, default=20_000)
    parser.add_argument("--library-mutations", type=int, default=200)
    parser.add_argument("--rows", type=int, default=10_000_000)
    options = parser.parse_args()
    columns = ["files", "number", "read", "refused", "message too long", "other exception", "longest s"]
    mutations = [
        outcomes("own readers", text_files, options.mutations, 1),
        outcomes("libraries", library_files, options.library_mutations, 2),
    ]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"peak of this process: {peak:.2f} GB")
    tables = [
        Table("Recorded files", ["file", "format", "samples", "channels", "every ms", "repairs"], file_rows()),
        Table("Mutated files", columns, mutations),
        Table("A large text", ["samples", "MB", "wall s", "peak GB"], list(large_rows(options.rows))),
    ]
    publish("formats", tables, to_file=options.save)


if __name__ == "__main__":
    main()
