"""From a file to a handed-over model, in a real browser."""

import json

import numpy as np
import pytest

from brightgrey.app.stages.handover import TARGETS
from brightgrey.app.workspace.folder import Workspace
from brightgrey.app.workspace.progress import STAGES
from brightgrey.app.workspace.project import AxisChoice
from brightgrey.exports.registry import EXPORTS
from support.app import FEW_EFFECTS, twincat_text, visiting, write_demo
from support.small_runs import call, recording_csv

pytestmark = pytest.mark.xdist_group("running app")  # one server, and one search of the demo, for all


def few_effects(running, title):
    """Project in which the search takes a second or two, ready for its recordings."""
    workspace = Workspace(running.folder)
    made = workspace.create(title)
    workspace.change(made.name, lambda d: d.model_copy(update={"drive": AxisChoice(**FEW_EFFECTS)}))
    return made.name


def open_stage(visit, running, name, stage):
    visit.page.goto(f"{running.base}/project/{name}/{stage}")
    visit.wait("#content h1")


@pytest.fixture(scope="module")
def finished(browser, running, tmp_path_factory):
    """Project that has come the whole way with the demo file; its visit has complained of nothing."""
    file = write_demo(tmp_path_factory.mktemp("files") / "axis 1.csv")
    with visiting(browser, running) as visit:
        visit.create("X axis")
        visit.wait(".drawing svg >> visible=true")
        visit.click("continue")
        visit.upload(file)
        visit.wait(".plot .main-svg")
        assert "axis 1.csv" in visit.page.inner_text("#content")
        visit.click("continue")
        visit.wait(".grade")
        visit.click("continue")
        visit.click("start")
        visit.wait(".figures")
        visit.page.reload()  # in the middle of the search
        visit.wait(".alert.good")
        visit.click("continue")
        visit.wait(".parts .plot .main-svg")
        shown = visit.page.inner_text("#content")
        for text in (
            "Two masses, coupled by a shaft",
            "99.80\u00a0%",
            "needed",
            "Stribeck friction",
            "axis 1.csv: velocity",
        ):
            assert text in shown
        visit.click("continue")
        for target in ("c", "control"):
            visit.click(f"export-{target}")
        visit.page.fill('[data-key="torque"]', "5")
        visit.page.keyboard.press("Tab")
        visit.click("gains")
        visit.wait(".plot .main-svg")
        for target in ("c", "control"):
            assert "deviation" in visit.wait(f'[data-verified="{target}"]').inner_text()
        assert visit.page.input_value('[data-key="torque"]') == "5"
    return "x-axis"


def test_whole_way__downloads__are_the_files(browser, finished, running):
    folder = running.folder / "projects" / finished
    with visiting(browser, running) as visit:
        open_stage(visit, running, finished, "handover")
        for key, file in (("model", "model.json"), ("ranking", "ranking.csv"), ("save-report", "report.html")):
            with visit.page.expect_download() as waiting:
                visit.click(key)
            assert waiting.value.suggested_filename == file
            assert waiting.value.path().read_bytes() == (folder / "runs" / "run-1" / file).read_bytes()
        with visit.page.expect_download() as waiting:
            visit.page.click("text=drive.c")
        assert waiting.value.path().read_bytes() == (folder / "exports" / "run-1" / "c" / "drive.c").read_bytes()
        with visit.context.expect_page() as opened:
            visit.click("report")
        report = opened.value
        report.wait_for_selector(".plot .main-svg")  # its own script draws, without the rights of the app
        assert report.evaluate("window.origin") == "null"


def test_results__zoom__shows_the_samples_of_the_part_and_all_again(browser, finished, running):
    figure = """document.querySelector('[data-plot="comparison-0"]')"""
    with visiting(browser, running) as visit:
        open_stage(visit, running, finished, "results")
        visit.wait('[data-plot="comparison-0"] .main-svg')
        whole = visit.page.evaluate(f"{figure}.data[0].x.length")
        visit.page.evaluate(f"Plotly.relayout({figure}, {{'xaxis.range': [0.5, 0.6]}})")
        visit.page.wait_for_function(f"{figure}.data[0].x.length < {whole} && {figure}.layout.xaxis.range[0] == 0.5")
        assert visit.page.evaluate(f"{figure}.data[0].x.length") in range(100, 104)  # of 1000 per second
        visit.page.evaluate(f"Plotly.relayout({figure}, {{'xaxis.autorange': true}})")
        visit.page.wait_for_function(f"{figure}.data[0].x.length == {whole}")


def test_results__structure_without_an_effect__stands_beside_the_found_one(browser, finished, running):
    with visiting(browser, running, width=400, scheme="dark") as visit:
        open_stage(visit, running, finished, "results")
        visit.wait('[data-key="beside"]')
        offered = visit.page.eval_on_selector_all('[data-key="beside"] option', "all => all.map((o) => o.value)")
        less = next(name for name in offered if name == "structure:two_mass+coulomb+viscous")
        visit.page.select_option('[data-key="beside"]', less)
        visit.wait(".frame .plot .main-svg")
        shown = visit.page.inner_text("#content")
        for text in ("Stribeck friction", "M_S", "Coulomb friction", "does not explain the recording"):
            assert text in shown
        assert visit.page.is_visible('[data-label="Change in %:"]')  # the header is hidden on a telephone
        assert visit.violations() == []
        assert not visit.sticks_out()
        visit.page.select_option('[data-key="beside"]', "")
        visit.wait(".parts .plot .main-svg")


def test_results__advice__has_the_app_s_own_actions(browser, finished, running):
    with visiting(browser, running) as visit:
        open_stage(visit, running, finished, "results")
        visit.wait('[data-key="step-selftest"]')
        advice = visit.page.inner_text(".parts ul")
        assert "brightgrey" not in advice
        assert "--" not in advice
        visit.click("step-hand-over")
        visit.wait('[data-key="gains"]')


@pytest.mark.parametrize(
    ("width", "scheme"),
    [
        (1280, "light"),
        (400, "dark"),
        pytest.param(1280, "dark", marks=pytest.mark.long),
        pytest.param(400, "light", marks=pytest.mark.long),
    ],
)
def test_pages__checked_by_axe__have_no_violation_of_wcag_aa(browser, finished, running, width, scheme):
    with visiting(browser, running, width=width, scheme=scheme) as visit:
        assert visit.violations() == []
        assert not visit.sticks_out()
        ready = {
            "drive": ".drawing svg >> visible=true",
            "recording": ".plot .main-svg",
            "check": ".grade",
            "search": ".figures",
            "results": ".parts .plot .main-svg",
            "handover": "[data-verified]",
        }
        for stage in STAGES:
            open_stage(visit, running, finished, stage)
            visit.wait(ready[stage])
            for summary in visit.page.query_selector_all("summary"):
                summary.click()
            assert (stage, visit.violations()) == (stage, [])
            assert not visit.sticks_out(), stage
            dark = visit.page.evaluate("getComputedStyle(document.body).backgroundColor")
            assert dark == ("rgb(23, 23, 26)" if scheme == "dark" else "rgb(255, 255, 255)")


def test_whole_way__by_keyboard_alone__comes_to_the_recordings(browser, running):
    with visiting(browser, running) as visit:
        page = visit.page
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.className") == "skip"
        while page.evaluate("document.activeElement.dataset.key") != "title":
            page.keyboard.press("Tab")
        page.keyboard.type("Keys only")
        page.keyboard.press("Enter")
        visit.wait('[data-key="motion-rotary"]')
        page.focus('[data-key="motion-rotary"]')
        page.keyboard.press("ArrowRight")
        visit.wait('[data-key="motion-linear"]:checked')
        page.wait_for_function("document.querySelector('.drawing').textContent.includes('force')")
        page.focus('[data-key="continue"]')
        page.keyboard.press("Enter")
        visit.wait("#files")
        page.wait_for_function("document.activeElement.id == 'content'")


def test_twincat_file__whole_way__comes_to_the_model_of_the_command_line(browser, running, tmp_path, monkeypatch):
    rows = np.loadtxt(recording_csv().splitlines()[1:], delimiter=",")
    file = tmp_path / "scope.csv"
    file.write_text(twincat_text(*rows.T), encoding="utf-8")
    name = few_effects(running, "Scope")
    with visiting(browser, running, width=400, scheme="dark") as visit:
        open_stage(visit, running, name, "recording")
        visit.upload(file)
        visit.wait(".plot .main-svg")
        assert "Beckhoff TwinCAT Scope, 600 samples" in visit.page.inner_text("#content")
        visit.click("continue")
        visit.wait(".grade")
        visit.click("continue")
        visit.search()
        visit.click("continue")
        visit.wait(".parts .plot .main-svg")
        assert "Coulomb and viscous friction" in visit.page.inner_text("#content")
    folder = running.folder / "projects" / name
    model = json.loads((folder / "runs" / "run-1" / "model.json").read_text())
    assert model["parameters"]["J1"]["value"] == pytest.approx(0.02, rel=0.01)
    # The command line that the app shows gives the same files, byte for byte.
    (run,) = Workspace(running.folder).load(name).runs
    monkeypatch.chdir(folder)
    assert call(*run.arguments[:-1], tmp_path / "cli", "--workers", 1, "--quiet").code == 0
    for file in ("model.json", "ranking.csv", "report.html"):
        assert (tmp_path / "cli" / file).read_bytes() == (folder / "runs" / run.name / file).read_bytes()


def test_file_that_the_doctor_stops__remedy_applied__goes_on(browser, running, tmp_path):
    rows = np.loadtxt(recording_csv().splitlines()[1:], delimiter=",")
    rows[:, 1] *= -1.0  # a controller that counts the other way
    file = tmp_path / "turned.csv"
    np.savetxt(file, rows, delimiter=",", header="t [s],torque [N m],velocity [rad/s]", comments="")
    name = few_effects(running, "Turned")
    with visiting(browser, running) as visit:
        open_stage(visit, running, name, "recording")
        visit.upload(file)
        visit.wait(".plot .main-svg")
        visit.click("continue")
        visit.wait(".grade.stop")
        assert visit.page.is_disabled('[data-key="continue"]')
        assert visit.page.get_attribute('[data-key="stage-search"]', "aria-disabled") == "true"
        visit.page.check('[data-key="override"]')  # the other way on, with what it risks
        visit.wait('[data-key="continue"]:not([disabled])')
        visit.page.uncheck('[data-key="override"]')
        visit.wait('[data-key="continue"][disabled]')
        visit.click("apply-0")
        visit.wait('[data-key="continue"]:not([disabled])')
        assert visit.page.query_selector(".grade.stop") is None
    (recording,) = Workspace(running.folder).load(name).recordings
    assert recording.options["input_gain"] == -1.0


def test_text_that_is_no_recording__is_refused_where_it_was_dropped(browser, running, tmp_path):
    file = tmp_path / "diary.txt"
    file.write_text("Dear diary, today I measured nothing.\n<img src=x onerror=alert(1)>\n")
    name = few_effects(running, "Diary")
    with visiting(browser, running) as visit:
        open_stage(visit, running, name, "recording")
        visit.upload(file)
        said = visit.wait("#uploads .wrong").inner_text()
        assert said.startswith("diary.txt: ")
        assert visit.page.is_visible('[data-key="demo"]')
        visit.said.clear()  # Chromium notes the refusal, too


def test_names_from_outside__are_shown_as_text(browser, running, tmp_path):
    file = tmp_path / "<img src=x onerror=window.broken=1>.csv"
    text = recording_csv().replace("torque [N m]", '"<img src=y onerror=window.broken=1> torque [N m]"')
    file.write_text(text)
    name = few_effects(running, "<script>window.broken=1</script>")
    with visiting(browser, running) as visit:
        assert "<script>" in visit.page.inner_text("#content")
        open_stage(visit, running, name, "recording")
        visit.upload(file)
        visit.wait(".alert.note")  # no channel looks like a torque by its name: it is chosen by hand
        visit.page.get_by_label("Role of velocity").select_option("velocity")
        visit.wait('[data-key="at-velocity"]')
        visit.page.get_by_label("Role of <img").select_option("input")
        visit.wait(".plot .main-svg")
        visit.click("continue")
        visit.wait(".grade")
        assert visit.page.evaluate("window.broken") is None


def test_two_tabs__follow_each_other(browser, running):
    name = few_effects(running, "Two tabs")
    with visiting(browser, running) as visit:
        open_stage(visit, running, name, "drive")
        other = visit.new_tab(f"{running.base}/project/{name}/drive")
        other.wait_for_selector('[data-key="motion-linear"]')
        visit.page.check('[data-key="motion-linear"]')
        other.wait_for_selector('[data-key="motion-linear"]:checked')
        other.select_option('[data-key="most"]', "3")
        visit.page.wait_for_function("document.querySelector('[data-key=most]').value == '3'")
    drive = Workspace(running.folder).load(name).drive
    assert (drive.motion, drive.most_masses) == ("linear", 3)


def test_typed_text_that_cannot_be_used__stays_and_is_explained(browser, running):
    name = few_effects(running, "Typed")
    with visiting(browser, running) as visit:
        open_stage(visit, running, name, "drive")
        visit.page.click("text=Limits of the machine")
        visit.page.fill('[data-key="limit-torque"]', "five")
        visit.page.keyboard.press("Tab")
        assert "not a number" in visit.wait("#wrong-limit-torque").inner_text()
        assert visit.page.input_value('[data-key="limit-torque"]') == "five"
        visit.page.click("text=Known values")
        visit.click("add-known")
        visit.page.fill('[data-key="known-0"]', "J9")
        visit.page.keyboard.press("Tab")
        assert "J9" in visit.wait(".alert").inner_text()


def test_targets__are_those_of_the_exports():
    assert set(TARGETS) == set(EXPORTS)
