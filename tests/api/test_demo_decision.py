"""The demo: few fits decide all structures, and the files say on what that rests."""

import csv
import io
import json

import pytest

import brightgrey.api.demo
from brightgrey.excitation import PAPER_EXPERIMENT
from support.small_runs import call

TRUTH = PAPER_EXPERIMENT.structure
FILES = {"model.json", "ranking.csv", "report.html", "fit.svg", "run.json", "recording.csv", "undecided.json"}
demo = brightgrey.api.demo.demo


@pytest.fixture(scope="module")
def command(tmp_path_factory):
    """Folder of the results of ``brightgrey demo`` on two threads, and what :func:`brightgrey.demo` gave it."""
    folder, results = tmp_path_factory.mktemp("demo") / "demo", []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(brightgrey.api.demo, "demo", lambda **options: results.append(demo(**options)) or results[0])
        done = call("demo", "--workers", 2, "--out", folder)
    assert done.code == 0, done.err
    return folder, *results


@pytest.fixture(scope="module")
def found(command):
    return command[1]


def test_demo__command__leaves_recording_and_finds_its_drive(command):
    folder, _ = command
    assert {p.name for p in folder.iterdir()} == FILES
    assert (folder / "recording.csv").read_text().startswith("t,torque,velocity\n")
    model = json.loads((folder / "model.json").read_text(encoding="utf-8"))
    assert "+".join(model["structure"]) == TRUTH
    for name, truth in PAPER_EXPERIMENT.values.items():
        part = model["parameters"][name]
        # Five standard deviations, doubled: the recording is rounded.
        assert abs(part["value"] - truth) < 10 * part["std"], name
    again = call("simulate", folder / "model.json", folder / "recording.csv", "--json")
    expected = {name: pytest.approx(fit, rel=1e-6) for name, fit in model["fit"]["train"].items()}
    assert json.loads(again.out) == expected


def test_demo__border__truth_alone_by_few_fits(found):
    certificate = found.evidence.certificate
    assert certificate.minimal == (TRUTH,)
    assert certificate.structures == 448
    assert certificate.fitted <= 60
    assert certificate.undecided == certificate.unexplained == ()
    lacking = {effect for refuted in certificate.refuted for effect in refuted.without}
    assert lacking == set(TRUTH.split("+"))
    assert all(r.excess > r.threshold and r.ratio > 1.0 for r in certificate.refuted)
    needed = {card.effect for card in found.evidence.cards if card.verdict == "needed"}
    assert needed == set(TRUTH.split("+"))


def test_demo__files__certificate_and_status(found):
    contents = found.contents()
    model = json.loads(contents["model.json"])
    assert model["schema"] == "brightgrey/model/2"
    assert model["certificate"]["minimal"] == [TRUTH] == ["+".join(model["structure"])]
    rows = list(csv.DictReader(io.StringIO(contents["ranking.csv"].decode())))
    assert (rows[0]["structure"], rows[0]["status"]) == (TRUTH, "minimal")
    for row in rows:
        wanted = set(TRUTH.split("+")[1:]) <= set(row["structure"].split("+")) and "one_mass" not in row["structure"]
        assert (row["status"] != "refuted") == wanted, row["structure"]


@pytest.mark.long
def test_demo__one_worker__same_bytes(found):
    assert demo(workers=1).contents() == found.contents()
