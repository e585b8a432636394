"""What all tests share: where the measured recordings are."""

from __future__ import annotations

import gc
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import scipy.linalg  # noqa: F401  the threads of its BLAS can be limited only when it is loaded

from brightgrey.runs.blas_threads import limit_blas_threads

limit_blas_threads()  # as the searches of the package do; idle threads of small products cost more than the products
gc.set_threshold(50_000)  # as the command does; what is imported and collected stays

pytest_plugins = ["support.small_run_fixtures"]

ROOT = Path(__file__).resolve().parents[1]
GROUPS = ("extended package", "running app", "small searches")
"""Groups of tests in several files that share what takes long to make, those that take longest first."""
LARGE = {"search", "simulation", "estimation"}
"""Folders with long files."""
OF_THE_SYSTEM = {"browser", "running", "small", "extended"}
"""Fixtures of system tests: Chromium, the app's server, searches to be killed, a copy of the package to be extended."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Let each group of tests, or else each file, run in one process, so that nothing is made in two of them.

    The long ones begin first: begun last, one would leave the other processes idle. Tests of the system are marked.
    """
    ranks = {}
    for item in items:
        if not OF_THE_SYSTEM.isdisjoint(item.fixturenames):
            item.add_marker(pytest.mark.system)
        mark, file = item.get_closest_marker("xdist_group"), item.path.relative_to(ROOT)
        if mark is None:
            item.add_marker(pytest.mark.xdist_group(str(file)))
        ranks[item] = GROUPS.index(mark.args[0]) if mark else len(GROUPS) + (file.parts[1] not in LARGE)
    items.sort(key=ranks.__getitem__)


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
