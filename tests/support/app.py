"""The app in a process of its own, and a browser that visits it and notes all that it asks for and complains of."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest

from brightgrey.excitation import demo_recording

RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"]
FEW_EFFECTS = {
    "confirmed": True,
    "most_masses": 1,
    "absent": ("current_control", "delay", "gravity", "stribeck", "pendulum", "ground_spring", "directional_viscous"),
}
"""What leaves a search of a second or two."""


class RunningApp:
    """A server on a free port."""

    def __init__(self, folder, *more, environment=None):
        pytest.importorskip("nicegui", reason="NiceGUI is not installed")
        self.folder = folder
        self.said = folder.with_name(f"{folder.name}.out")
        self.complained = folder.with_name(f"{folder.name}.err")
        self.begun = time.monotonic()
        with self.said.open("w") as out, self.complained.open("w") as err:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "brightgrey", "app", str(folder), "--no-browser", *more],
                stdout=out,
                stderr=err,
                start_new_session=True,
                env=_without_pytest({**os.environ, "MPLBACKEND": "agg", **(environment or {})}),
            )
        self.start_url = self._start_url()
        self.ready = time.monotonic() - self.begun
        self.base = "http://" + urlsplit(self.start_url).netloc
        self.port = urlsplit(self.start_url).port

    def _start_url(self):
        end = time.monotonic() + 60.0
        while time.monotonic() < end and self.process.poll() is None:
            found = re.search(r"Open (\S+)\n", self.said.read_text())
            if found:
                return found.group(1)
            time.sleep(0.01)
        raise AssertionError(self.complained.read_text())

    def end(self, number=signal.SIGINT):
        """End it; gives what it has written to stderr."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        self.process.wait(60)
        return self.complained.read_text()

    def kill_all(self):
        """End the server and all that it has started, as a power cut does."""
        children = descendants(self.process.pid)
        for pid in (self.process.pid, *children):
            os.kill(pid, signal.SIGKILL)
        self.process.wait()


def _without_pytest(environment):
    """Environment in which NiceGUI does not believe that it is tested from within."""
    return {name: value for name, value in environment.items() if not name.startswith("PYTEST")}


def descendants(pid):
    """Processes that a process has started, and those that they have started."""
    shown = subprocess.run(["ps", "-eo", "pid=,ppid="], capture_output=True, text=True, check=True).stdout
    parents = {int(a): int(b) for a, b in (line.split() for line in shown.splitlines())}
    found, new = [], [pid]
    while new:
        new = [child for child, parent in parents.items() if parent in new]
        found += new
    return found


class Visit:
    """A tab with what it has complained of and asked for."""

    def __init__(self, browser, url, width=1280, scheme="light"):
        self.context = browser.new_context(
            viewport={"width": width, "height": 900}, color_scheme=scheme, accept_downloads=True
        )
        self.width = width
        self.said, self.asked = [], []
        self.page = self.new_tab(url)

    def new_tab(self, url):
        """Open another tab of the same browser."""
        page = self.context.new_page()
        page.set_default_timeout(240_000)  # the kernel may have to be compiled first
        page.on("console", lambda message: self.said.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: self.said.append(str(error)))
        page.on("request", lambda request: self.asked.append(request.url))
        page.on("websocket", lambda socket: self.asked.append(socket.url))
        page.goto(url)
        page.wait_for_selector("h1")
        return page

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        """Close the browser's window."""
        self.context.close()

    def click(self, key):
        """Click the element with a key."""
        self.page.click(f'[data-key="{key}"]:not([disabled])')

    def wait(self, selector):
        """Wait for an element that is seen."""
        return self.page.wait_for_selector(selector)

    def foreign(self):
        """Addresses that are not this machine's."""
        return [
            url
            for url in self.asked
            if urlsplit(url).hostname != "127.0.0.1" and not url.startswith(("data:", "blob:"))
        ]

    def violations(self):
        """What axe-core finds against WCAG 2.2 AA, in short."""
        axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is missing")
        found = axe.Axe().run(self.page, options={"runOnly": RULES, "resultTypes": ["violations"]})
        return [(v["id"], v["nodes"][0]["html"][:200]) for v in found.response["violations"]]

    def sticks_out(self):
        """True if the page is wider than the window."""
        return self.page.evaluate("document.documentElement.scrollWidth") > self.width

    # The steps of a user.

    def create(self, title):
        """Make a project, and go on to its recordings."""
        self.page.fill('[data-key="title"]', title)
        self.page.keyboard.press("Enter")
        self.wait('[data-key="motion-rotary"]')

    def upload(self, path):
        """Choose a file."""
        self.page.set_input_files("#files", str(path))

    def search(self):
        """Start the search and wait for its end."""
        self.click("start")
        self.wait(".alert.good")


@contextmanager
def visiting(browser, app, **how):
    """A visit that must end without a complaint, and that has asked this machine only."""
    with Visit(browser, app.start_url, **how) as visit:
        yield visit
        assert visit.said == []
        assert visit.foreign() == []


def twincat_text(t, u, y):
    """Export of a TwinCAT scope with a torque in N m and a velocity in rad/s, each with a time column of its own."""
    rows = [
        ("Name", "scope"),
        ("File", "drive.csv"),
        ("Starttime of export", "132959733843760000", "Montag, 2. Mai 2022", "15:56:24.376"),
        ("Endtime of export", "132959733853750000", "Montag, 2. Mai 2022", "15:56:25.375"),
        (),
        (),
        ("Name", "torque", "Name", "velocity"),
        ("SymbolComment", "", "SymbolComment", ""),
        ("Data-Type", "REAL64", "Data-Type", "REAL64"),
        ("SampleTime[ms]", "1", "SampleTime[ms]", "1"),
        ("VariableSize", "8", "VariableSize", "8"),
        ("SymbolBased", "True", "SymbolBased", "True"),
        ("IndexGroup", "16448", "IndexGroup", "16448"),
        ("IndexOffset", "385000", "IndexOffset", "385008"),
        ("SymbolName", "MAIN.torque", "SymbolName", "MAIN.velocity"),
        ("NetID", "192.168.178.20.1.1", "NetID", "192.168.178.20.1.1"),
        ("Port", "851", "Port", "851"),
        ("Offset", "0", "Offset", "0"),
        ("ScaleFactor", "1", "ScaleFactor", "1"),
        ("BitMask", "0xffffffffffffffff", "BitMask", "0xffffffffffffffff"),
        ("Unit", "Nm (Torque)", "Unit", "rad/s (Velocity)"),
        ("Unit ScaleFactor", "1", "Unit ScaleFactor", "1"),
        ("Unit Offset", "0", "Unit Offset", "0"),
        (),
        *((f"{1e3 * a:g}", f"{b:.9g}", f"{1e3 * a:g}", f"{c:.6f}") for a, b, c in zip(t, u, y, strict=True)),
    ]
    return "\n".join("\t".join(row) for row in rows).replace(".", ",") + "\n"


def write_demo(path):
    """Write the recording that comes with the package."""
    path.write_text(demo_recording(), encoding="utf-8")
    return path
