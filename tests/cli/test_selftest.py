"""The command ``selftest``."""

import json
import signal
import time

import pytest

from support.self_tests import small_result
from support.small_runs import call, start

KEPT = "selftest.partial.jsonl"
MOST = 60.0  # s until a test has failed


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return small_result(tmp_path_factory.mktemp("drive"))


@pytest.fixture
def run(result, tmp_path):
    result.write(tmp_path / "out")
    return tmp_path / "out"


def test_selftest__fast__prints_tables_and_sentences_and_writes_both_files(run):
    done = call("selftest", run, "--draws", 2, "--fast")
    assert (done.code, done.err) == (0, "")
    for word in ("the found model", "a constant load", "2 of 2 (34 to 100 %)", "Coulomb friction", "J1"):
        assert word in done.out
    assert "Every verdict was the same in all 2 draws." in done.out
    assert max(map(len, done.out.splitlines()[:-1])) <= 120
    assert json.loads((run / "selftest.json").read_text(encoding="utf-8"))["draws"] == 2
    assert '<section id="selftest">' in (run / "report.html").read_text(encoding="utf-8")
    assert not (run / KEPT).exists()


def test_selftest__found_only__no_line_on_other_drives(run):
    done = call("selftest", run, "--draws", 1, "--fast", "--found-only")
    assert (done.code, done.err) == (0, "")
    assert "the found model" in done.out
    assert "with a constant load" not in done.out


def test_selftest__json__is_the_file(run):
    done = call("selftest", run, "--draws", 1, "--fast", "--json")
    assert json.loads(done.out) == json.loads((run / "selftest.json").read_text(encoding="utf-8"))


def test_selftest__no_run__one_line(tmp_path):
    done = call("selftest", tmp_path)
    assert done.code == 2
    assert done.err.count("\n") == 1
    assert "has no run.json" in done.err


@pytest.mark.system
def test_selftest__interrupted__keeps_the_draws_and_goes_on(run):
    process = start("selftest", run, "--draws", 400, "--fast", "--workers", 2)
    end = time.monotonic() + MOST
    while not (run / KEPT).exists() and time.monotonic() < end:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=MOST)
    assert process.returncode == 130
    assert err.startswith("brightgrey: stopped after ")
    assert "the same command goes on" in err
    assert err.count("\n") == 1
    assert not (run / "selftest.json").exists()
    kept = len((run / KEPT).read_text().splitlines())
    assert 0 < kept < 800
    assert call("selftest", run, "--draws", 1, "--fast", "--quiet").code == 0
