"""The app with a stopwatch: clicks and seconds from ``brightgrey app`` to report and FMU, its reaction, its memory.

    python bench/app.py stopwatch [--files demo twincat emps] [--save]
    python bench/app.py first-page [--starts 10] [--save]
    python bench/app.py reaction [--clicks 60] [--save]
    python bench/app.py clone [--save]
    python bench/app.py pictures docs/tutorial

The first does what a new user does: project, file, what has to be said of its channels, check, search, report, FMU. The
second starts the app again and again. The third clicks between stages while a search runs. The fourth clones the
repository and types ``make app`` there. The last makes the pictures of docs/tutorial/with-the-app.md.
"""

from __future__ import annotations

import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from http.cookiejar import CookieJar
from pathlib import Path

import numpy as np

from brightgrey.excitation import PAPER_EXPERIMENT as EXPERIMENT
from brightgrey.excitation import demo_recording
from brightgrey.simulation.reference import reference
from support.app_driver import AppProcess, User, chromium, computing_times
from support.measured import DATA
from support.results import Table, arguments, publish

MEASURE = """
([from, to]) => new Promise((done) => {
  const aim = document.querySelector(`[data-key="stage-${to}"]`);
  const begun = performance.now();
  const watch = new MutationObserver(() => {
    const now = document.querySelector(`[data-key="stage-${to}"]`);
    if (now && now.getAttribute("aria-current")) { watch.disconnect(); done(performance.now() - begun); }
  });
  watch.observe(document.body, { childList: true, subtree: true, attributes: true });
  aim.click();
  setTimeout(() => { watch.disconnect(); done(5000); }, 5000);  // a lost click counts as that
})
"""
TWINCAT_HEAD = (
    ("Name", "scope"),
    ("File", "drive.csv"),
    ("Starttime of export", "132959733843760000", "Montag, 2. Mai 2022", "15:56:24.376"),
    ("Endtime of export", "132959733853750000", "Montag, 2. Mai 2022", "15:56:25.375"),
    (),
    (),
    ("Name", "Axis.Torque", "Name", "Axis.Velocity"),
    ("Data-Type", "REAL64", "Data-Type", "REAL64"),
    ("SampleTime[ms]", "1", "SampleTime[ms]", "1"),
    ("SymbolName", "MAIN.torque", "SymbolName", "MAIN.velocity"),
    ("Offset", "0", "Offset", "0"),
    ("ScaleFactor", "1", "ScaleFactor", "1"),
    ("Unit", "Nm (Torque)", "Unit", "rad/s (Velocity)"),
    ("Unit ScaleFactor", "1", "Unit ScaleFactor", "1"),
    ("Unit Offset", "0", "Unit Offset", "0"),
    (),
)


def demo_file(folder: Path) -> Path:
    """Write the recording that comes with the package."""
    path = folder / "demo.csv"
    path.write_text(demo_recording(), encoding="utf-8")
    return path


def twincat_file(folder: Path) -> Path:
    """Write an export of a TwinCAT scope, decimal comma and all, of a simulated two-mass drive with noise."""
    values = {"J1": 0.012, "J2": 0.008, "c1": 75.0, "d1": 0.036, "M_C": 0.9, "f_v": 0.015}
    u = EXPERIMENT.torque()
    (y,) = reference("two_mass+coulomb+viscous", values, u, EXPERIMENT.dt, f_tanh=EXPERIMENT.f_tanh)
    y = y + 1e-3 * np.abs(y).max() * np.random.default_rng(5).standard_normal(y.size)
    t = 1e3 * EXPERIMENT.dt * np.arange(u.size)
    rows = [*TWINCAT_HEAD, *((f"{a:g}", f"{b:.9g}", f"{a:g}", f"{c:.6f}") for a, b, c in zip(t, u, y, strict=True))]
    path = folder / "scope.csv"
    path.write_text("\n".join("\t".join(row) for row in rows).replace(".", ",") + "\n", encoding="utf-8")
    return path


def measured_axis(folder: Path) -> Path:
    """Return the recording of the EMPS, a measured positioning axis."""
    return DATA / "emps" / "DATA_EMPS.mat"


FILES = {
    "demo": ("the demo file", demo_file),
    "twincat": ("a TwinCAT scope of a simulated drive", twincat_file),
    "emps": ("EMPS, a measured axis", measured_axis),
}


def whole_way(user: User, title: str, file: Path) -> tuple[float, float]:
    """Go from the first page to report and FMU; gives the seconds until the search and those that it took."""
    begun = time.perf_counter()
    user.fill("title", title)
    user.click("create")
    user.click("continue")
    user.wait("#files")
    user.upload(file)
    user.wait('[data-key="continue"]')
    user.page.wait_for_selector("table")
    if file.suffix == ".mat":  # the channels of EMPS are called vir and qm, which says nothing
        user.select("Role of vir", "input")
        user.wait('[data-key="unit-vir"]')
        user.select("Role of qm", "position")
    user.wait(".plot .main-svg")
    user.click("continue")
    user.wait(".grade")
    if user.page.is_disabled('[data-key="continue"]'):
        user.click("override")
    user.click("continue")
    user.wait('[data-key="start"]')
    before = time.perf_counter()
    user.click("start")
    user.wait(".alert.good")
    after = time.perf_counter()
    user.click("continue")
    user.wait(".parts .plot .main-svg")
    user.click("continue")
    user.click("export-fmu")
    with user.page.context.expect_page() as opened:
        user.click("report")
    opened.value.wait_for_selector(".plot .main-svg")
    user.wait('[data-verified="fmu"]')
    with user.page.expect_download():
        user.page.click("text=drive.fmu")
    user.clicks += 1
    return time.perf_counter() - begun, after - before


def stopwatch(names: list[str]) -> list[Table]:
    """Protocol of the files."""
    rows = []
    with chromium() as browser, tempfile.TemporaryDirectory() as folder:
        for name in names:
            title, make = FILES[name]
            file = make(Path(folder))
            app = AppProcess(Path(folder) / f"workspace-{name}")
            user = User(browser, app.url)
            first = time.perf_counter() - app.begun
            whole, search = whole_way(user, title, file)
            rows.append(
                [
                    title,
                    f"{first:.1f}",
                    str(user.clicks),
                    str(user.typed),
                    f"{whole:.0f}",
                    f"{search:.0f}",
                    f"{whole - search:.0f}",
                    f"{app.memory():.0f}",
                ]
            )
            print(rows[-1], file=sys.stderr)
            app.end()
    columns = ["file", "first page, s", "clicks", "fields typed", "whole way, s", "search, s", "rest, s", "memory, MB"]
    return [Table("From the start to report and FMU", columns, rows)]


def first_page(count: int) -> list[Table]:
    """Time from the start of the app to the first page, and the computing time of server and browser until then."""
    taken = []
    with chromium() as browser, tempfile.TemporaryDirectory() as folder:
        for number in range(count):
            before = sum(computing_times(os.getpid()).values())
            app = AppProcess(Path(folder) / f"workspace-{number}")
            user = User(browser, app.url)
            seconds, now = time.perf_counter() - app.begun, computing_times(os.getpid())
            desk = sum(now.get(pid, 0.0) for pid in app.children())
            server = now[app.process.pid]
            taken.append((seconds, server, sum(now.values()) - before - server - desk))
            print(taken[-1], file=sys.stderr)
            user.page.context.close()
            app.end()
    kinds = (("median", np.median), ("least", min))
    rows = [[f"{name} of {count}", *(f"{of(part):.1f}" for part in zip(*taken, strict=True))] for name, of in kinds]
    columns = ["", "time", "computing time of the server", "computing time of the browser"]
    return [Table("From the start to the first page, s", columns, rows)]


def reaction(count: int) -> list[Table]:
    """Times from a click to the stage that it opens, at rest and while a search runs."""
    rows = []
    with chromium() as browser, tempfile.TemporaryDirectory() as folder:
        app = AppProcess(Path(folder) / "workspace")
        user = User(browser, app.url)
        user.fill("title", "Reaction")
        user.click("create")
        user.click("continue")
        user.upload(demo_file(Path(folder)))
        user.wait(".plot .main-svg")
        user.click("continue")
        user.wait(".grade")
        user.click("continue")
        user.wait('[data-key="start"]')
        rows.append(["no search", *_reactions(user, count)])
        user.click("stage-search")
        user.click("start")
        user.wait(".figures")
        rows.append(["a search runs", *_reactions(user, count, while_running=True)])
        rows.append(["memory of server and desk, MB", f"{app.memory():.0f}", "", ""])
        app.end()
    return [Table("From a click to the stage that it opens, ms", ["", "median", "95th percentile", "clicks"], rows)]


def _reactions(user: User, count: int, *, while_running: bool = False) -> list[str]:
    """Click to and fro between two stages."""
    taken, stages = [], ["drive", "search"]
    for number in range(count):
        taken.append(user.page.evaluate(MEASURE, [stages[number % 2 - 1], stages[number % 2]]))
        user.page.wait_for_timeout(80)
        if while_running and number % 2 and not user.page.query_selector('[data-key="stop"]'):
            break
    return [f"{np.median(taken):.0f}", f"{np.percentile(taken, 95):.0f}", str(len(taken))]


def clone() -> list[Table]:
    """Time from ``git clone`` and ``make app`` to the first page, with packages from where pip takes them."""
    root = Path(__file__).parents[1]
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile("w+") as said:
        before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run(["git", "clone", "--quiet", str(root), f"{folder}/clone"], check=True)
        own = {**{k: v for k, v in os.environ.items() if k != "PYTHONPATH"}, "BROWSER": "true"}  # opens nothing
        made = subprocess.Popen(
            ["make", "app"], cwd=f"{folder}/clone", stdout=said, stderr=said, env=own, start_new_session=True
        )
        found = None
        while found is None and made.poll() is None:
            time.sleep(0.05)
            said.seek(0)
            found = re.search(r"Open (\S+)\n", said.read())
        if found is None:
            raise SystemExit("make app has ended without a page")
        browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(CookieJar()))
        assert b"From a recording" in browser.open(found[1]).read()
        taken = time.perf_counter() - begun
        os.killpg(made.pid, signal.SIGINT)
        made.wait()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(["rm", "-rf", f"{folder}/clone"], check=True)  # in a moment
    computing = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return [
        Table("From git clone to the first page, s", ["time", "computing time"], [[f"{taken:.0f}", f"{computing:.0f}"]])
    ]


def pictures(target: Path) -> None:
    """Make the pictures of the page: few colours keep them small."""
    from PIL import Image

    with chromium() as browser, tempfile.TemporaryDirectory() as folder:
        app = AppProcess(Path(folder) / "workspace")
        user = User(browser, app.url, width=1000)
        user.page.set_viewport_size({"width": 1000, "height": 760})
        user.fill("title", "X axis")
        user.click("create")
        user.click("continue")
        user.upload(demo_file(Path(folder)))
        user.wait(".plot .main-svg")

        def picture(name: str) -> None:
            user.page.wait_for_timeout(500)
            path = target / f"app-{name}.png"
            user.page.screenshot(path=path)
            Image.open(path).convert("P", palette=Image.Palette.ADAPTIVE, colors=48).save(path, optimize=True)

        picture("recording")
        user.click("continue")
        user.click("continue")
        user.click("start")
        user.wait("table")
        picture("search")
        user.wait(".alert.good")
        user.click("continue")
        user.wait(".parts .plot .main-svg")
        picture("results")
        app.end()


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("what", choices=("stopwatch", "first-page", "reaction", "clone", "pictures"))
    parser.add_argument("folder", nargs="?", type=Path, default=Path("docs/tutorial"))
    parser.add_argument("--files", nargs="+", choices=tuple(FILES), default=list(FILES))
    parser.add_argument("--clicks", type=int, default=60)
    parser.add_argument("--starts", type=int, default=10)
    options = parser.parse_args()
    if options.what == "pictures":
        pictures(options.folder)
        return
    made = {
        "stopwatch": lambda: stopwatch(options.files),
        "first-page": lambda: first_page(options.starts),
        "reaction": lambda: reaction(options.clicks),
        "clone": clone,
    }
    publish("app", made[options.what](), to_file=options.save)


if __name__ == "__main__":
    main()
