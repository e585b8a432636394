"""The same bytes wherever evaluations are made."""

import logging
import multiprocessing
import os
import signal
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool

import numpy as np
import pytest

from brightgrey import read_recording
from brightgrey.api.resumable import identify_resumable
from brightgrey.errors import SettingsError
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.runs import RunError, Workforce
from brightgrey.runs.recording_transfer import RECORDINGS, RecordingTransferExecutor
from support.small_runs import results

pytestmark = pytest.mark.xdist_group("small searches")  # made once

EXCLUDE = ("two_mass", "current_control")


def searched(small, folder, executor, progress=None):
    recording = read_recording(small.folder / "a.csv", input="torque", outputs=["velocity"])
    return identify_resumable(
        folder, [recording], exclude=EXCLUDE, f_tanh=E.f_tanh, executor=executor, workers=1, progress=progress
    )


@pytest.fixture(scope="module")
def whole(small, tmp_path_factory):
    """What the search comes to by the one thread that calls it; the program finds the same model."""
    folder = tmp_path_factory.mktemp("whole")
    searched(small, folder, None)
    found = results(folder)
    for name in ("model.json", "ranking.csv"):
        assert found[name] == small.whole["exhaustive"][name]
    return found


@pytest.mark.parametrize("workforce", [Workforce(1), Workforce(4), Workforce(2, processes=True)], ids=str)
def test_executors__threads_and_processes__same_bytes(small, whole, tmp_path, workforce):
    with workforce.executor() as executor:
        searched(small, tmp_path, executor)
    assert results(tmp_path) == whole


@pytest.mark.filterwarnings("ignore")
def test_executors__cluster_loses_worker__same_bytes(small, whole, tmp_path):
    distributed = pytest.importorskip("distributed")
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    how = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with distributed.LocalCluster(**how, silence_logs=logging.CRITICAL) as cluster:
        pids = [worker.process.pid for worker in cluster.workers.values()]
        killed = []

        def kill(step):
            if not killed and getattr(step, "done", 0) >= 3:
                os.kill(pids[0], signal.SIGKILL)
                killed.append(pids[0])

        with Workforce(dask=cluster.scheduler_address).executor() as executor:
            searched(small, tmp_path, executor, kill)
    assert killed
    assert results(tmp_path) == whole


def test_executors__process_killed__error_and_resumable(small, whole, tmp_path):
    def kill(step):
        if getattr(step, "done", 0) >= 3:
            for process in multiprocessing.active_children():
                os.kill(process.pid, signal.SIGKILL)

    with Workforce(2, processes=True).executor() as executor, pytest.raises(RunError, match="the same command goes on"):
        searched(small, tmp_path, executor, kill)
    searched(small, tmp_path, None)
    assert results(tmp_path) == whole


def test_recording_transfer__several_calls__recording_sent_once(small):
    sent = []

    class Wire(Executor):
        def submit(self, fn, *args):
            sent.append(sum(len(a) for a in args if isinstance(a, bytes)) + 1_000_000 * (len(args) > 2))
            future = Future()
            future.set_result(fn(*args))
            return future

    recording = read_recording(small.folder / "a.csv", input="torque", outputs=["velocity"], decimate=2)
    RECORDINGS.clear()
    parcels = RecordingTransferExecutor(Wire())
    for _ in range(5):
        assert parcels.submit(np.shape, recording.y).result() == recording.y.shape
        assert parcels.submit(_samples, recording).result() == recording.samples
    assert sum(size > 1_000_000 for size in sent) == 1


def test_recording_transfer__worker_lost__waiting_calls_left_to_the_pool():
    made = []

    class Pool(Executor):
        def submit(self, fn, *args):
            made.append(Future())
            return made[-1]

    calls = RecordingTransferExecutor(Pool())
    futures = [calls.submit(abs, i) for i in range(3)]
    assert futures[2].cancel()
    made[0].set_exception(BrokenProcessPool("a process died"))
    assert not futures[1].cancel()
    made[1].set_exception(BrokenProcessPool("a process died"))  # an InvalidStateError if the call was cancelled
    assert isinstance(futures[1].exception(), BrokenProcessPool)


def _samples(recording):
    return recording.samples


def test_workforce__contradicting_options__refused():
    with pytest.raises(SettingsError, match="at least 1"):
        Workforce(0)
    with pytest.raises(SettingsError, match="take one of them"):
        Workforce(1, processes=True, dask="host:1")


@pytest.mark.filterwarnings("ignore")
def test_workforce__unreachable_cluster__error_names_address():
    pytest.importorskip("distributed")
    with pytest.raises(RunError, match=r"127\.0\.0\.1:9"), Workforce(dask="127.0.0.1:9", connect_timeout=1).executor():
        pass
