"""The app in a process of its own and a Chromium that uses it, with counts of clicks and typed fields."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

__all__ = ["AppProcess", "User", "chromium", "computing_times"]

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")


@contextmanager
def chromium() -> Iterator[Any]:
    """Chromium of the system."""
    from playwright.sync_api import sync_playwright

    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        raise SystemExit("no Chromium on the path")
    with sync_playwright() as play:
        yield play.chromium.launch(executable_path=found, args=["--no-sandbox", "--disable-gpu"])


def computing_times(root: int) -> dict[int, float]:
    """Computing time in s so far of all processes below one, by their ids."""
    shown = subprocess.run(["ps", "-eo", "pid=,ppid="], capture_output=True, text=True, check=True).stdout
    parents = {int(pid): int(parent) for pid, parent in map(str.split, shown.splitlines())}
    found, level = {}, [root]
    while level := [pid for pid, parent in parents.items() if parent in level]:
        for pid in level:
            with suppress(OSError):  # it has ended
                words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
                found[pid] = (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
    return found


class AppProcess:
    """``brightgrey app`` on a free port."""

    def __init__(self, folder: Path) -> None:
        # A user's Python keeps what it has compiled.
        own = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        self.begun = time.perf_counter()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "brightgrey", "app", str(folder), "--no-browser"],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            start_new_session=True,
            env=own,
        )
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if found := re.search(r"Open (\S+)", line):
                self.url = found.group(1)
                break
        self.base = self.url.partition("/?")[0]

    def children(self) -> list[int]:
        """Processes that the server has started, but for searches and other commands."""
        shown = subprocess.run(["ps", "-eo", "pid=,ppid=,args="], capture_output=True, text=True, check=True).stdout
        rows = [line.split(maxsplit=2) for line in shown.splitlines()]
        return [
            int(pid) for pid, parent, said in rows if int(parent) == self.process.pid and "-m brightgrey" not in said
        ]

    def memory(self) -> float:
        """Largest memory of the server and its desk so far, together, in MB."""
        total = 0
        for pid in (self.process.pid, *self.children()):
            text = Path(f"/proc/{pid}/status").read_text()
            total += int(re.search(r"VmHWM:\s+(\d+)", text)[1])
        return total / 1024.0

    def resident(self) -> float:
        """Memory of the server and its desk now, together, in MB."""
        pages = sum(int(Path(f"/proc/{p}/statm").read_text().split()[1]) for p in (self.process.pid, *self.children()))
        return pages * os.sysconf("SC_PAGE_SIZE") / 2**20

    def end(self) -> None:
        """End it as Ctrl-C does."""
        self.process.send_signal(2)
        self.process.wait(60)


class User:
    """Somebody at a browser; every click and every typed field is counted."""

    def __init__(self, browser: Any, url: str, width: int = 1280, scheme: str = "light") -> None:
        self.page = browser.new_context(
            viewport={"width": width, "height": 900}, color_scheme=scheme, accept_downloads=True
        ).new_page()
        self.page.set_default_timeout(1_800_000)
        self.clicks = self.typed = 0
        self.page.goto(url)
        self.page.wait_for_selector("h1")

    def click(self, key: str) -> None:
        """Click an element."""
        self.page.click(f'[data-key="{key}"]:not([disabled])')
        self.clicks += 1

    def fill(self, key: str, text: str) -> None:
        """Type into a field."""
        self.page.fill(f'[data-key="{key}"]', text)
        self.page.keyboard.press("Tab")
        self.typed += 1

    def select(self, label: str, value: str) -> None:
        """Choose from a list: two clicks."""
        self.page.get_by_label(label).first.select_option(value)
        self.clicks += 2

    def upload(self, path: Path) -> None:
        """Choose a file: a click on the button, and one in the dialogue of the system."""
        self.page.set_input_files("#files", str(path))
        self.clicks += 2

    def wait(self, selector: str) -> None:
        """Wait for an element that is seen."""
        self.page.wait_for_selector(selector)
