"""Stages are blocked, done or out of date by what was chosen, and by nothing else."""

import pytest

from brightgrey.app.workspace.progress import STAGES, current_run, next_stage, stage_states
from brightgrey.app.workspace.project import (
    AxisChoice,
    CheckDecision,
    ProjectDocument,
    RunEntry,
    SearchChoice,
    StoredRecording,
    digest_of_recordings,
    digest_of_search,
)

OPTIONS = {"input": "torque", "output": ["velocity:velocity"]}


def recording(number=1, **more):
    given = {"file": f"recording-{number}-0a.csv", "label": "axis.csv", "sha256": "0" * 64, "size": 10}
    return StoredRecording(**{**given, "options": OPTIONS, **more})


def document(**more):
    return ProjectDocument(name="axis", title="Axis", **more)


def checked(start, grade="passed", override=False):
    decision = CheckDecision(digest=digest_of_recordings(start), grade=grade, override=override)
    return start.model_copy(update={"check": decision})


def searched(start, **more):
    run = RunEntry(name="run-1", digest=digest_of_search(start), arguments=("identify",), **more)
    return start.model_copy(update={"runs": (run,)})


def progress(start, runs=None, with_results=()):
    return [s.progress for s in stage_states(start, runs or {}, frozenset(with_results)).values()]


CONFIRMED = AxisChoice(confirmed=True)
READY = checked(document(drive=CONFIRMED, recordings=(recording(),)))
DONE = searched(READY)


@pytest.mark.parametrize(
    ("start", "expected"),
    [
        (document(), ["open", *["blocked"] * 5]),
        (document(drive=CONFIRMED), ["done", "open", *["blocked"] * 4]),
        (document(drive=CONFIRMED, recordings=(recording(options={}),)), ["done", "open", *["blocked"] * 4]),
        (document(drive=CONFIRMED, recordings=(recording(use="test"),)), ["done", "open", *["blocked"] * 4]),
        (document(drive=CONFIRMED, recordings=(recording(),)), ["done", "done", "open", *["blocked"] * 3]),
        (READY, ["done", "done", "done", "open", "blocked", "blocked"]),
        (checked(READY, "stop"), ["done", "done", "open", *["blocked"] * 3]),
        (checked(READY, "stop", override=True), ["done", "done", "done", "open", "blocked", "blocked"]),
    ],
)
def test_stage_states__before_a_search__each_waits_for_the_one_before(start, expected):
    assert progress(start) == expected


def test_stage_states__of_a_run__follow_its_state():
    assert progress(DONE, {"run-1": "running"})[3:] == ["open", "blocked", "blocked"]
    assert progress(DONE, {"run-1": "finished"}, ["run-1"]) == ["done"] * 6
    paused = searched(READY, wanted="paused")
    assert progress(paused, {"run-1": "unfinished"})[3:] == ["open", "blocked", "blocked"]
    assert progress(paused, {"run-1": "unfinished"}, ["run-1"]) == ["done"] * 6  # stopped with the best so far


@pytest.mark.parametrize(
    "change",
    [
        {"drive": AxisChoice(confirmed=True, most_masses=2)},
        {"recordings": (recording(), recording(2))},
        {"recordings": (recording(options={**OPTIONS, "window": "0:1"}),)},
    ],
)
def test_stage_states__something_earlier_changed__later_stages_are_out_of_date(change):
    after = progress(DONE.model_copy(update=change), {"run-1": "finished"}, ["run-1"])
    assert "done" not in after[3:]
    assert after[4:] == ["stale", "stale"]  # the old results can still be looked at
    if "recordings" in change:
        assert after[2] == "stale"


def test_stage_states__limits_or_motion_changed__results_stand():
    after = DONE.model_copy(update={"drive": AxisChoice(confirmed=True, motion="linear", limits={"torque": "5"})})
    assert progress(after, {"run-1": "finished"}, ["run-1"]) == ["done"] * 6


def test_current_run__changed_back__is_the_earlier_run():
    other = DONE.model_copy(update={"drive": AxisChoice(confirmed=True, most_masses=2)})
    assert current_run(other) is None
    assert current_run(other.model_copy(update={"drive": CONFIRMED})).name == "run-1"


def test_next_stage__is_the_first_that_is_not_done():
    assert next_stage(stage_states(READY, {}, frozenset())) == "search"
    assert next_stage(stage_states(DONE, {"run-1": "finished"}, frozenset({"run-1"}))) == STAGES[-1]


def test_digest_of_search__values_that_may_differ__count_once_they_are_named():
    before = document()
    named = before.model_copy(update={"search": SearchChoice(per_recording="f_v")})
    assert digest_of_search(named) != digest_of_search(before)
