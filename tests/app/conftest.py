"""A browser, and a running app with a workspace that a module's tests share."""

import pytest

from support.app import RunningApp, find_browser


@pytest.fixture(scope="session")
def browser():
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    found = find_browser()
    with sync_api.sync_playwright() as play:
        running = play.chromium.launch(executable_path=found, args=["--no-sandbox", "--disable-gpu"])
        yield running
        running.close()


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    app = RunningApp(tmp_path_factory.mktemp("workspace"))
    yield app
    assert "Traceback" not in app.end()
