"""The effect of docs/how-to/add-effect.md, put as one file into a copy of the package, appears everywhere."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

ROOT = Path(__file__).parents[2]
TRUTH = {"J1": 0.02, "M_C": 0.3, "k_D": 0.004}
F_TANH, NOISE, DT = 4.0, 0.02, 0.004

pytestmark = pytest.mark.xdist_group("extended package")  # one copy, compiled once


def recorded():
    """J v' = u - tanh(f_tanh v) (M_C + k_D v^2), solved by scipy, with white noise; CSV with units."""
    t = DT * np.arange(500)
    edges = np.arange(0.0, 2.1, 0.25)
    u = 2.5 * np.interp(t, np.repeat(edges, 2)[1:-1], np.repeat([1, -1, 0.6, -1, 1, -0.5, 0.8, -1], 2)) * (t > 0.02)

    def rate(at, v):
        friction = np.tanh(F_TANH * v) * (TRUTH["M_C"] + TRUTH["k_D"] * v * v)
        return (np.interp(at, t, u) - friction) / TRUTH["J1"]

    v = solve_ivp(rate, (0.0, t[-1]), [0.0], t_eval=t, max_step=DT / 2, rtol=1e-8, atol=1e-8).y[0]
    v = v + NOISE * np.random.default_rng(0).normal(size=t.size)
    rows = [f"{a:.3f},{b:.6f},{c:.6f}\n" for a, b, c in zip(t, u, v, strict=True)]
    return "t [s],torque [N m],speed [rad/s]\n" + "".join(rows)


@pytest.fixture(scope="module", autouse=True)
def recording(extended):
    """The recording a.csv beside the extended copy of the package."""
    (extended.folder / "a.csv").write_text(recorded(), encoding="utf-8")


OPTIONS = ("--input", "torque", "--output", "speed", "--f-tanh", F_TANH, "--workers", 2)


def test_new_effect__is_listed_by_command_line_and_pages(extended):
    listed = json.loads(extended("-m", "brightgrey", "effects", "--json"))
    (own,) = [effect for effect in listed if effect["name"] == "drag"]
    assert own["parameters"][0] | {"dimension": 0} == {
        "name": "k_D",
        "unit": "N m s²/rad²",
        "dimension": 0,
        "about": "drag coefficient",
    }
    page = extended("-c", "from brightgrey.report.effect_catalogue import catalogue; print(catalogue())")
    assert "## 16 · Drag" in page
    assert "| `k_D` | N m s²/rad² | N s²/m² | drag coefficient (positive) |" in page
    assert "file" not in page


def test_new_effect__is_identified_and_shown_in_the_report(extended):
    extended("-m", "brightgrey", "identify", "a.csv", *OPTIONS, "--structure", "one_mass+coulomb+drag", "--out", "out")
    model = json.loads((extended.folder / "out" / "model.json").read_text(encoding="utf-8"))
    assert model["parameters"]["k_D"]["unit"] == "N m s²/rad²"
    for name, truth in TRUTH.items():
        part = model["parameters"][name]
        # Normal errors stay within five standard deviations in all but 6e-7 of the seeds.
        assert abs(part["value"] - truth) < 5 * part["std"]
    html = (extended.folder / "out" / "report.html").read_text(encoding="utf-8")
    assert "M_F = -k_D v^2 tanh(f_tanh v)" in html
    assert "Sum of Coulomb friction and drag" in html


def test_new_effect__search__includes_it_and_calls_it_needed(extended):
    others = ("two_mass", "stribeck", "gravity", "current_control", "delay")
    excluded = [word for name in others for word in ("--exclude", name)]
    extended("-m", "brightgrey", "identify", "a.csv", *OPTIONS, *excluded, "--out", "found")
    model = json.loads((extended.folder / "found" / "model.json").read_text(encoding="utf-8"))
    assert model["evidence"]["drag"] == "needed"
    assert "drag" in model["structure"]
    assert model["certificate"]["structures"] == 2**3
    assert ["drag"] in [found["without"] for found in model["certificate"]["refuted"]]
    html = (extended.folder / "found" / "report.html").read_text(encoding="utf-8")
    assert 'data-effect="drag"' in html


def test_new_effect__registry_tests__include_it(extended):
    tests = ROOT / "tests" / "effects" / "test_registry.py"
    said = extended("-m", "pytest", tests, "-q", "-k", "drag", "-p", "no:cacheprovider", "--rootdir", extended.folder)
    assert int(re.search(r"(\d+) passed", said)[1]) >= 5


def test_new_effect__grammar_of_the_paper__is_unchanged(extended):
    count = "print(*(len(list(g.structures())) for g in (PAPER, Grammar('drive', grammar_named('drive').places))))"
    code = f"from brightgrey.kit import PAPER, Grammar, grammar_named; {count}"
    assert extended("-c", code).split() == ["448", "896"]
