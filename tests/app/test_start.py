"""What the server does before its first page is shown: no more than the page needs."""

import subprocess
import sys
import time

import pytest

from support.app import RunningApp, descendants, visiting


def test_server__imported__loads_neither_numpy_nor_the_readers():
    pytest.importorskip("nicegui", reason="NiceGUI is not installed")
    show = "print(*(m for m in ('numpy', 'brightgrey.recordings') if m in sys.modules))"
    code = f"import sys, brightgrey.app.server; {show}"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said == "\n"


def test_desk__begins_when_the_first_page_is_shown(browser, tmp_path):
    app = RunningApp(tmp_path / "w")
    before = descendants(app.process.pid)
    assert len(before) <= 1  # what multiprocessing keeps beside a server that has begun no process yet
    with visiting(browser, app) as visit:
        end = time.monotonic() + 60.0
        while descendants(app.process.pid) == before and time.monotonic() < end:
            visit.page.wait_for_timeout(50)
        assert descendants(app.process.pid) != before
    assert "Traceback" not in app.end()
