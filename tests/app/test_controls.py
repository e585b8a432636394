"""What is chosen or typed while the page is made anew, in a real browser."""

import pytest

from brightgrey.app.workspace.folder import Workspace
from brightgrey.app.workspace.project import AxisChoice
from support.app import visiting
from support.small_runs import recording_csv

pytestmark = pytest.mark.xdist_group("running app")

CHANGE = """
for (const [key, value] of Object.entries(%s)) {
  const field = document.querySelector(`[data-key="${key}"]`);
  field.value = value;
  field.dispatchEvent(new Event("change", { bubbles: true }));
}
"""


def project(running, title):
    """Project that is open at its recordings."""
    workspace = Workspace(running.folder)
    name = workspace.create(title).name
    workspace.change(name, lambda d: d.model_copy(update={"drive": AxisChoice(confirmed=True)}))
    return name


def saved(running, name):
    return Workspace(running.folder).load(name)


def test_fields__changed_before_the_server_has_answered__are_all_kept(browser, running, tmp_path):
    file = tmp_path / "axis.csv"
    file.write_text(recording_csv(), encoding="utf-8")
    name = project(running, "Quick")
    with visiting(browser, running) as visit:
        visit.page.goto(f"{running.base}/project/{name}/recording")
        visit.upload(file)
        visit.wait('[data-key="unit-velocity"]')
        chosen = {"unit-torque": "N", "role-velocity": "velocity-differenced", "at-velocity": "2"}
        visit.page.evaluate(CHANGE % ({**chosen, "unit-velocity": "mm/s"},))
        visit.wait('[data-key="unit-velocity"][value="mm/s"]')  # as the server has it
        (recording,) = saved(running, name).recordings
        assert recording.options["output"] == ["velocity:velocity-differenced@2"]
        assert set(recording.options["unit"]) >= {"torque=N", "velocity=mm/s"}


def test_text_field__page_made_anew_while_typing__keeps_text_and_focus_and_saves(browser, running):
    name = project(running, "Typing")
    with visiting(browser, running) as visit:
        page = visit.page
        page.goto(f"{running.base}/project/{name}/drive")
        page.click("text=Limits of the machine")
        page.focus('[data-key="limit-torque"]')
        page.keyboard.type("12")
        other = visit.new_tab(f"{running.base}/project/{name}/drive")
        other.check('[data-key="motion-linear"]')
        page.wait_for_selector('[data-key="motion-linear"]:checked')
        page.wait_for_function("document.querySelector('[data-key=limit-torque]').value == '12'")
        page.keyboard.type("5")
        page.keyboard.press("Tab")
        page.wait_for_selector('[data-key="limit-torque"][value="125"]')
        assert page.evaluate("document.activeElement.dataset.key") == "limit-rms_torque"
        assert saved(running, name).drive.limits == {"torque": "125"}


def test_continue__pressed_slowly_right_after_typing__opens_the_next_stage_and_keeps_the_text(browser, running):
    name = project(running, "Slow press")
    with visiting(browser, running) as visit:
        page = visit.page
        page.goto(f"{running.base}/project/{name}/drive")
        page.click("text=Limits of the machine")
        page.focus('[data-key="limit-speed"]')
        page.keyboard.type("3")
        page.hover('[data-key="continue"]')
        page.mouse.down()  # ends the typing
        page.wait_for_timeout(400)  # longer than the server takes to answer
        page.mouse.up()
        visit.wait("#files")
        assert saved(running, name).drive.limits == {"speed": "3"}


def test_continue__drawing_still_to_come__stands_where_it_stays(browser, running):
    name = project(running, "Late drawing")
    top = "document.querySelector('[data-key=continue]').getBoundingClientRect().top"
    with visiting(browser, running) as visit:
        visit.page.goto(f"{running.base}/project/{name}/drive")
        visit.wait(".drawing svg")
        drawn = visit.page.evaluate(top)
        visit.page.evaluate("document.querySelector('.drawing').replaceChildren()")
        assert visit.page.evaluate(top) == pytest.approx(drawn, abs=1.0)  # of a pixel: the height is in whole rem


def test_continue__clicked_twice__skips_no_stage(browser, running, tmp_path):
    file = tmp_path / "axis.csv"
    file.write_text(recording_csv(), encoding="utf-8")
    name = project(running, "Twice")
    with visiting(browser, running) as visit:
        visit.page.goto(f"{running.base}/project/{name}/recording")
        visit.upload(file)
        visit.wait('[data-key="continue"]:not([disabled])')
        visit.page.evaluate("for (const _ of [1, 2]) document.querySelector('[data-key=continue]').click()")
        visit.wait(".grade")
        assert visit.page.url.endswith("/check")
