"""A damaged store is named, and never read as a result."""

import random
import shutil
import sqlite3
import subprocess
import sys

import pytest

from brightgrey.errors import BrightgreyError
from brightgrey.runs import RunError, Store, read_status
from brightgrey.runs.serialisation import text_of, value_of
from brightgrey.runs.store import FILE
from support.small_runs import call

pytestmark = pytest.mark.xdist_group("small searches")  # made once

REQUEST = {"recording": "a", "seed": 0}
PAGE = 4096


def keys(folder):
    database = sqlite3.connect(folder / FILE)
    found = [row[0] for row in database.execute("SELECT key FROM evaluations")]
    database.close()
    return found


@pytest.fixture
def kept(tmp_path):
    """A store with some evaluations, closed; gives its folder and what it holds."""
    folder = tmp_path / "run"
    with Store.open(folder, REQUEST) as store:
        for number in range(60):
            store.save_evaluation(f"{number:064x}", number, "f", "one_mass", 0.1, text_of((0.1 * number, "x" * 200)))
        content = {key: store.result(key) for key in (f"{n:064x}" for n in range(60))}
    return folder, content


def read(folder):
    with Store.open(folder, REQUEST) as store:
        return {f"{n:064x}": store.result(f"{n:064x}") for n in range(60)}


def test_serialisation__floats__exact():
    draw = random.Random(0)
    for _ in range(1000):
        value = draw.uniform(-1, 1) * 10.0 ** draw.randint(-300, 300)
        assert value_of(text_of((value, float("inf"), -0.0))) == (value, float("inf"), -0.0)
        assert text_of(value_of(text_of(value))) == text_of(value)


def test_store__undamaged__read(kept):
    folder, content = kept
    assert read(folder) == content


def test_store__flipped_byte_in_row__row_named(kept):
    folder, _ = kept
    data = bytearray((folder / FILE).read_bytes())
    at = data.index(b"xxxx")
    data[at + 2] ^= 1
    (folder / FILE).write_bytes(data)
    with pytest.raises(RunError, match=r"run.sqlite' is damaged: row '0+.*' of table 'evaluations' does not match"):
        read(folder)


@pytest.mark.parametrize("size", [0, 50, 100, PAGE - 1, PAGE, 3 * PAGE + 17, -PAGE, -1])
def test_store__truncated_file__named(kept, size):
    folder, _ = kept
    data = (folder / FILE).read_bytes()
    (folder / FILE).write_bytes(data[:size])
    with pytest.raises(RunError, match=r"run.sqlite' is damaged: "):
        read(folder)


@pytest.mark.parametrize("filler", [b"\x00", b"\xa5"])
def test_store__torn_page__named(kept, filler):
    folder, content = kept
    data = (folder / FILE).read_bytes()
    assert len(data) > 5 * PAGE
    for page in range(len(data) // PAGE):
        torn = data[: page * PAGE + PAGE // 2] + PAGE // 2 * filler + data[(page + 1) * PAGE :]
        (folder / FILE).write_bytes(torn)
        try:
            found = read(folder)
        except RunError:
            continue
        assert found == content  # half a page that holds nothing


def test_store__flipped_bytes_anywhere__no_wrong_result(kept):
    folder, content = kept
    data = (folder / FILE).read_bytes()
    draw = random.Random(3)
    refused = 0
    for _ in range(300):
        flipped = bytearray(data)
        flipped[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
        for extra in folder.glob(f"{FILE}-*"):
            extra.unlink()
        (folder / FILE).write_bytes(flipped)
        try:
            found = read(folder)
        except BrightgreyError:
            refused += 1
        else:
            # What is not found is computed again; what is found is what was kept.
            assert all(value in (None, content[key]) for key, value in found.items())
    assert refused > 100


def test_program__damaged_run__one_line_error(small, tmp_path):
    folder = shutil.copytree(small.folder / "exhaustive", tmp_path / "copy")
    before = (folder / "model.json").read_bytes()
    data = bytearray((folder / FILE).read_bytes())
    data[data.index(b'"StructureFit"') + 2] ^= 2
    (folder / FILE).write_bytes(data)
    for done in (call(*small.searches["exhaustive"], "--out", folder), call("runs", folder)):
        assert done.code == 2
        assert "is damaged: row" in done.err + done.out
    assert (folder / "model.json").read_bytes() == before
    done = call(*small.searches["exhaustive"], "--restart", "--out", folder, "--quiet")
    assert done.code == 0, done.err
    assert (folder / "model.json").read_bytes() == before


def test_store__process_killed__lock_released(tmp_path):
    code = f"""
import os, signal
from brightgrey.runs import Store
store = Store.open({str(tmp_path)!r}, {REQUEST!r})
store.save_evaluation("k", 1, "f", "", 0.0, "1.0")
os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -9
    with Store.open(tmp_path, REQUEST) as store:
        assert store.result("k") == "1.0"
        with pytest.raises(RunError, match="another process"):
            Store.open(tmp_path, REQUEST)


@pytest.fixture
def killed(tmp_path):
    """Folder as a killed process leaves it: the log is there, and not the index, which a mere reader cannot make."""
    left = tmp_path / "killed"
    left.mkdir()
    with Store.open(tmp_path / "run", REQUEST) as store:
        store.save_evaluation("0" * 64, 0, "f", "one_mass", 0.1, text_of(1.0))
        for name in (FILE, f"{FILE}-wal"):
            shutil.copy(tmp_path / "run" / name, left / name)
    return left


def test_read_status__file_that_a_killed_process_left_in_the_middle__is_recovered(killed):
    assert read_status(killed).evaluations == 1


@pytest.fixture
def half_written(kept, tmp_path):
    """Folder of a file beside the journal of a transaction that was written half; SQLite would roll it back."""
    folder, _ = kept
    database = sqlite3.connect(folder / FILE, isolation_level=None)
    database.execute("PRAGMA cache_size = 1")  # so that changes reach the file before the end
    database.execute("BEGIN IMMEDIATE")
    database.execute("DELETE FROM evaluations")
    left = tmp_path / "half written"
    left.mkdir()
    for name in (FILE, f"{FILE}-journal"):
        shutil.copy(folder / name, left / name)
    database.execute("ROLLBACK")
    database.close()
    return left


def test_read_status__hot_journal__is_rolled_back(half_written):
    """A transaction was written half: what was there before counts."""
    assert read_status(half_written).evaluations == 60


def test_store__other_request__refused(kept):
    folder, content = kept
    with pytest.raises(RunError, match="seed was 0 and is 1"):
        Store.open(folder, {**REQUEST, "seed": 1})
    assert read(folder) == content


@pytest.mark.parametrize(
    ("before", "now", "difference"),
    [
        (
            {"versions": {"numpy": "1", "scipy": "2"}},
            {"versions": {"numpy": "3", "scipy": "2"}},
            "version of numpy was 1 and is 3",
        ),
        ({"exclude": []}, {"exclude": ["delay"]}, 'exclude was not given and is ["delay"]'),
        ({"bounds": {"J1": [1, 2]}}, {"bounds": {}}, 'bounds was {"J1": [1, 2]} and is not given'),
        ({"level": 0}, {"level": None}, "level was 0 and is not given"),
        (
            {"recording 1": "a.csv (12)"},
            {"recording 1": "a.csv (34)"},
            "recording 1 has other samples, units or columns",
        ),
        (
            {"test recording": "a.csv (12)"},
            {"test recording": "a.csv (34)"},
            "test recording has other samples, units or columns",
        ),
        ({"recording 1": "a.csv (12)"}, {"recording 1": "b.csv (34)"}, "recording 1 was a.csv (12) and is b.csv (34)"),
        ({}, {"recording 2": "b.csv (34)"}, "recording 2 was not given and is b.csv (34)"),
    ],
)
def test_store__other_request__only_what_differs_is_named(tmp_path, before, now, difference):
    Store.open(tmp_path, {**REQUEST, **before}).close()
    with pytest.raises(RunError) as refused:
        Store.open(tmp_path, {**REQUEST, **now})
    assert f"a run of another request: {difference}. Use another folder" in str(refused.value)


def test_store__different_generation__refused(tmp_path):
    with Store.open(tmp_path, REQUEST) as store:
        store.save_generation(0, {"random": 1})
        store.save_generation(0, {"random": 1})
        with pytest.raises(RunError, match="generation 0"):
            store.save_generation(0, {"random": 2})


def test_store__restart_beside_a_journal__does_not_bring_the_old_run_back(half_written):
    with Store.open(half_written, {**REQUEST, "seed": 1}, restart=True) as store:
        assert store.result("0" * 64) is None


@pytest.mark.parametrize("evaluated", [False, True])
def test_store__finished_while_another_program_reads__is_finished(tmp_path, evaluated):
    folder = tmp_path / "run"
    with Store.open(folder, REQUEST) as store:
        if evaluated:
            store.save_evaluation("0" * 64, 0, "f", "one_mass", 0.1, text_of(1.0))
        reader = sqlite3.connect(folder / FILE)
        reading = reader.execute("SELECT * FROM facts")
        reading.fetchone()
        store.finish({"a": b"x" * 100_000})
        reader.close()
        assert store.finished
        assert store.files() == {"a": b"x" * 100_000}
    assert read_status(folder).state == "finished"


def test_store__closed_after_a_kill__needs_no_log_to_be_read(killed):
    with Store.open(killed, REQUEST) as store:
        assert store.result("0" * 64) == text_of(1.0)
    assert (killed / FILE).read_bytes()[18:20] == b"\x01\x01"  # versions of a file without a log


def test_store__another_program_writes__is_named_and_no_damage(tmp_path):
    with Store.open(tmp_path, REQUEST) as store:
        other = sqlite3.connect(tmp_path / FILE, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(RunError, match="another program holds it"):
            store.save_evaluation("0" * 64, 0, "f", "one_mass", 0.1, text_of(1.0))
        other.close()
        store.save_evaluation("0" * 64, 0, "f", "one_mass", 0.1, text_of(1.0))
        assert store.result("0" * 64) == text_of(1.0)


def test_store__finished_without_evaluations__keeps_generations(tmp_path):
    with Store.open(tmp_path, REQUEST) as store:
        store.save_generation(0, {"random": 1})
        store.finish({"a": b"x"})
        with pytest.raises(RunError, match="generation 0"):
            store.save_generation(0, {"random": 2})
