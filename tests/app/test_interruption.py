"""A search outlives the browser and the server, goes on where it was stopped, and ends as by the command line."""

import os
import signal
import time
from contextlib import closing

import pytest

from brightgrey.app.jobs.arguments import identify_arguments
from brightgrey.app.jobs.child import interrupt_process, is_process_of, start_process
from brightgrey.app.jobs.queue import JobQueue, QueuedCommand
from brightgrey.app.services import AppServices
from brightgrey.app.workspace.folder import Workspace
from brightgrey.app.workspace.project import AxisChoice, CheckDecision, digest_of_recordings
from brightgrey.runs import RunError, read_status
from support.app import FEW_EFFECTS, RunningApp, Visit, descendants
from support.small_runs import call, recording_csv

MOST = 240.0  # s until a test has failed


def prepared(folder, *, few=True):
    """Workspace with a project that is ready for its search."""
    workspace = Workspace(folder)
    name = workspace.create("Axis").name
    source = workspace.path(name) / "recordings" / ".upload"
    source.write_text(recording_csv())
    workspace.add_recording(name, source, "axis.csv", "0" * 64, {"input": "torque", "output": ["velocity:velocity"]})

    def choose(document):
        drive = AxisChoice(**(FEW_EFFECTS if few else {"confirmed": True, "most_masses": 1}))
        check = CheckDecision(digest=digest_of_recordings(document), grade="note")
        return document.model_copy(update={"drive": drive, "check": check})

    workspace.change(name, choose)
    return workspace, name


def by_command_line(workspace, name, run, folder, monkeypatch):
    """Bytes of model.json by the command that the app shows."""
    monkeypatch.chdir(workspace.path(name))
    arguments = identify_arguments(workspace.load(name), run)
    assert call(*arguments[:-1], folder, "--workers", 1, "--quiet").code == 0
    return (folder / "model.json").read_bytes()


def wait_until(condition):
    end = time.monotonic() + MOST
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError("it does not come to that")


def evaluations(folder):
    try:
        return read_status(folder).evaluations
    except RunError:
        return 0


def finished(folder):
    try:
        return read_status(folder).state == "finished" and (folder / "model.json").is_file()
    except RunError:
        return False


def start_search(browser, app, name):
    with closing(Visit(browser, app.start_url).context) as context:
        page = context.pages[0]
        page.goto(f"{app.base}/project/{name}/search")
        page.click('[data-key="start"]')
        page.wait_for_selector('[data-key="stop"]')


@pytest.mark.parametrize("everything", [True, False])
def test_search__server_killed_and_started_again__ends_with_the_same_bytes(browser, tmp_path, monkeypatch, everything):
    workspace, name = prepared(tmp_path / "w")
    run = workspace.path(name) / "runs" / "run-1"
    first = RunningApp(workspace.root)
    start_search(browser, first, name)  # and the browser is closed
    wait_until(lambda: evaluations(run) >= 1)
    if everything:
        first.kill_all()  # a power cut
        assert not finished(run)
    else:
        first.process.send_signal(signal.SIGKILL)  # the search goes on without it
        first.process.wait()
    second = RunningApp(workspace.root)
    wait_until(lambda: finished(run))
    expected = by_command_line(workspace, name, "run-1", tmp_path / "cli", monkeypatch)
    assert (run / "model.json").read_bytes() == expected
    with closing(Visit(browser, second.start_url).context) as context:
        page = context.pages[0]
        page.goto(f"{second.base}/project/{name}/search")
        page.wait_for_selector(".alert.good")
    assert "Traceback" not in second.end()
    wait_until(lambda: descendants(second.process.pid) == [])


def test_search__stopped_and_gone_on_with__ends_with_the_same_bytes(browser, tmp_path, monkeypatch):
    workspace, name = prepared(tmp_path / "w", few=False)
    run = workspace.path(name) / "runs" / "run-1"
    app = RunningApp(workspace.root)
    with closing(Visit(browser, app.start_url)) as visit:
        visit.page.goto(f"{app.base}/project/{name}/search")
        visit.click("start")
        wait_until(lambda: evaluations(run) >= 2)
        visit.click("stop")
        visit.wait('[data-key="start"]')
        assert read_status(run).state == "unfinished"
        assert workspace.load(name).runs[0].wanted == "paused"
        if (run / "model.json").is_file():  # the best so far can be looked at
            visit.wait('[data-key="continue"]:not([disabled])')
        visit.click("start")
        visit.wait(".alert.good")
        assert visit.said == []
    expected = by_command_line(workspace, name, "run-1", tmp_path / "cli", monkeypatch)
    assert (run / "model.json").read_bytes() == expected
    assert "Traceback" not in app.end()


def test_server__ended_by_ctrl_c__pauses_its_search_for_the_next_one(browser, tmp_path):
    workspace, name = prepared(tmp_path / "w", few=False)
    run = workspace.path(name) / "runs" / "run-1"
    app = RunningApp(workspace.root)
    start_search(browser, app, name)
    wait_until(lambda: evaluations(run) >= 1)
    children = descendants(app.process.pid)
    app.end()
    wait_until(lambda: read_status(run).state == "unfinished")
    wait_until(lambda: not any(is_process_of(pid, "run-1") for pid in children))
    assert workspace.load(name).runs[0].wanted == "running"  # the next server goes on with it


@pytest.mark.system
def test_queue__two_searches__run_one_after_the_other(tmp_path):
    workspace, name = prepared(tmp_path / "w")
    queue = JobQueue(workspace)
    for run in ("run-1", "run-2"):
        queue.add(QueuedCommand(name, run, identify_arguments(workspace.load(name), run)))
        queue.add(QueuedCommand(name, run, identify_arguments(workspace.load(name), run)))  # a second click
    seen = set()

    def all_ended():
        queue.tick()
        seen.add(tuple(job.state for job in queue.jobs.values()))
        return all(job.state == "ended" for job in queue.jobs.values())

    wait_until(all_ended)
    assert ("running", "queued") in seen
    assert ("running", "running") not in seen
    assert [job.code for job in queue.jobs.values()] == [0, 0]
    again = JobQueue(workspace)
    assert again.of(name, "run-1", "identify").code == 0  # a later server knows how it ended
    assert again.of(name, "run-3", "identify") is None


@pytest.mark.system
def test_process__is_nicer_and_ends_as_by_ctrl_c(tmp_path):
    workspace, name = prepared(tmp_path / "w", few=False)
    folder = workspace.path(name)
    child = start_process(identify_arguments(workspace.load(name), "run-1"), folder, folder / "jobs" / "log")
    assert os.getpriority(os.PRIO_PROCESS, child.pid) >= 10
    wait_until(lambda: is_process_of(child.pid, "run-1"))  # it has not begun until its words can be read
    assert not is_process_of(child.pid, "run-11")
    assert not is_process_of(os.getpid(), "run-1")
    wait_until(lambda: evaluations(folder / "runs" / "run-1") >= 1)
    interrupt_process(child.pid)
    assert child.wait(60) == 130
    assert read_status(folder / "runs" / "run-1").state == "unfinished"
    interrupt_process(child.pid)  # it is gone: nothing happens


def test_services__search_begun_twice__is_one_run(tmp_path):
    workspace, name = prepared(tmp_path / "w")
    services = AppServices(workspace, JobQueue(workspace), desk=None)
    assert services.begin_search(name) == services.begin_search(name) == "run-1"
    assert len(services.queue.jobs) == 1
    workspace.change(name, lambda d: d.model_copy(update={"drive": AxisChoice(confirmed=True)}))
    assert services.begin_search(name) == "run-2"
