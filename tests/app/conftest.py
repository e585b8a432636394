"""A running app with a workspace that all tests share that do not end it."""

import pytest

from support.app import RunningApp


@pytest.fixture(scope="session")
def running(tmp_path_factory):
    app = RunningApp(tmp_path_factory.mktemp("workspace"))
    yield app
    said = app.end()
    assert "Traceback" not in said
    assert "deleted" not in said  # NiceGUI's word for a closed page that is still worked on
