"""Effects that a function set holds back: which of them a search offers, and what it then finds."""

import numpy as np
import pytest

from brightgrey.errors import SettingsError
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER, Placed, Structure, function_set, grammar_named
from brightgrey.search.decision import decide_structures
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.structure_fit import Options, StructureFit, fit_multistart
from brightgrey.search.further.proposals import (
    EffectChanges,
    as_limiting_cases,
    changes_beside,
    further_effects,
    joint_step,
    moved_effects,
)
from brightgrey.search.parallel import thread_pool
from support.searches import simulated_task, verdicts

F_TANH = 200.0
FURTHER = grammar_named("drive").further
BASE = {"J1": 0.012, "f_v": 0.004, "M_C": 0.3}
SECOND = {"J2": 0.008, "c1": 30.0, "d1": 0.03}
CASES = [
    ("one_mass+coulomb+viscous", {"directional_viscous": {"f_d": -0.003}}),
    ("one_mass+coulomb+viscous", {"pendulum": {"G": 0.6, "k": 1.5, "phi_0": 0.4}}),
    ("one_mass+coulomb+viscous+gravity", {"ground_spring": {"c_g": 0.08}}),
    ("two_mass+coulomb+viscous", {"coulomb@2": {"M_C@2": 0.25}}),
]


def recorded(base, more, seed=1):
    values = dict(BASE) | (SECOND if "two_mass" in base else {}) | ({"M_G": 0.2} if "gravity" in base else {})
    values |= {name: value for own in more.values() for name, value in own.items()}
    structure = "+".join((base, *more))
    noise = 0.005 * E.speed
    return simulated_task(structure, values, E.torque(), noise, dt=E.dt, f_tanh=F_TANH, seed=seed, step=1e-3)


@pytest.mark.parametrize(("base", "more"), CASES, ids=[next(iter(m)) for _, m in CASES])
def test_further_effects__one_is_missing__is_tried_near_its_size(base, more):
    task = recorded(base, more)
    fitted = fit_multistart(task, PAPER.parse(base), Options(fresh=4, patience=0), 0)
    found = further_effects(task, fitted, FURTHER, 0)
    ((name, values),) = more.items()
    size = next(iter(values))
    start = next(f.start for f in found if f.placed == Placed.parse(name))
    assert 0.2 < start[size] / values[size] < 5.0


def changes_by(effect, size, *changes, either_sign=False):
    """Changes by an effect at several values of its other parameter, which is 0, 1, ..."""
    placed = Placed(effect)
    values = {"size": np.full(len(changes), size), "other": np.arange(len(changes), dtype=float)}
    return EffectChanges(placed, (placed,), values, "size", np.column_stack(changes), either_sign)


def test_joint_step__two_effects_explain_what_none_does_alone__sizes_of_both():
    one, two, three, rest = np.eye(40)[:4]
    left = rest - 3.0 * one + 0.5 * two
    changes = [
        changes_by("stribeck", 2.0, three, one),
        changes_by("gravity", 0.1, two, either_sign=True),
        changes_by("coulomb", 1.0, two),  # would have to be negative
        changes_by("viscous", 1.0, np.zeros(40)),
    ]
    after, effects = joint_step(changes, left)
    assert after == pytest.approx(rest)
    assert [f.placed.name for f in effects] == ["stribeck", "gravity"]
    assert effects[0].start == pytest.approx({"size": 6.0, "other": 1.0})
    assert effects[1].start == pytest.approx({"size": -0.05, "other": 0.0})


def test_joint_step__values_that_would_have_to_be_negative__others_are_taken():
    one, two = np.eye(40)[:2]
    _, effects = joint_step([changes_by("stribeck", 1.0, one + 0.1 * two, 0.5 * two - one)], 3.0 * one)
    assert [f.start["other"] for f in effects] == [1.0]


def test_changes_beside__dead_time__has_one_sign():
    task = recorded("one_mass+coulomb+viscous", {})
    fitted = fit_multistart(task, PAPER.parse("one_mass+coulomb+viscous"), Options(fresh=2, patience=0), 0)
    found = changes_beside(task, fitted, np.zeros(task.recordings[0].samples), PAPER.placed, 0)
    assert {c.placed.name: c.either_sign for c in found} == {
        "stribeck": False,
        "gravity": True,
        "current_control": False,
        "delay": False,
    }


def test_joint_step__nothing_shared__residual_and_no_effects():
    one, two = np.eye(40)[:2]
    after, effects = joint_step([changes_by("coulomb", 1.0, two)], one)
    assert after == pytest.approx(one)
    assert effects == []
    assert joint_step([], one)[1] == []


@pytest.mark.parametrize(("stiffness", "friction"), [(30.0, 1.0), (240.0, 1.2)])
def test_moved_effects__friction_at_the_second_mass_only__takes_the_place_of_that_at_the_first(stiffness, friction):
    """Beside friction at the first mass, no step leads to that at the second; of three descents one may be trapped."""
    values = {"J1": 0.006, "J2": 0.009, "c1": stiffness, "d1": 0.05, "M_C@2": friction}
    truth, noise = "two_mass+coulomb@2", 0.005 * E.speed
    task = simulated_task(truth, values, E.torque(), noise, dt=E.dt, f_tanh=F_TANH, step=1e-3)
    (true,) = task.problem(function_set().parse(truth)).costs(
        {n: np.array([v]) for n, v in values.items()}, task.settings
    )
    reached = []
    for seed in range(3):
        known = fit_multistart(task, PAPER.parse("two_mass+coulomb"), Options(fresh=4, patience=0), seed)
        added = costs_beside(task, known, further_effects(task, known, FURTHER, 0))
        moved = costs_beside(task, known, moved_effects(task, known, FURTHER))
        assert list(moved) == ["coulomb@2"]
        assert moved["coulomb@2"] < 0.5 * min(added.values())
        reached.append(moved["coulomb@2"] < 1.05 * true)
    assert sum(reached) >= 2


@pytest.mark.parametrize(("gravity", "added"), [("", 0.0), ("+gravity", 1.5 - 2.0 * np.sin(0.1))])
def test_as_limiting_cases__pendulum__spring_to_the_ground_and_what_there_is_of_gravity(gravity, added):
    kit, values = function_set(), {"J1": 0.02, "f_v": 0.01} | ({"M_G": 1.5} if gravity else {})
    own = StructureFit(kit.parse(f"one_mass+viscous{gravity}"), values, 2.0, 3)
    load = {"G": 2.0, "k": 0.05, "phi_0": 0.1}
    larger = StructureFit(kit.parse(f"one_mass+viscous{gravity}+pendulum"), values | load, 1.0, 6)
    ((structure, start),) = as_limiting_cases(own, larger, FURTHER)
    assert str(structure) == f"one_mass+viscous{gravity}+ground_spring"
    assert start["c_g"] == pytest.approx(2.0 * 0.05 * np.cos(0.1))
    assert start.get("M_G", 0.0) == pytest.approx(added)
    assert as_limiting_cases(larger, larger, FURTHER) == []


def costs_beside(task, known, found):
    """Cost of a fit with each of some effects beside a structure."""
    larger = [(Structure((*known.structure.placed, *f.added)), {**known.values, **f.start}) for f in found]
    with thread_pool(None) as workers:
        fits = FitTable(task, ()).tried(larger, workers)
    return {str(f.placed): t.cost for f, t in zip(found, fits, strict=True)}


@pytest.mark.long
def test_decide__friction_at_the_second_mass__is_found():
    task = recorded("two_mass+coulomb+viscous", {"coulomb@2": {"M_C@2": 0.25}})
    excluded = ("four_mass", "current_control", "delay", "stribeck", "gravity")
    found = decide_structures(task, grammar_named("drive"), exclude=excluded)
    truth = function_set().parse("two_mass+coulomb+viscous+coulomb@2")
    assert verdicts(found)["coulomb@2"] == "needed"
    assert verdicts(found).get("three_mass") != "needed"
    assert any(set(m.structure.placed) <= set(truth.placed) for m in found.evidence.minimal)
    assert "coulomb@2" in found.evidence.certificate.offered
    assert any("Coulomb friction at mass 2" in s for s in found.evidence.certificate.sentences())


@pytest.mark.long
def test_decide__shaft_that_hardens__takes_the_place_of_a_gap():
    task = recorded("two_mass+coulomb+viscous", {"cubic_spring": {"c_cubic": 800.0}})
    excluded = ("three_mass", "four_mass", "current_control", "delay", "stribeck", "gravity")
    found = decide_structures(task, grammar_named("drive"), exclude=excluded)
    assert verdicts(found)["cubic_spring"] == "needed"
    assert "backlash" not in verdicts(found)
    assert [str(m.structure) for m in found.evidence.minimal] == ["two_mass+coulomb+viscous+cubic_spring"]


@pytest.mark.long
def test_decide__gap__no_shaft_that_hardens():
    task = recorded("two_mass+coulomb+viscous", {"backlash": {"alpha": 0.02}})
    excluded = ("three_mass", "four_mass", "current_control", "delay", "stribeck", "gravity")
    found = decide_structures(task, grammar_named("drive"), exclude=excluded)
    assert verdicts(found)["backlash"] == "needed"
    assert "cubic_spring" not in verdicts(found)


def test_decide__effects_that_exclude_each_other_required__refused():
    task = recorded("one_mass+coulomb+viscous", {})
    with pytest.raises(SettingsError, match="'backlash' and 'cubic_spring' exclude each other"):
        decide_structures(task, grammar_named("drive"), require=("backlash", "cubic_spring"))


def test_decide__the_papers_effects_explain_it__offers_nothing():
    task = recorded("one_mass+coulomb+viscous", {})
    found = decide_structures(task, grammar_named("drive"), exclude=("three_mass", "current_control", "delay"))
    assert found.evidence.certificate.offered == ()
    assert [str(m.structure) for m in found.evidence.minimal] == ["one_mass+coulomb+viscous"]


@pytest.mark.long
def test_decide__more_masses_required_than_would_be_offered__are_there():
    task = recorded("two_mass+coulomb+viscous", {"coulomb@2": {"M_C@2": 0.25}})
    excluded = ("stribeck", "gravity", "backlash", "current_control", "delay")
    found = decide_structures(task, grammar_named("drive"), require=("three_mass",), exclude=excluded)
    assert all(s.masses >= 3 for s in found.fitted)
    with pytest.raises(SettingsError, match="Did you mean 'coulomb@4'"):
        decide_structures(task, grammar_named("drive"), exclude=("coulomb@9",))


@pytest.mark.long
def test_decide__required_at_another_mass__is_in_every_structure():
    task = recorded("two_mass+coulomb+viscous", {"coulomb@2": {"M_C@2": 0.25}})
    excluded = ("three_mass", "stribeck", "gravity", "backlash", "current_control", "delay")
    found = decide_structures(task, grammar_named("drive"), require=("coulomb@2",), exclude=excluded)
    assert all(Placed("coulomb", 2) in s.placed for s in found.fitted)
    assert np.isfinite([f.cost for f in found.fitted.values()]).all()
