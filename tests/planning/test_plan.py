"""A plan from the folder of an identification: limits, units, files, words, errors and interruption."""

import json
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from brightgrey import SettingsError, plan
from brightgrey.planning.envelope import MotionCommand, envelope
from brightgrey.planning.families import families
from brightgrey.planning.limits import MachineLimits
from brightgrey.recordings.units.signals import Units
from brightgrey.search.undecided.question import UNDECIDED_FILE, OpenQuestions
from support.planning import QUICK, questions, small_run
from support.small_runs import call, start


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return small_run(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def made(run):
    return plan(run, limits={"torque": 2.5, "travel": 3.0}, effort=QUICK)


def test_questions__as_text__read_back_alike():
    assert OpenQuestions.parse(questions().text()).text() == questions().text()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"schema": "brightgrey/undecided/1"}, "^schema is .* identify again"),
        ({"scales": {"torque": "much"}}, "this is no result of a search: ValueError"),
        ({"bounds": {"J1": [1.0]}}, "this is no result of a search: ValueError"),
    ],
)
def test_questions__damaged_or_old_text__one_line(changed, message):
    text = json.dumps(json.loads(questions().text()) | changed)
    with pytest.raises(SettingsError, match=message):
        OpenQuestions.parse(text)


def test_limits__in_units_of_the_recording__become_si_and_back():
    units = Units("N", "mm")
    limits = MachineLimits.of(questions().reached, {"travel": 250.0, "speed": 100.0, "jerk": 7.0}, units)
    assert (limits.travel, limits.speed, limits.jerk) == pytest.approx((0.25, 0.1, 0.007))
    assert limits.torque == questions().reached["torque"]
    shown = limits.shown(units)
    assert shown["travel"] == (pytest.approx(250.0), "mm")
    assert shown["jerk"] == (pytest.approx(7.0), "mm/s³")
    assert "twist" not in shown


def test_plan__keeps_its_limits_for_fresh_draws_and_ends_at_rest(made):
    drive, torque = made.drive, made.found.candidate.torque
    draws = drive.draws(500, np.random.default_rng(99))
    seen = envelope(drive, drive.known.model.structure, draws, MotionCommand(torque, None), made.limits)
    assert seen.share_kept() >= 0.985  # 99 % of other draws; three standard deviations of a share of 500 are 1.3 %
    assert np.abs(torque).max() <= 2.5
    assert torque[0] == torque[-1] == 0.0


def test_plan__what_it_decides_is_written_in_words_and_in_files(made):
    (decision,) = made.decisions
    assert decision.after > max(decision.before, 0.5)
    assert made.sentences()[0] == f"Stribeck friction: power {decision.before:.2f} → {decision.after:.2f}"
    data = tomllib.loads(made.toml_text())
    assert data["limits"]["travel"] == 3.0
    assert data["decides"][0]["power_after"] == pytest.approx(decision.after, abs=1e-3)
    head, *rows = made.csv_text().splitlines()
    assert head == "t [s],position [rad],velocity [rad/s],acceleration [rad/s²],torque [N m]"
    table = np.array([[float(x) for x in row.split(",")] for row in rows])
    assert len(table) == 400
    assert np.ptp(table[:, 1]) <= 3.0
    assert all(0.0 < ratio <= 1.0 + 1e-9 for ratio in made.gains.values())


def test_plan__same_seed__same_bytes_for_any_number_of_threads(run, made):
    again = plan(run, limits={"torque": 2.5, "travel": 3.0}, workers=2, effort=QUICK)
    assert again.csv_text() == made.csv_text()
    assert again.toml_text() == made.toml_text()


def test_plan__limits_too_tight_to_decide__names_the_one_in_the_way(run):
    made = plan(run, limits={"speed": 0.02}, effort=QUICK)
    assert made.decisions[0].after < 0.5
    assert "Nothing within the limits decides everything" in made.cautions()[0]


def test_plan__question_that_no_motion_decides__motion_of_a_plan_without_it(run, tmp_path):
    known = questions()
    made = []
    for name, asked in (("hopeless", (replace(known.questions[0], critical=1e9),)), ("none", ())):
        folder = shutil.copytree(run, tmp_path / name)
        (folder / UNDECIDED_FILE).write_text(replace(known, questions=asked).text(), encoding="utf-8")
        made.append(plan(folder, effort=QUICK))
    np.testing.assert_array_equal(made[0].found.candidate.torque, made[1].found.candidate.torque)
    assert made[0].decisions[0].after < 0.01
    assert any("are given up" in text for text in made[0].cautions())
    assert not any("given up" in text for text in made[1].cautions())


def test_families__all_numbers__keep_the_length_and_are_finite(made):
    from brightgrey.planning.design import setting_of, torque_of

    setting = setting_of(made.drive, made.limits, made.seconds)
    rng = np.random.default_rng(0)
    for family in families():
        for numbers in (np.zeros(family.numbers), np.ones(family.numbers), rng.random(family.numbers)):
            torque = torque_of(made.drive, family, numbers, setting)
            assert torque.shape == (400,)
            assert np.isfinite(torque).all()
            slope = np.abs(np.diff(torque)).max() / setting.dt / made.drive.rigid.inertia
            assert slope <= made.limits.jerk, family.name


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"limits": {"torqe": 1.0}}, "unknown limit 'torqe'. Did you mean 'torque'?"),
        ({"limits": {"speed": -1.0}}, "limit of speed is -1.0; a positive number in rad/s is wanted"),
        ({"decide": ["stribek"]}, "unknown open effect 'stribek'. Did you mean 'stribeck'?"),
        ({"seconds": 0.01}, "a motion of 0.01 s has 5 samples"),
    ],
)
def test_plan__wrong_use__one_line(run, given, message):
    with pytest.raises(SettingsError) as error:
        plan(run, **given)
    assert str(error.value).startswith(message)


def test_plan__folder_without_a_search__says_what_to_do(run, tmp_path):
    (tmp_path / "model.json").write_bytes((run / "model.json").read_bytes())
    with pytest.raises(SettingsError, match=r"has no undecided\.json: identify without --structure writes it"):
        plan(tmp_path)


def test_command__writes_the_files_and_says_so(run, tmp_path, monkeypatch):
    monkeypatch.setattr("brightgrey.api.planning.plan", partial(plan, effort=QUICK))
    limits = tmp_path / "limits.toml"
    limits.write_text("torque = 2.5  # N m\ntravel = 3.0  # rad\n")
    done = call("plan", run, "--limits", limits, "--out", tmp_path / "next")
    assert (done.code, done.err) == (0, "")
    assert done.out.startswith("- Stribeck friction: power 0.")
    assert {p.name for p in (tmp_path / "next").iterdir()} == {"plan.csv", "plan.toml", "plan.svg"}


@pytest.mark.system
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_command__interrupted__writes_nothing(run, tmp_path):
    process = start("plan", run, "--seconds", "20", "--out", tmp_path / "next")
    time.sleep(3.0)  # it is importing, or trying motions: the outcome is the same
    process.send_signal(signal.SIGINT)
    try:
        _, err = process.communicate(timeout=60.0)
    except subprocess.TimeoutExpired:
        process.kill()
        raise
    assert process.returncode in (130, -signal.SIGINT)  # see tests/cli/test_interruption.py
    assert err == "brightgrey: interrupted, nothing written\n"
    assert not (tmp_path / "next").exists()
