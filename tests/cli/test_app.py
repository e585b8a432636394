"""``brightgrey app`` refuses what it cannot use, in one line."""

import socket

import pytest

from support.small_runs import call


def test_app__port_in_use__is_refused(tmp_path):
    pytest.importorskip("nicegui", reason="NiceGUI is not installed")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        done = call("app", tmp_path / "w", "--port", taken.getsockname()[1])
    assert done.code == 2
    assert "cannot listen on '127.0.0.1:" in done.err


def test_app__foreign_address__is_refused(tmp_path, monkeypatch):
    pytest.importorskip("nicegui", reason="NiceGUI is not installed")
    monkeypatch.setenv("BRIGHTGREY_PASSWORD", "secret")
    done = call("app", tmp_path / "w", "--host", "192.0.2.1")
    assert done.code == 2
    assert "cannot listen on '192.0.2.1'" in done.err
