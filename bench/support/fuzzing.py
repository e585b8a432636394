"""Mutations of files and values, and cases that are run in a process of their own with limits of time and memory."""

from __future__ import annotations

import os
import resource
import select
import signal
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["TOKENS", "VALUES", "mutated_bytes", "mutated_json", "outcomes_of"]

TOKENS = [b"", b"nan", b"1e400", b"-1e31", b"9.91E+37", b"1" * 500, b"\x00", b'"', b";", b",,", b"\xff\xfe", b"1.234,5"]
VALUES: list[Any] = [
    -1.0,
    0.0,
    1e300,
    -1e-300,
    1e27,
    "",
    "nan",
    "%",
    "\ud800",
    None,
    [],
    {},
    True,
    "x" * 3000,
    [1.0] * 3,
]


def mutated_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """Return a file with one to four places changed, doubled or left out."""
    for _ in range(int(rng.integers(1, 5))):
        at, end = sorted(rng.integers(0, len(data) + 1, 2).tolist())
        end = min(end, at + int(rng.integers(1, 200)))
        part, kind = data[at:end], int(rng.integers(0, 6))
        junk = rng.integers(0, 256, max(end - at, 1), dtype=np.uint8).tobytes()
        token = TOKENS[int(rng.integers(0, len(TOKENS)))]
        data = data[:at] + (b"", part + part, junk, token, part[::-1], part.replace(b"0", b"9"))[kind] + data[end:]
    return data


def mutated_json(data: Any, rng: np.random.Generator) -> Any:
    """Return a copy of plain data with one value changed, left out, or ``nested`` (where deep nesting is written)."""
    if isinstance(data, dict) and data and rng.random() < 0.95:
        name = list(data)[int(rng.integers(len(data)))]
        if rng.random() < 0.05:
            return {key: value for key, value in data.items() if key != name}
        return data | {name: mutated_json(data[name], rng)}
    if isinstance(data, list) and data and rng.random() < 0.8:
        at = int(rng.integers(len(data)))
        return [*data[:at], mutated_json(data[at], rng), *data[at + 1 :]]
    if isinstance(data, float | int) and rng.random() < 0.5:
        return float(data) * float(rng.choice([-1.0, 0.0, 1e-30, 1e30, 1e150, 0.5]))
    if rng.random() < 0.02:
        return "nested"  # too deep for data; the text is put in its place
    return VALUES[int(rng.integers(len(VALUES)))]


def outcomes_of(
    case: Callable[[int], str], first: int, last: int, *, seconds: float, megabytes: int
) -> Iterator[tuple[int, str, float]]:
    """Run cases in child processes, and give the number, outcome and time in s of each.

    A case that lasts longer than `seconds` gives ``hang``, one that ends its process ``ended by N``, and any exception
    its name and place. A child may take `megabytes` (2^20 bytes) more than it has at its start.
    """
    while first < last:
        read, write = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(read)
            _serve(case, first, last, write, megabytes)
        os.close(write)
        with os.fdopen(read, "rb", buffering=0) as stream:
            kept = b""
            began = time.monotonic()
            while first < last:
                ready, _, _ = select.select([stream], [], [], max(began + seconds - time.monotonic(), 0.0))
                if not ready:
                    os.kill(child, signal.SIGKILL)
                    break
                more = stream.read(1 << 16)
                if not more:
                    break
                *lines, kept = (kept + more).split(b"\n")
                for line in lines:
                    taken, _, outcome = line.decode().partition(" ")
                    yield first, outcome, float(taken)
                    first, began = first + 1, time.monotonic()
        _, status = os.waitpid(child, 0)
        if first < last:
            code = os.waitstatus_to_exitcode(status)
            yield first, "hang" if code == -signal.SIGKILL else f"ended by {code}", seconds
            first += 1


def _serve(case: Callable[[int], str], first: int, last: int, write: int, megabytes: int) -> None:
    """Run cases in this process, the child, and write a line for each."""
    sizes = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    limit = int(sizes["VmSize"].split()[0]) * 1024 + (megabytes << 20)
    # The hard limit stays, so that a child process may give itself the limit that it is to have.
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))
    for number in range(first, last):
        start = time.perf_counter()
        try:
            outcome = case(number)
        except BaseException as error:
            frame = traceback.extract_tb(error.__traceback__)[-1]
            outcome = f"{type(error).__name__} in {Path(frame.filename).name}:{frame.lineno} {str(error)[:100]!r}"
        os.write(write, f"{time.perf_counter() - start:.4f} {outcome}\n".encode("utf-8", "backslashreplace"))
    os._exit(0)
