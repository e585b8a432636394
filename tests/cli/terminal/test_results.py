"""Results as the terminal prints them."""

from pathlib import Path
from types import SimpleNamespace

from brightgrey import Model, Result
from brightgrey.cli.terminal import results
from support.models import model_with_intervals


def test_result_text__interval_drowns_the_estimate__not_identifiable():
    """As on the EMPS axis: 32 N with a half width of 9100 N is no zero."""
    model = model_with_intervals("one_mass+coulomb+viscous")
    data = model.model_dump(mode="json")
    data["parameters"]["M_C"] |= {"value": 32.4, "std": 4600.0, "ci95": [-9067.6, 9132.4]}
    wide = Model.check(data)
    fit = SimpleNamespace(correlation={}, symptoms=())
    printed = results.text(Result(wide, (), (), (), fit), Path("out"))
    (row,) = [line for line in printed.splitlines() if line.startswith("M_C ")]
    assert row.split() == ["M_C", "32", "±", "9100", "N", "m", "not", "identifiable"]
    plain = results.text(Result(model, (), (), (), fit), Path("out"))
    assert "not identifiable" not in plain
