"""Compilation of the whole kernel ahead of its first use, in two processes.

numba compiles under a lock, so threads do not help. The entries of the kernel call each other by address, and each is
compiled and cached on its own. A second process therefore takes some of them, and both write to the same disk cache.
Each process compiles the functions inside its entries anew. Entries that share many stand side by side, and the two
processes begin at the two ends. Programs that start at the same time wait for the one that compiles.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import sqlite3
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from pathlib import Path
from threading import Lock, Thread
from types import MappingProxyType
from typing import IO

import llvmlite.binding as llvm

from brightgrey.simulation.kernel.event_location import locate_events
from brightgrey.simulation.kernel.exponentials import fill_propagator_tables
from brightgrey.simulation.kernel.initial_state import set_initial_state
from brightgrey.simulation.kernel.input_knots import input_knot_weights
from brightgrey.simulation.kernel.loop import run_batch
from brightgrey.simulation.kernel.machine.compilation import cache_folder, compile_for_integers
from brightgrey.simulation.kernel.step_control import accept_or_refine, refine_group, refine_lane

__all__ = ["is_kernel_ready", "prepare_kernel"]

ENTRIES: Mapping[str, Callable[[], object]] = MappingProxyType(
    {
        "the loop over samples": partial(compile_for_integers, run_batch, 3),
        "refinement of groups": refine_group.address,
        "control of errors": accept_or_refine.address,
        "matrix exponentials": fill_propagator_tables.address,
        "input knots": input_knot_weights.address,
        "initial states": set_initial_state.address,
        "location of contacts": locate_events.address,
        "refinement of steps": refine_lane.address,
    }
)
"""Functions that compile one entry each: first those for all lanes at once, last those for one lane."""
_PROGRAM = (
    "from brightgrey.simulation.preparation import compile_unclaimed; compile_unclaimed({folder!r}, from_the_end=True)"
)
_LOCK = Lock()
_PATIENCE = 600.0  # s; another program that compiles takes a minute on a slow machine


def is_kernel_ready() -> bool:
    """Return True if the disk cache holds the whole kernel for this machine."""
    return _marker(cache_folder()).exists()


def prepare_kernel(report: Callable[[int, int, str], None] | None = None) -> None:
    """Compile the kernel into the disk cache if it is not there yet.

    Parameters
    ----------
    report : callable, optional
        Called as ``report(done, total, entry)`` whenever an entry has been compiled.

    Notes
    -----
    Where no cache can be written or no process can be started, the kernel is compiled at its first use instead.
    """
    with _LOCK:
        if is_kernel_ready():
            return
        with (
            contextlib.suppress(OSError, sqlite3.OperationalError),
            _one_program_at_a_time(),
            tempfile.TemporaryDirectory(prefix="brightgrey-") as claims,
        ):
            if is_kernel_ready():
                return
            done: list[str] = []

            def compiled(name: str) -> None:
                done.append(name)
                if report is not None:
                    report(len(done), len(ENTRIES), name)

            with _second_process(claims) as second:
                reader = Thread(target=_read_names, args=(second.stdout, compiled), daemon=True)
                reader.start()
                compile_unclaimed(claims, compiled)
                code = second.wait()
                reader.join()
            if code == 0 and len(done) == len(ENTRIES):
                _marker(cache_folder()).touch()


def compile_unclaimed(
    folder: str, compiled: Callable[[str], None] = lambda name: print(name, flush=True), *, from_the_end: bool = False
) -> None:
    """Compile the entries that no other process has claimed by a file in `folder`; tell the name of each."""
    numbered = list(enumerate(ENTRIES.items()))
    for number, (name, compile_entry) in reversed(numbered) if from_the_end else numbered:
        try:
            (Path(folder) / str(number)).touch(exist_ok=False)
        except FileExistsError:
            continue
        compile_entry()
        compiled(name)


@contextlib.contextmanager
def _one_program_at_a_time() -> Iterator[None]:
    """Hold the lock of the cache folder; it is SQLite's, which ends with its process however that dies."""
    cache_folder().mkdir(parents=True, exist_ok=True)
    with contextlib.closing(
        sqlite3.connect(cache_folder() / "compiling.lock", timeout=_PATIENCE, isolation_level=None)
    ) as lock:
        lock.execute("BEGIN EXCLUSIVE")
        yield


def _second_process(folder: str) -> subprocess.Popen[str]:
    package = str(Path(__file__).parents[2])
    path = os.pathsep.join([package, *filter(None, [os.environ.get("PYTHONPATH")])])
    return subprocess.Popen(
        [sys.executable, "-c", _PROGRAM.format(folder=folder)],
        env={**os.environ, "PYTHONPATH": path},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )


def _read_names(stream: IO[str] | None, compiled: Callable[[str], None]) -> None:
    for line in stream or ():
        compiled(line.strip())


@cache
def _marker(folder: Path) -> Path:
    """File that says that the kernel is compiled; numba's cache depends on the place of the sources and the CPU."""
    machine = f"{Path(__file__)} {llvm.get_host_cpu_name()}"
    return folder / f"ready-{hashlib.sha256(machine.encode()).hexdigest()[:16]}"
