"""Gain of two workers over one in the search, and the cost of keeping the run on disk.

``runs.py [--decimate N]`` searches all structures on the demo's recording with one worker and with two, each in a
process of its own, and prints wall and CPU times and the efficiency: wall of one over twice the wall of two.

Other work on the machine spoils these, but not the limit that the schedule sets. For that limit the CPU times of all
evaluations, and of the work between them, are recorded with one worker. They are then put on two workers in the order
and with the waiting of the search.
"""

from __future__ import annotations

import heapq
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from concurrent.futures import Executor, Future
from pathlib import Path

from brightgrey import read_recording
from brightgrey.estimation import scales, settings_for
from brightgrey.excitation import demo_recording
from brightgrey.kit import PAPER
from brightgrey.runs import CachingExecutor, Store, Workforce
from brightgrey.runs.blas_threads import one_blas_thread
from brightgrey.search import IdentificationTask
from brightgrey.search.decision import decide_structures
from support.results import Table, arguments, publish


class Noted(Executor):
    """Makes every call at once, and records its cost and when its result was waited for."""

    def __init__(self) -> None:
        self.events: list[
            tuple[str, float, int]
        ] = []  # kind, CPU seconds (of the call, or since the event before), call
        self.count = 0
        self.last = time.thread_time()

    def submit(self, fn, /, *args, **kwargs):
        """Result of the call, which is made here and now."""
        before = time.thread_time()
        self.events.append(("between", before - self.last, 0))
        future = Waited(self, self.count)
        future.set_result(fn(*args, **kwargs))
        self.last = time.thread_time()
        self.events.append(("call", self.last - before, self.count))
        self.count += 1
        return future


class Waited(Future):
    """A result that notes when it is waited for."""

    def __init__(self, noted: Noted, number: int) -> None:
        super().__init__()
        self.noted, self.number = noted, number

    def result(self, timeout=None):
        """Record the waiting, and return the result."""
        noted = self.noted
        now = time.thread_time()
        noted.events += [("between", now - noted.last, 0), ("wait", 0.0, self.number)]
        noted.last = now
        return super().result(timeout)


def makespan(events: list[tuple[str, float, int]], workers: int) -> float:
    """Seconds that the search takes if `workers` do nothing else and the thread that hands out has a core to itself."""
    now, free, ends = 0.0, [0.0] * workers, {}
    for what, seconds, number in events:
        if what == "between":
            now += seconds
        elif what == "call":
            begin = max(now, heapq.heappop(free))
            ends[number] = begin + seconds
            heapq.heappush(free, ends[number])
        else:
            now = max(now, ends[number])
    return now


def the_task(decimate: int) -> IdentificationTask:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "recording.csv"
        file.write_text(demo_recording())
        r = read_recording(file, input="torque", outputs=["velocity"], decimate=decimate)
    known = scales([r])
    return IdentificationTask((r,), known, settings_for([r], known, None))


def search(how: str, workers: int, decimate: int) -> dict[str, object]:
    """One search, timed."""
    task = the_task(decimate)
    decide_structures(task, PAPER, exclude=["two_mass", "coulomb", "stribeck"])  # compile
    noted = Noted()
    with tempfile.TemporaryDirectory() as folder, one_blas_thread():
        wall, cpu = time.perf_counter(), time.process_time()
        if how == "schedule":
            found = decide_structures(task, PAPER, executor=noted)
        else:
            with Workforce(workers, processes=how == "processes").executor() as executor:
                if how == "kept":
                    with Store.open(folder, {}) as store, CachingExecutor(executor, store) as memory:
                        found = decide_structures(task, PAPER, executor=memory)
                else:
                    found = decide_structures(task, PAPER, executor=executor)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    out = {"how": how, "workers": workers, "wall": wall, "cpu": cpu, "best": str(found.best.structure)}
    if how == "schedule":
        out |= {f"limit {n}": makespan(noted.events, n) for n in (1, 2, 4, 8)}
        calls = [seconds for what, seconds, _ in noted.events if what == "call"]
        out |= {"calls": len(calls), "between": cpu - sum(calls), "longest": max(calls)}
    return out


def tables(found: Mapping[tuple[str, int], Mapping[str, float]]) -> list[Table]:
    """Times of the searches, and efficiencies on two cores beside the limit that the schedule sets."""
    searches = [
        [how, str(workers), f"{r['wall']:.1f}", f"{r['cpu']:.1f}", f"`{r['best']}`"]
        for (how, workers), r in found.items()
    ]
    schedule, one = found["schedule", 1], found["threads", 1]["wall"]
    gains = [[how, f"{one / (2.0 * found[how, 2]['wall']):.1%}", "85 %"] for how in ("threads", "processes", "kept")]
    limits = [[str(n), f"{schedule['limit 1'] / (n * schedule[f'limit {n}']):.1%}"] for n in (2, 4, 8)]
    return [
        Table(
            "Search of the demo recording", ["workers are", "how many", "wall s", "CPU s", "best structure"], searches
        ),
        Table("Efficiency of two workers on two cores", ["workers are", "efficiency", "goal"], gains),
        Table("Limit that the schedule sets to the efficiency", ["workers", "efficiency"], limits),
    ]


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--decimate", type=int, default=1, help="use every Nth sample of the demo's recording")
    parser.add_argument("--only", nargs=2, metavar=("HOW", "WORKERS"), help="one search, as JSON")
    options = parser.parse_args()
    if options.only:
        print(json.dumps(search(options.only[0], int(options.only[1]), options.decimate)))
        return
    found = {}
    for how, workers in (("schedule", 1), ("threads", 1), ("threads", 2), ("processes", 2), ("kept", 2)):
        command = [sys.executable, __file__, "--decimate", str(options.decimate), "--only", how, str(workers)]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        found[how, workers] = row = json.loads(done.stdout)
        print(f"{how:9s} {workers} workers: wall {row['wall']:6.1f} s, CPU {row['cpu']:6.1f} s", flush=True)
        if how == "schedule":
            print(
                f"  {row['calls']} evaluations, the longest {row['longest']:.2f} s CPU, {row['between']:.1f} s between"
            )
    publish("runs", tables(found), to_file=options.save)


if __name__ == "__main__":
    main()
