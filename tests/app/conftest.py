"""A browser, and a running app with a workspace that a module's tests share."""

import pytest

from support.app import RunningApp


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    app = RunningApp(tmp_path_factory.mktemp("workspace"))
    yield app
    assert "Traceback" not in app.end()
