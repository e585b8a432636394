"""Time that is left is an estimate where something is left to decide, and called unknown where nothing is."""

import pytest

from brightgrey.app.stages.time_left import rounded_time, time_left


def stage(**more):
    return {"name": "border", "done": 20, "most": 400, "decided": 4, "left": 2, **more}


def test_time_left__parts_are_left__is_between_one_structure_for_each_and_the_budget():
    said = time_left(stage(), 200.0, 1)
    assert said.startswith("Time left: at least 20 s, for the 2 parts that are left. ")
    assert said.endswith("the budget of 400 structures is spent in 63 min; then only simpler ones are tried.")
    assert "at least 10 s" in time_left(stage(), 200.0, 2)
    assert "the 1 part that is left" in time_left(stage(left=1), 200.0, 1)


def test_time_left__nothing_is_left__is_unknown():
    assert time_left(stage(left=0), 40.0, 1).startswith("Time left: unknown. Nothing is left to decide at the moment")
    assert "The budget of 80 structures is spent" in time_left(stage(left=0, done=82, most=80), 40.0, 1)


def test_time_left__before_there_is_a_border__says_when_it_is_known():
    assert time_left({}, 0.0, 1) == ""
    assert "once the largest structures are fitted" in time_left({}, 5.0, 1)


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.3, "5 s"), (61.0, "60 s"), (130.0, "2 min"), (5300.0, "88 min"), (8000.0, "2.2 h")]
)
def test_rounded_time__has_no_more_digits_than_an_estimate(seconds, text):
    assert rounded_time(seconds) == text
