"""How much two workers gain over one in the exhaustive search, and what keeping the run costs.

``runs.py [--decimate N]`` searches all structures on the demo's recording with one worker and with two, each in a
process of its own, and prints wall and CPU times and the efficiency: wall of one over twice the wall of two. Other work
on the machine spoils these; the limit of the schedule does not depend on it. For that the CPU times of all evaluations
and of what happens between them are taken down with one worker, and put on two workers in the order and with the
waiting that the search has.
"""

from __future__ import annotations

import argparse
import heapq
import json
import subprocess
import sys
import tempfile
import time
from concurrent.futures import Executor, Future
from pathlib import Path

from brightgrey import read_recording
from brightgrey.estimation import scales, settings_for
from brightgrey.excitation import demo_recording
from brightgrey.runs import CachingExecutor, Store, Workforce
from brightgrey.runs.blas_threads import one_blas_thread
from brightgrey.search import IdentificationTask
from brightgrey.search.survey import candidates, search_exhaustively


class Noted(Executor):
    """Makes every call at once, and takes down what it cost and when its result was waited for."""

    def __init__(self) -> None:
        self.events: list[tuple[str, float, int]] = []  # what, CPU seconds (of the call; since the event before), call
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
        """Note, and give what is there."""
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
    task, structures = the_task(decimate), candidates()
    search_exhaustively(task, structures[:2])  # compile
    noted = Noted()
    with tempfile.TemporaryDirectory() as folder, one_blas_thread():
        wall, cpu = time.perf_counter(), time.process_time()
        if how == "schedule":
            found = search_exhaustively(task, structures, executor=noted)
        else:
            with Workforce(workers, processes=how == "processes").executor() as executor:
                if how == "kept":
                    with Store.open(folder, {}) as store, CachingExecutor(executor, store) as memory:
                        found = search_exhaustively(task, structures, executor=memory)
                else:
                    found = search_exhaustively(task, structures, executor=executor)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    out = {"how": how, "workers": workers, "wall": wall, "cpu": cpu, "best": str(found.best.structure)}
    if how == "schedule":
        out |= {f"limit {n}": makespan(noted.events, n) for n in (1, 2, 4, 8)}
        calls = [seconds for what, seconds, _ in noted.events if what == "call"]
        out |= {"calls": len(calls), "between": cpu - sum(calls), "longest": max(calls)}
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--decimate", type=int, default=1, help="use every Nth sample of the demo's recording")
    parser.add_argument("--only", nargs=2, metavar=("HOW", "WORKERS"), help="one search, as JSON")
    options = parser.parse_args()
    if options.only:
        print(json.dumps(search(options.only[0], int(options.only[1]), options.decimate)))
        return
    rows = {}
    for how, workers in (("schedule", 1), ("threads", 1), ("threads", 2), ("processes", 2), ("kept", 2)):
        command = [sys.executable, __file__, "--decimate", str(options.decimate), "--only", how, str(workers)]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        rows[how, workers] = row = json.loads(done.stdout)
        print(
            f"{how:9s} {workers} workers: wall {row['wall']:6.1f} s, CPU {row['cpu']:6.1f} s, {row['best']}", flush=True
        )
        if how == "schedule":
            ratios = ", ".join(f"{row['limit 1'] / (n * row[f'limit {n}']):.1%} on {n}" for n in (2, 4, 8))
            print(
                f"  {row['calls']} evaluations, the longest {row['longest']:.2f} s CPU, {row['between']:.1f} s between"
            )
            print(f"  limit of the schedule: efficiency {ratios}", flush=True)
    one = rows["threads", 1]["wall"]
    for how in ("threads", "processes", "kept"):
        print(f"efficiency on two cores, {how}: {one / (2.0 * rows[how, 2]['wall']):.1%} (goal 85 %)")


if __name__ == "__main__":
    main()
