"""Two searches of a few structures of one mass, and what they come to when nobody interrupts them."""

from types import SimpleNamespace

import pytest

from brightgrey.excitation import PAPER_EXPERIMENT as E
from support.small_runs import call, recording_csv, results


@pytest.fixture(scope="session")
def small(tmp_path_factory):
    """Recording, options of two searches on it, and what they come to when nobody interrupts them."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "a.csv").write_text(recording_csv())
    columns = (folder / "a.csv", "--input", "torque", "--output", "velocity", "--f-tanh", f"{E.f_tanh!r}")
    without = [o for e in ("two_mass", "current_control") for o in ("--exclude", e)]
    genetic = ("--search", "genetic", "--preset", "tuned", "--population", 6, "--elite", 1, "--generations", 3)
    searches = {
        "exhaustive": ("identify", *columns, *without),
        "genetic": ("identify", *columns, *genetic, "--iterations", 10),
    }
    whole = {}
    for name, arguments in searches.items():
        done = call(*arguments, "--workers", 2, "--out", folder / name)
        assert done.code == 0, done.err
        whole[name] = results(folder / name)
    return SimpleNamespace(folder=folder, searches=searches, whole=whole, columns=columns)
