"""What all tests share: where the measured recordings are."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

pytest_plugins = ["support.small_run_fixtures"]

ROOT = Path(__file__).resolve().parents[1]


CHROMIUM = ("chromium", "chromium-browser", "google-chrome", "chrome")


@pytest.fixture(scope="session")
def browser():
    """Chromium of the system; there can be one in a process."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    found = next(filter(None, map(shutil.which, CHROMIUM)), None)
    if found is None:
        pytest.skip("no Chromium on the path")
    with sync_api.sync_playwright() as play:
        running = play.chromium.launch(executable_path=found, args=["--no-sandbox", "--disable-gpu"])
        yield running
        running.close()


@pytest.fixture(scope="session")
def measured() -> Callable[[str], Path]:
    """Path of a measured recording, e.g. ``measured("emps/DATA_EMPS.mat")``; skips where it is absent."""
    folder = Path(os.environ.get("BRIGHTGREY_DATA") or ROOT.parent / "shared" / "data")

    def find(name: str) -> Path:
        path = folder / name
        if not path.is_file():
            pytest.skip(f"measured recording {name} is not there (../shared/data, or BRIGHTGREY_DATA)")
        return path

    return find
