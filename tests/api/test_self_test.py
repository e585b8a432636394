"""Self-test of small identifications."""

import json
import shutil
from pathlib import Path

import pytest

from brightgrey import RecordingError, RunError, SelfTest, SettingsError, identify, load_model, selftest, write_selftest
from brightgrey.runs import Stop
from support.self_tests import SEARCH, read_small, small_result
from support.small_runs import recording_csv

KEPT = "selftest.partial.jsonl"


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return small_result(tmp_path_factory.mktemp("easy"))


@pytest.fixture(scope="module")
def run(result, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    result.write(folder)
    return folder


@pytest.fixture(scope="module")
def tested(result):
    return selftest(result, draws=6, fast=True)


@pytest.fixture(scope="module")
def brief(result):
    """Two draws, where the same is compared with the same."""
    return selftest(result, draws=2, fast=True)


def test_selftest__easy_drive__comes_out_again_and_notices_what_is_not_needed(tested):
    assert tested.structure == "one_mass+coulomb+viscous"
    assert tested.found.found_again.hits == 6
    assert {e: c.hits for e, c in tested.stable.items()} == dict.fromkeys(("coulomb", "viscous", "gravity"), 6)
    (drive,) = (d for d in tested.drives if d.kind == "with effect")
    assert (drive.effect, drive.noticed.hits, drive.found_again.hits) == ("gravity", 6, 6)
    assert "Every verdict was the same in all 6 draws." in tested.sentences


def test_selftest__easy_drive__intervals_hold_the_simulated_values(tested):
    counts = [part.covered for part in tested.found.parameters.values()]
    hits, of = sum(c.hits for c in counts), sum(c.of for c in counts)
    assert of == 18
    assert hits >= 13  # of 18 at 95 %; independent ones have fewer with a probability of 1e-4
    for part in tested.found.parameters.values():
        assert abs(part.mean_error) < 5.0 / 6.0**0.5  # mean of six errors in standard deviations


def test_selftest__optimum_of_the_search_differs_from_the_model__simulates_the_model(run, brief, tmp_path):
    # as that of a long recording does, of which a search takes every k-th sample with an initial state of its own
    folder = shutil.copytree(run, tmp_path / "run")
    record = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    record["fits"][0]["values"] |= {"J1": 1.5 * record["fits"][0]["values"]["J1"], "speed(0)": 0.3}
    (folder / "run.json").write_text(json.dumps(record), encoding="utf-8")
    assert selftest(folder, draws=2, fast=True).text() == brief.text()


def test_selftest__whole_identifications__say_the_same_of_an_easy_drive(result, tested):
    whole = selftest(result, draws=2)
    assert not whole.fast
    assert whole.found.found_again.hits == 2
    assert {e: c.hits for e, c in whole.stable.items()} == dict.fromkeys(tested.stable, 2)
    assert not any("fast" in sentence for sentence in whole.sentences)


@pytest.mark.long
def test_selftest__effect_at_the_edge_of_significance__verdict_is_fragile(tmp_path):
    # Gravity of three standard deviations: the test at 2 % finds it in P(z > 2.33 - 3) = 75 % of the draws.
    values = {"J1": 0.02, "M_C": 1.0, "f_v": 0.02, "M_G": 0.0055}
    path = tmp_path / "edge.csv"
    path.write_text(recording_csv(values, structure="one_mass+coulomb+viscous+gravity"))
    edge = identify(read_small(path), **SEARCH)
    assert "gravity" in edge.model.effects
    tested = selftest(edge, draws=12, fast=True)
    assert 3 <= tested.stable["gravity"].hits < 12
    assert tested.stable["viscous"].hits == 12
    assert any("noise changed" in sentence and "constant load" in sentence for sentence in tested.sentences)


def test_selftest__number_of_workers__same_bytes(result, brief):
    assert selftest(result, draws=2, fast=True, workers=3).text() == brief.text()


def test_selftest__found_only__first_drive_with_the_same_draws(result, brief):
    tested = selftest(result, draws=2, fast=True, found_only=True)
    assert len(brief.drives) > 1
    assert tested.drives == brief.drives[:1]
    assert tested.stable == brief.stable
    assert any(sentence.startswith("Only the found model was simulated") for sentence in tested.sentences)
    assert (tested.found_only, brief.found_only) == (True, False)


def test_selftest__other_seed__other_noise(result, brief):
    other = selftest(result, draws=2, fast=True, seed=1)
    assert other.found.parameters["J1"].mean_error != brief.found.parameters["J1"].mean_error


def test_selftest__folder__same_as_the_result_in_memory(run, brief):
    assert selftest(run, draws=2, fast=True).text() == brief.text()


def test_write_selftest__report__has_one_section_however_often(run, tested):
    for _ in range(2):
        write_selftest(tested, run)
    page = (run / "report.html").read_text(encoding="utf-8")
    assert page.count('<section id="selftest">') == 1
    assert tested.sentences[0] in page
    assert SelfTest.model_validate(json.loads((run / "selftest.json").read_text(encoding="utf-8"))) == tested


def test_selftest__given_structure__tests_the_parameters_alone(result):
    given = identify(result.recordings, "one_mass+coulomb+viscous")
    tested = selftest(given, draws=3)
    assert tested.verdicts == {}
    assert [d.kind for d in tested.drives] == ["found"]
    assert tested.found.parameters["J1"].covered.of == 3


def test_selftest__fixed_parameter__stays_fixed(result):
    held = identify(result.recordings, fixed={"J1": 0.02}, **SEARCH)
    tested = selftest(held, draws=2, fast=True)
    assert "J1" not in tested.found.parameters
    assert "M_C" in tested.found.parameters


def test_selftest__stopped__keeps_what_is_done_and_goes_on(result, brief, tmp_path):
    result.write(tmp_path)
    stop, seen = Stop(), []

    def progress(done, total):
        seen.append(done)
        if done == 3:
            stop.request()

    with pytest.raises(RunError, match=r"stopped after 3 of 4 draws; they are kept in"):
        selftest(tmp_path, draws=2, fast=True, progress=progress, stop=stop)
    assert len((tmp_path / KEPT).read_text().splitlines()) == 3
    with (tmp_path / KEPT).open("a") as file:
        file.write('{"key": "half a li')  # the process was killed while it wrote
    again = []
    found = selftest(tmp_path, draws=2, fast=True, progress=lambda done, total: again.append(done))
    assert again[0] == 3
    assert found.text() == brief.text()
    write_selftest(found, tmp_path)
    assert not (tmp_path / KEPT).exists()


def test_write_selftest__test_of_the_found_model_only__leaves_its_draws_for_one_of_all_drives(result, tmp_path):
    result.write(tmp_path)
    write_selftest(selftest(tmp_path, draws=1, fast=True, found_only=True), tmp_path)
    again = []
    write_selftest(selftest(tmp_path, draws=1, fast=True, progress=lambda done, total: again.append(done)), tmp_path)
    assert again[0] == 1
    assert not (tmp_path / KEPT).exists()


def test_selftest__draws_of_another_seed_are_kept__are_not_taken(result, tmp_path):
    result.write(tmp_path)
    first = selftest(tmp_path, draws=2, fast=True, seed=3)
    assert (tmp_path / KEPT).exists()
    again = []
    other = selftest(tmp_path, draws=2, fast=True, seed=4, progress=lambda done, total: again.append(done))
    assert again[0] == 0
    assert other.text() != first.text()


def test_selftest__recording_is_gone__says_which_and_where(result, run, tmp_path):
    moved = {name: content for name, content in result.contents().items() if name != "report.html"}
    moved["run.json"] = moved["run.json"].replace(b"drive.csv", b"gone.csv")
    for name, content in moved.items():
        (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=r"gone\.csv' of the run .* is not there; put it back, or copy it into"):
        selftest(tmp_path)
    assert selftest(tmp_path, draws=1, fast=True, recordings=result.recordings).draws == 1


def test_selftest__recording_beside_the_results__is_found(result, tmp_path):
    for name, content in result.contents().items():
        (tmp_path / name).write_bytes(
            content.replace(b"drive.csv", b"nowhere/drive.csv") if name == "run.json" else content
        )
    (tmp_path / "drive.csv").write_bytes(_recording_of(result))
    assert selftest(tmp_path, draws=1, fast=True).draws == 1


def _recording_of(result):
    return Path(result.recordings[0].source.path).read_bytes()


def test_selftest__other_recording_of_that_name__is_refused(result, tmp_path):
    for name, content in result.contents().items():
        (tmp_path / name).write_bytes(
            content.replace(b"drive.csv", b"nowhere/drive.csv") if name == "run.json" else content
        )
    (tmp_path / "drive.csv").write_bytes(_recording_of(result) + b"\n")
    with pytest.raises(RecordingError, match="is not the one that was identified"):
        selftest(tmp_path, draws=1)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("run.json", None, r"has no run\.json; name a folder that this version"),
        ("run.json", b"{", r"run\.json' is not JSON"),
        ("run.json", b'{"schema": "brightgrey/run-record/1"}', r"field 'recordings': field required"),
        ("model.json", None, r"no model file"),
    ],
)
def test_selftest__damaged_folder__one_line(result, tmp_path, name, content, message):
    for file, data in result.contents().items():
        (tmp_path / file).write_bytes(data)
    (tmp_path / name).unlink() if content is None else (tmp_path / name).write_bytes(content)
    with pytest.raises(SettingsError, match=message):
        selftest(tmp_path)


def test_selftest__model_of_another_run__is_refused(result, run, tmp_path):
    other = identify(result.recordings, **{**SEARCH, "exclude": (*SEARCH["exclude"], "coulomb")})
    for file, data in (result.contents() | {"model.json": other.model.text().encode()}).items():
        (tmp_path / file).write_bytes(data)
    with pytest.raises(SettingsError, match="are of different runs; identify again"):
        selftest(tmp_path)


def test_selftest__no_folder_or_no_draws__is_refused(result, tmp_path):
    with pytest.raises(SettingsError, match="there is no folder"):
        selftest(tmp_path / "none")
    with pytest.raises(SettingsError, match="draws is 0; expected: a whole number from 1"):
        selftest(result, draws=0)


def test_selftest__other_recordings__are_refused(result, run):
    with pytest.raises(RecordingError, match="2 recordings came; the run has 1"):
        selftest(run, recordings=[*result.recordings, *result.recordings])


def test_identify__run_json__holds_request_files_and_optima(result, run):
    record = json.loads((run / "run.json").read_text(encoding="utf-8"))
    assert record["schema"] == "brightgrey/run-record/1"
    assert (record["search"], record["grammar"]) == ("auto", "paper")
    assert record["exclude"] == list(SEARCH["exclude"])
    (recording,) = record["recordings"]
    assert recording["sha256"] == result.recordings[0].source.sha256
    first = record["fits"][0]
    assert (first["structure"], first["status"]) == (str(load_model(run / "model.json").structure), "minimal")
    assert first["values"].keys() >= {"J1", "M_C", "f_v"}
