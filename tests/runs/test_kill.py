"""A run that is killed, stopped or starved goes on, and ends with the bytes of one that was not."""

import os
import random
import resource
import signal
import time
from functools import partial

import pytest

from brightgrey.runs import read_status
from brightgrey.runs.store import FILE
from support.small_runs import call, results, start

pytestmark = pytest.mark.xdist_group("small searches")  # made once

MOST = 60.0  # s until a test has failed


def wait_for(folder, evaluations):
    end = time.monotonic() + MOST
    while time.monotonic() < end:
        if (folder / FILE).exists() and read_status(folder).evaluations >= evaluations:
            return
        time.sleep(0.01)
    raise AssertionError("the run does not get on")


def kill_and_resume(small, name, instant, folder):
    """Kill at an instant, then go on; gives how much had been kept."""
    process = start(*small.searches[name], "--workers", 2, "--out", folder, "--quiet")
    instant(folder)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    kept = read_status(folder).evaluations if (folder / FILE).exists() else 0
    done = call(*small.searches[name], "--out", folder, "--quiet")
    assert (done.code, done.err) == (0, "")
    assert results(folder) == small.whole[name]
    assert not [p.name for p in folder.iterdir() if p.name.startswith(".")]
    return kept


def instants(small, name, length, times, seed):
    """Random ones: every other anywhere in the life of the process, the rest within the search."""
    draw, most = random.Random(seed), read_status(small.folder / name).evaluations
    for number in range(times):
        if number % 2:
            yield partial(later, wait=draw.random() * length)
        else:
            yield partial(later, evaluations=draw.randrange(1, most), wait=0.05 * draw.random())


def later(folder, *, wait, evaluations=0):
    if evaluations:
        wait_for(folder, evaluations)
    time.sleep(wait)


def length_of(small, name, folder):
    begun = time.monotonic()
    process = start(*small.searches[name], "--workers", 2, "--out", folder, "--quiet")
    _, error = process.communicate()
    assert process.returncode == 0, error
    assert results(folder) == small.whole[name]
    return time.monotonic() - begun


def killed_often(small, tmp_path, name, times, seed):
    length = length_of(small, name, tmp_path / name) if times > 1 else 0.0  # the first instant is within the search
    chosen = instants(small, name, length, times, seed)
    return [kill_and_resume(small, name, instant, tmp_path / str(k)) for k, instant in enumerate(chosen)]


@pytest.mark.parametrize(("name", "times"), [("exhaustive", 2), ("genetic", 1)])
def test_resume__killed_at_few_instants__same_bytes(small, tmp_path, name, times):
    killed_often(small, tmp_path, name, times, seed=1)


@pytest.mark.long
@pytest.mark.parametrize("name", ["exhaustive", "genetic"])
def test_resume__killed_at_fifty_instants__same_bytes(small, tmp_path, name):
    kept = killed_often(small, tmp_path, name, 50, seed=2)
    assert sum(k > 0 for k in kept) > 24  # instants within the search are among them
    print(sorted(kept))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal__during_search__best_so_far(small, tmp_path, number):
    process = start(*small.searches["exhaustive"], "--workers", 1, "--out", tmp_path)
    wait_for(tmp_path, 6)
    process.send_signal(number)
    out, err = process.communicate(timeout=MOST)
    assert process.returncode == 128 + number, err
    assert "Stopped: " in out
    assert "goes on from here" in out
    assert (tmp_path / "model.json").exists()
    assert read_status(tmp_path).state == "unfinished"
    assert call(*small.searches["exhaustive"], "--out", tmp_path, "--quiet").code == 0
    assert results(tmp_path) == small.whole["exhaustive"]


def test_budget_of_evaluations__any_workers__same_bytes(small, tmp_path):
    stopped = []
    for workers in (1, 4):
        folder = tmp_path / str(workers)
        done = call(*small.searches["exhaustive"], "--max-evaluations", 9, "--workers", workers, "--out", folder)
        assert done.code == 0, done.err
        assert "Stopped: " in done.out
        assert read_status(folder).evaluations == 9
        stopped.append(results(folder))
    assert stopped[0] == stopped[1]
    assert call(*small.searches["exhaustive"], "--out", folder, "--quiet").code == 0
    assert results(folder) == small.whole["exhaustive"]


def test_budget_of_time__stops__resumable(small, tmp_path):
    for doublings in range(10):
        done = call(*small.searches["genetic"], "--max-seconds", 0.5 * 2**doublings, "--out", tmp_path)
        if "the same command" not in done.out + done.err:
            break
    assert done.code == 0, done.err
    assert results(tmp_path) == small.whole["genetic"]


def test_full_disk__error_names_folder__run_undamaged(small, tmp_path):
    def starve():
        resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, resource.RLIM_INFINITY))

    process = start(*small.searches["exhaustive"], "--out", tmp_path, "--quiet", preexec_fn=starve)
    _, err = process.communicate(timeout=MOST)
    assert process.returncode == 2
    assert "make room; the same command then goes on" in err
    assert len(err.splitlines()) == 1
    assert read_status(tmp_path).state == "unfinished"
    assert call(*small.searches["exhaustive"], "--out", tmp_path, "--quiet").code == 0
    assert results(tmp_path) == small.whole["exhaustive"]


def test_store__read_only_folder__named(small, tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    if os.access(folder, os.W_OK):  # nothing is closed to the superuser
        folder = "/proc/brightgrey"
    done = call(*small.searches["exhaustive"], "--out", folder)
    assert done.code == 2
    assert str(folder) in done.err
    assert len(done.err.splitlines()) == 1


def test_store__second_process__refused(small, tmp_path):
    first = start(*small.searches["exhaustive"], "--workers", 1, "--out", tmp_path, "--quiet")
    wait_for(tmp_path, 1)
    first.send_signal(signal.SIGSTOP)  # however long the second takes to start
    assert read_status(tmp_path).state == "running"
    second = call(*small.searches["exhaustive"], "--out", tmp_path)
    first.send_signal(signal.SIGCONT)
    assert second.code == 2
    assert "another process is at work" in second.err
    _, err = first.communicate(timeout=MOST)
    assert first.returncode == 0, err
    assert results(tmp_path) == small.whole["exhaustive"]


def test_full_disk__nothing_has_begun__leaves_nothing(small, tmp_path):
    def starve():
        resource.setrlimit(resource.RLIMIT_FSIZE, (5_000, resource.RLIM_INFINITY))

    process = start(*small.searches["exhaustive"], "--out", tmp_path / "out", "--quiet", preexec_fn=starve)
    _, err = process.communicate(timeout=MOST)
    assert process.returncode == 2
    assert "make room" in err
    assert not (tmp_path / "out").exists()
