"""What takes minutes: large files, many files, many searches, a measured drive, every export, plan and self-test."""

import gzip
import http.client
import re
import threading
from contextlib import closing, contextmanager
from pathlib import Path
from urllib.parse import quote

import pytest

from brightgrey.app.security.memory import memory_allowed
from brightgrey.app.stages.handover import TARGETS
from brightgrey.app.workspace.folder import Workspace
from brightgrey.app.workspace.project import AxisChoice, CheckDecision, digest_of_recordings
from support.app import FEW_EFFECTS, RunningApp, descendants, visiting
from support.small_runs import recording_csv

pytestmark = pytest.mark.long
GIGABYTE = 1 << 30


def upload(app, name, label, content, length):
    """Send a file as the page does; gives the status."""
    with closing(http.client.HTTPConnection("127.0.0.1", app.port, timeout=900)) as connection:
        connection.request("GET", "/?" + app.start_url.partition("?")[2])
        first = connection.getresponse()
        first.read()
        cookie = first.headers["set-cookie"].partition(";")[0]
        headers = {"Cookie": cookie, "Origin": app.base, "X-File-Name": quote(label), "Content-Length": str(length)}
        connection.request("POST", f"/upload/{name}", content, headers)
        found = connection.getresponse()
        return found.status, found.read()


def memory(app):
    """Memory of the server and its desk, in MB."""
    total = 0
    for pid in (app.process.pid, *descendants(app.process.pid)):
        try:
            total += int(re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{pid}/status").read_text())[1])
        except (OSError, TypeError):
            continue
    return total / 1024.0


@contextmanager
def peak_memory(app):
    """Largest memory of the server and its desk, in MB, as the last item of a list."""
    seen, over = [0.0], threading.Event()

    def watch():
        while not over.wait(0.1):
            seen.append(max(seen[-1], memory(app)))

    watching = threading.Thread(target=watch)
    watching.start()
    try:
        yield seen
    finally:
        over.set()
        watching.join()


def test_upload__of_two_gigabytes__is_streamed_and_answered_within_the_memory(tmp_path):
    app = RunningApp(tmp_path / "w")
    name = Workspace(app.folder).create("Large").name
    text = recording_csv().encode()
    head, rows = text.split(b"\n", 1)
    large = tmp_path / "large.csv"
    with large.open("wb") as stream:
        stream.write(head + b"\n")
        while stream.tell() < 2 * GIGABYTE:
            stream.write(rows * 200)
    allowed = memory_allowed() / 2**20
    with large.open("rb") as stream, peak_memory(app) as seen:
        status, said = upload(app, name, "large.csv", stream, large.stat().st_size)
    print(f"answer {status} {said}, peak {seen[-1]:.0f} MB of {allowed:.0f} MB that are allowed")
    assert status in (200, 422), said  # its time runs back, which is a fault of a recording: both are an answer
    assert seen[-1] < allowed + 400.0  # the server itself has its own memory
    assert upload(app, name, "small.csv", text, len(text))[0] == 200
    assert "Traceback" not in app.end()


def test_hundred_uploads__memory_does_not_grow(tmp_path):
    app = RunningApp(tmp_path / "w")
    workspace = Workspace(app.folder)
    text = recording_csv().encode()
    packed = gzip.compress(text)
    used = []
    for number in range(100):
        if number % 20 == 0:
            name = workspace.create(f"Many {number}").name
            workspace.change(name, lambda d: d.model_copy(update={"drive": AxisChoice(**FEW_EFFECTS)}))
        content = packed if number % 2 else text
        assert upload(app, name, f"axis {number}.csv", content, len(content))[0] == 200
        used.append(memory(app))
    print(f"memory after 21 and 100 uploads: {used[20]:.0f} and {used[-1]:.0f} MB")
    assert used[-1] < used[20] + 60.0
    assert "Traceback" not in app.end()


def test_twenty_searches__in_a_row__leave_nothing_behind(browser, tmp_path):
    app = RunningApp(tmp_path / "w")
    workspace = Workspace(app.folder)
    name = workspace.create("Searches").name
    source = workspace.path(name) / "recordings" / ".upload"
    source.write_text(recording_csv())
    workspace.add_recording(name, source, "axis.csv", "0" * 64, {"input": "torque", "output": ["velocity:velocity"]})

    def ready(seed):
        def edit(document):
            check = CheckDecision(digest=digest_of_recordings(document), grade="note")
            search = document.search.model_copy(update={"seed": seed})
            return document.model_copy(update={"drive": AxisChoice(**FEW_EFFECTS), "check": check, "search": search})

        workspace.change(name, edit)

    used = []
    with visiting(browser, app) as visit:
        for seed in range(20):
            ready(seed)
            visit.page.goto(f"{app.base}/project/{name}/search")
            visit.search()
            used.append(memory(app))
    assert len(workspace.load(name).runs) == 20
    print(f"memory after 5 and 20 searches: {used[4]:.0f} and {used[-1]:.0f} MB")
    assert used[-1] < used[4] + 60.0
    assert len(descendants(app.process.pid)) <= 3  # the desk, and what multiprocessing keeps beside it
    assert "Traceback" not in app.end()


def test_mte360__three_recordings__come_to_two_masses(browser, measured, tmp_path):
    app = RunningApp(tmp_path / "w")
    with visiting(browser, app) as visit:
        visit.page.set_default_timeout(7_200_000)  # beside other work the search has a part of one core
        visit.create("MTE360")
        visit.click("continue")
        for file in ("1_5", "sine_1", "sine_3"):
            visit.upload(measured(f"mte360/velocity_response_{file}.mat"))
            visit.page.wait_for_function("document.querySelectorAll('#uploads li').length == 0")
        visit.page.wait_for_function("document.querySelectorAll('[data-recording]').length == 3")
        visit.page.get_by_label("Role of u").select_option("input")
        visit.wait('[data-key="unit-u"]')
        visit.page.fill('[data-key="unit-u"]', "V")
        visit.page.keyboard.press("Tab")
        visit.page.get_by_label("Role of v1").select_option("velocity-differenced")
        visit.wait('[data-key="unit-v1"]')
        visit.page.fill('[data-key="unit-v1"]', "mm/s")
        visit.page.keyboard.press("Tab")
        visit.page.wait_for_function("document.querySelectorAll('.plot .main-svg').length >= 3")
        visit.click("continue")
        visit.wait(".grade")
        if visit.page.is_disabled('[data-key="continue"]'):
            visit.page.check('[data-key="override"]')
        visit.click("continue")
        visit.search()
        visit.click("continue")
        visit.wait(".parts .plot .main-svg")
        assert "Two masses" in visit.page.inner_text("#content")
    app.end()


def test_hand_over__every_export_plan_and_self_test__are_made(browser, tmp_path):
    app = RunningApp(tmp_path / "w")
    with visiting(browser, app) as visit:
        visit.page.set_default_timeout(7_200_000)  # beside other work the search has a part of one core
        visit.create("Axis")
        visit.click("continue")
        visit.click("demo")
        visit.wait(".plot .main-svg")
        visit.click("continue")
        visit.wait(".grade")
        visit.click("continue")
        visit.search()
        visit.click("continue")
        visit.click("selftest")
        visit.wait('[data-key="stop-selftest"]')
        visit.page.wait_for_selector("h2:text('Would this recording find the model again?')")
        visit.click("stage-handover")
        visit.click("export-all")
        visit.page.wait_for_function(f"document.querySelectorAll('[data-verified]').length == {len(TARGETS)}")
        assert visit.page.query_selector("[data-verified].warn") is None
        visit.click("plan")
        visit.wait('[data-key="plan-csv"]')
        assert visit.violations() == []
    app.end()
