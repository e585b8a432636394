"""One screen about a result."""

import io
from dataclasses import replace
from types import SimpleNamespace

import pytest
from rich.console import Console

from brightgrey import Result
from brightgrey.cli.terminal.overview import folded, print_overview
from support.models import model_with_intervals, trace_of

NOTES = tuple(f"note {k}: the file was cut since the drive stood still for a while" for k in range(40))


@pytest.mark.parametrize("width", [60, 80, 120])
def test_print_overview__many_notes__one_screen_and_the_rest_is_returned(width):
    model = model_with_intervals("two_mass+coulomb+viscous+stribeck")
    traces = tuple(replace(trace_of(model), name=f"a-long-name-of-a-recording_{k}.csv") for k in range(3))
    fit = SimpleNamespace(correlation={}, symptoms=(), second_opinion=())
    out = io.StringIO()
    left = print_overview(Console(file=out, width=width), Result(model, traces, (), NOTES, fit))
    lines = out.getvalue().splitlines()
    assert len(lines) < 40
    assert max(map(len, lines)) <= width
    shown = [line for line in lines if line.startswith("- Note")]
    assert len(shown) + len(left) == len(NOTES)
    assert lines[-1] == f"  and {len(left)} more in the report, or by --verbose"
    assert [sum(f"recording_{k}.csv" in line for line in lines) for k in range(3)] == [1, 1, 1]


def test_folded__mark__further_lines_are_indented_by_it():
    assert folded("one two three", 9, "- ") == "- one two\n  three"
