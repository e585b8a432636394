"""Two searches of a few structures of one mass, and what they come to when nobody interrupts them."""

from types import SimpleNamespace

import pytest

from brightgrey.excitation import PAPER_EXPERIMENT as E
from support.small_runs import call, recording_csv, results


@pytest.fixture(scope="session")
def small(tmp_path_factory):
    """Recordings, options of two searches on them, and what they come to when nobody interrupts them."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "a.csv").write_text(recording_csv())
    # Without dry friction nearly every structure explains the recording, and no restarts look for more.
    (folder / "b.csv").write_text(recording_csv({"J1": 0.02, "f_v": 0.02}, structure="one_mass+viscous"))
    columns = (folder / "a.csv", "--input", "torque", "--output", "velocity", "--f-tanh", f"{E.f_tanh!r}")
    without = [o for e in ("two_mass", "current_control") for o in ("--exclude", e)]
    genetic = ("--search", "genetic", "--preset", "tuned", "--population", 6, "--elite", 1, "--generations", 3)
    searches = {
        "exhaustive": ("identify", *columns, *without),
        "genetic": ("identify", folder / "b.csv", *columns[1:], *genetic, "--iterations", 10),
    }
    whole = {}
    for name, arguments in searches.items():
        done = call(*arguments, "--workers", 2, "--out", folder / name)
        assert done.code == 0, done.err
        whole[name] = results(folder / name)
    return SimpleNamespace(folder=folder, searches=searches, whole=whole, columns=columns)
