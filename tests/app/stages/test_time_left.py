"""Time that is left is an estimate while something is left to decide, and a bound where the budget ends a search."""

import pytest

from brightgrey.app.stages.time_left import rounded_time, time_left


def stage(**more):
    return {"name": "border", "done": 20, "most": 400, "decided": 4, "left": 2, **more}


def test_time_left__parts_are_left__estimates_and_bounds():
    said = time_left(stage(), 40.0, 1)
    assert (
        said == "Time left: about 20 s for the 2 parts that are left; at most 13 min, when 400 structures are fitted."
    )
    assert "about 10 s" in time_left(stage(), 40.0, 2)


def test_time_left__budget_is_nearer_than_the_estimate__is_said_alone():
    assert time_left(stage(most=24, left=8), 40.0, 1) == "Time left: at most 10 s, when 24 structures are fitted."


def test_time_left__nothing_is_left__no_estimate_is_made():
    assert "nothing is left to decide" in time_left(stage(left=0), 40.0, 1)
    assert "the budget is spent" in time_left(stage(left=0, done=401), 40.0, 1)


def test_time_left__before_there_is_a_border__says_when_it_is_known():
    assert time_left({}, 0.0, 1) == ""
    assert "once the largest structures are fitted" in time_left({"name": "fits", "done": 3}, 5.0, 1)


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.3, "5 s"), (61.0, "60 s"), (130.0, "2 min"), (5300.0, "88 min"), (8000.0, "2.2 h")]
)
def test_rounded_time__has_no_more_digits_than_an_estimate(seconds, text):
    assert rounded_time(seconds) == text
