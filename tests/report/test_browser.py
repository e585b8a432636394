"""The report in a real browser: nothing is asked for from outside, nothing complains, figures can be zoomed.

Skipped where there is no Chromium; install the package ``chromium``.
"""

import json
import re
from dataclasses import replace

import pytest

import brightgrey
from brightgrey.model.ranking import Row
from brightgrey.model.schema import TiesPart
from brightgrey.report.content import Content
from brightgrey.report.page import page
from brightgrey.search.evidence import EffectVerdict
from brightgrey.search.verdicts import Reason
from support.evidence import evidence_of
from support.genetic_runs import small_run
from support.models import independent, model_with_intervals, trace_of

CARDS = (
    EffectVerdict("coulomb", "needed", 0.4, None, Reason("loss", {"ratio": 1.4})),
    EffectVerdict("delay", "not decidable", None, 0.0, Reason("not detectable")),
)


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """Report of a drive with everything."""
    model = model_with_intervals()
    model = model.model_copy(update={"ties": TiesPart(minimal=(str(model.structure),), optional=("delay",))})
    trace = trace_of(model)
    effects = ("one_mass", "coulomb", "viscous", "stribeck", "gravity")
    rows = [Row("+".join(effects[:k]), k, 1.0, 90.0 + k, 0.0) for k in range(1, 6)]
    content = Content(
        model,
        [trace, replace(trace, name="b.csv", test=True)],
        evidence=evidence_of(CARDS),
        ranking=rows,
        correlation=independent(model),
        run=small_run(),
    )
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(page(content), encoding="utf-8")
    return path


class Visit:
    """An open report with all it complained of and asked for."""

    def __init__(self, browser, report, width, scheme="light"):
        self.context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
        self.page = self.context.new_page()
        self.said, self.asked = [], []
        self.page.on("console", lambda message: self.said.append(message.text) if message.type != "log" else None)
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(report.as_uri())
        self.page.wait_for_function("document.querySelectorAll('.plot .main-svg').length > 0")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.context.close()

    def colour(self, name):
        return self.page.evaluate(f"getComputedStyle(document.querySelector('{name}')).backgroundColor")


SECTIONS = [
    *("next", "drawing", "motion", "values", "evidence", "certificate", "ties"),
    *("commissioning", "friction", "frequency", "backlash"),
    *("residuals", "structures", "history", "model", "recording", "repeat"),
]


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 400])
def test_report__opened_offline__is_complete(browser, report, width, scheme):
    with Visit(browser, report, width, scheme) as visit:
        assert visit.page.eval_on_selector_all("main > section", "all => all.map(s => s.id)") == SECTIONS
        drawn = visit.page.eval_on_selector_all(
            ".plot", "all => all.map(p => p.querySelectorAll('.trace, .point').length)"
        )
        assert len(drawn) == 9
        assert min(drawn) > 0
        assert visit.said == []
        assert [url for url in visit.asked if not url.startswith(("data:", "blob:"))] == [report.as_uri()]
        # Nothing sticks out: wide tables scroll inside themselves.
        assert visit.page.evaluate("document.documentElement.scrollWidth") <= width
        smallest = visit.page.evaluate(
            "Math.min(...[...document.querySelectorAll('td, p, li, figcaption')]"
            ".map(e => parseFloat(getComputedStyle(e).fontSize)))"
        )
        assert smallest >= 12
        dark = scheme == "dark"
        assert visit.colour("body") == ("rgb(23, 23, 26)" if dark else "rgb(255, 255, 255)")
        ink = visit.page.evaluate("getComputedStyle(document.querySelector('.plot .xtick text')).fill")
        assert ink == ("rgb(236, 236, 240)" if dark else "rgb(29, 29, 31)")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 400])
def test_report__checked_by_axe__has_no_violation_of_wcag_aa(browser, report, width, scheme):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")
    with Visit(browser, report, width, scheme) as visit:
        visit.page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true; })")
        rules = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"]
        found = axe.Axe().run(visit.page, options={"runOnly": rules, "resultTypes": ["violations"]})
        assert [(v["id"], [node["html"] for node in v["nodes"]]) for v in found.response["violations"]] == []


def test_drawing__in_the_page__has_the_sizes_that_it_was_laid_out_with(browser, report):
    with Visit(browser, report, 1280) as visit:
        sizes = visit.page.eval_on_selector_all(
            ".drive-wide svg text", "all => all.map(t => parseFloat(getComputedStyle(t).fontSize))"
        )
        assert sizes
        assert max(sizes) <= 12.0


def test_report__section_for_experts_opened__its_figures_fill_it(browser, report):
    with Visit(browser, report, 1280) as visit:
        width = "document.querySelector('#residuals .main-svg')?.getBoundingClientRect().width ?? 0"
        visit.page.click("#residuals summary")
        visit.page.wait_for_function(f"{width} > 1000")
        visit.page.click("#contents a[href='#history']")
        assert visit.page.evaluate("document.querySelector('#history details').open")


def test_figure__zoomed__residual_follows(browser, report):
    with Visit(browser, report, 1280) as visit:
        plot = visit.page.locator("#plot-comparison-0")
        plot.scroll_into_view_if_needed()
        box = plot.locator(".nsewdrag").first.bounding_box()
        axis = "document.getElementById('plot-comparison-0')._fullLayout"
        before = visit.page.evaluate(f"{axis}.xaxis.range")
        mouse = visit.page.mouse
        mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.2 * box["height"])
        mouse.down()
        mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.8 * box["height"], steps=8)
        mouse.up()
        visit.page.wait_for_function(f"{axis}.xaxis.range[1] < {before[1]} - 0.1")
        low, high = visit.page.evaluate(f"{axis}.xaxis.range")
        width = before[1] - before[0]
        assert low == pytest.approx(before[0] + 0.3 * width, abs=0.02 * width)
        assert high == pytest.approx(before[0] + 0.5 * width, abs=0.02 * width)
        assert visit.page.evaluate(f"{axis}.xaxis2.range") == [low, high]
        assert visit.said == []


def test_report__printed_from_a_dark_screen__is_white(browser, report):
    with Visit(browser, report, 1280, "dark") as visit:
        widest = (
            "Math.max(...[...document.querySelectorAll('.plot .main-svg')].map(s => s.getBoundingClientRect().width))"
        )
        assert visit.page.evaluate(widest) > 1000
        visit.page.emulate_media(media="print")
        visit.page.evaluate("dispatchEvent(new Event('beforeprint'))")
        assert visit.page.evaluate(widest) < 680  # a sheet's width
        assert visit.colour("body") == "rgb(255, 255, 255)"
        ink = visit.page.evaluate("getComputedStyle(document.querySelector('.plot .xtick text')).fill")
        assert ink == "rgb(0, 0, 0)"
        visit.page.emulate_media(media="screen")
        visit.page.evaluate("dispatchEvent(new Event('afterprint'))")
        assert visit.page.evaluate("document.documentElement.className") == ""
        assert visit.page.evaluate(widest) > 1000


@pytest.mark.long
def test_report__of_the_demo__prints_on_four_pages(browser, tmp_path):
    demo_result(None).write(tmp_path)
    with Visit(browser, tmp_path / "report.html", 1280) as visit:
        visit.page.emulate_media(media="print")
        visit.page.evaluate("dispatchEvent(new Event('beforeprint'))")
        printed = visit.page.pdf(format="A4", prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 4


def test_figures__window_resized__follow_its_width(browser, report):
    with Visit(browser, report, 1280) as visit:
        size = "(r => [r.width, r.height])(document.querySelector('.plot .main-svg').getBoundingClientRect())"
        wide, height = visit.page.evaluate(size)
        visit.page.set_viewport_size({"width": 600, "height": 900})
        visit.page.wait_for_function(f"{size}[0] < 600")
        assert visit.page.evaluate(size)[1] == height
        visit.page.set_viewport_size({"width": 1280, "height": 900})
        visit.page.wait_for_function(f"{size}[0] == {wide}")


def test_report__theme_changes__is_followed(browser, report):
    with Visit(browser, report, 1280) as visit:
        visit.page.emulate_media(color_scheme="dark")
        visit.page.wait_for_function(
            "getComputedStyle(document.querySelector('.plot .xtick text')).fill === 'rgb(236, 236, 240)'"
        )


def demo_result(_):
    return brightgrey.demo(workers=2)


def emps_result(measured):
    recording = brightgrey.read_recording(
        measured("emps/DATA_EMPS.mat"),
        input="vir",
        outputs=["qm:position"],
        time="t",
        input_gain=35.15065,
        units={"vir": "N", "qm": "m"},
    )
    return brightgrey.identify(recording, "one_mass+coulomb+viscous+gravity", starts=4)


def mte360_result(measured):
    recording = brightgrey.read_recording(
        measured("mte360/velocity_response_1_5.mat"),
        input="u",
        outputs=["v1:velocity-differenced"],
        time="t",
        units={"u": "V", "v1": "mm/s"},
    )
    return brightgrey.identify(recording, "two_mass+coulomb+viscous+gravity", starts=4)


@pytest.mark.long
@pytest.mark.parametrize("made", [demo_result, emps_result, mte360_result])
def test_report__of_measured_recordings__is_complete_offline(browser, measured, tmp_path, made):
    made(measured).write(tmp_path)
    path = tmp_path / "report.html"
    assert path.stat().st_size < 5e6
    for width, scheme in ((1280, "light"), (400, "dark")):
        with Visit(browser, path, width, scheme) as visit:
            assert visit.said == []
            assert [url for url in visit.asked if not url.startswith(("data:", "blob:"))] == [path.as_uri()]
            assert visit.page.evaluate("document.documentElement.scrollWidth") <= width
            sections = visit.page.eval_on_selector_all("main > section", "all => all.map(s => s.id)")
            assert {"motion", "values", "commissioning", "friction", "residuals"} <= set(sections)
            assert set(sections) <= set(SECTIONS)
            exact = visit.page.eval_on_selector_all("#parameters data", "all => all.map(d => parseFloat(d.value))")
            model = json.loads((tmp_path / "model.json").read_text(encoding="utf-8"))
            assert exact == [part["value"] for part in model["parameters"].values()]
