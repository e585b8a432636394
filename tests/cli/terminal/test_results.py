"""Results as the terminal prints them."""

from pathlib import Path
from types import SimpleNamespace

from brightgrey import Model, Result
from brightgrey.api.resumable import StoredRun
from brightgrey.cli.terminal import results
from support.models import model_with_intervals


def test_result_text__interval_drowns_the_estimate__not_identifiable():
    """As on the EMPS axis: 32 N with a half width of 9100 N is no zero."""
    model = model_with_intervals("one_mass+coulomb+viscous")
    data = model.model_dump(mode="json")
    data["parameters"]["M_C"] |= {"value": 32.4, "std": 4600.0, "ci95": [-9067.6, 9132.4]}
    wide = Model.check(data)
    fit = SimpleNamespace(correlation={}, symptoms=(), second_opinion=())
    printed = results.text(Result(wide, (), (), (), fit), Path("out"))
    (row,) = [line for line in printed.splitlines() if line.startswith("M_C ")]
    assert row.split()[:8] == ["M_C", "32", "±", "9100", "N", "m", "not", "identifiable"]
    plain = results.text(Result(model, (), (), (), fit), Path("out"))
    assert "not identifiable" not in plain


def test_result_text__long_note__folded_without_trailing_spaces():
    note = " ".join(["the file /measured/on-the-axis/run-1.csv has 3 rows too many"] * 4)
    fit = SimpleNamespace(correlation={}, symptoms=(), second_opinion=())
    model = model_with_intervals("one_mass+coulomb+viscous")
    lines = results.text(Result(model, (), (), (note,), fit), Path("out")).splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("- The file"))
    folded = lines[first : next(k for k in range(first + 1, len(lines)) if not lines[k].startswith("  "))]
    assert len(folded) > 1
    assert all(line == line.rstrip() for line in folded)
    assert max(map(len, folded)) <= results.PIPED_WIDTH
    assert " ".join(line[2:] for line in folded) == f"T{note[1:]}."


def test_stored__finished_run__brief_and_only_on_request_the_details(capsys):
    found = StoredRun({}, results.PART.join(("brief\n", "details\n", "files\n")), None)
    results.stored(found, Path("out"), quiet=False, json=False, verbose=False)
    assert capsys.readouterr().out.splitlines()[1:] == ["brief", "files"]
    results.stored(found, Path("out"), quiet=False, json=False, verbose=True)
    assert capsys.readouterr().out.splitlines()[1:] == ["brief", "details", "files"]


def test_stored__run_was_made_from_python__has_no_text(capsys):
    results.stored(StoredRun({}, "", None), Path("out"), quiet=False, json=False, verbose=False)
    assert capsys.readouterr().out.splitlines() == ["The run in out was finished before; its result:"]
