"""Truths between two structures that explain the recordings alike, and the largest rivals without an effect."""

from dataclasses import replace

import numpy as np
import pytest

from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.planning.alternatives import (
    against_largest,
    share_that_matters,
    truth_between,
    with_free,
    with_free_width,
)
from brightgrey.planning.rivals import remaining
from brightgrey.planning.score import mean_powers, score
from brightgrey.search.undecided.question import Known, LargestRival, Question
from support.planning import STRUCTURE, TORQUE, VALUES, known, known_drive

RANGES = {"T_d": (0.0, 0.1), "T_1": (1e-5, 0.1), "M_S": (1e-3, 10.0), "omega_S": (0.1, 50.0)}


def known_of(structure, values, information=1e-3):
    """Estimates of which the recordings say little."""
    matrix = np.diag(np.full(len(values), information))
    return Known(structure, values, tuple(values), tuple(map(tuple, matrix.tolist())))


def tied(size=0.01):
    """A dead time against a lag of the same length."""
    rival = known_of(f"{STRUCTURE}+current_control", {**VALUES, "T_1": size})
    truth = {**VALUES, "J1": 0.03, "T_d": size}
    gradient = (4.0, 0.0, 0.0, -2.0)
    return Question(("delay", "current_control"), "tied", f"{STRUCTURE}+delay", truth, rival, gradient, 8.0, 2, 7.8)


def size(effect, **values):
    """An effect of the least size that matters beside the structure of the small drive."""
    return Question(
        (effect,), "size", f"{STRUCTURE}+{effect}", {**VALUES, **values}, known(), (0.0,) * 3, 0.0, 3, 9.8, (1.0, 1.0)
    )


def drive_with(*questions, **changed):
    """The small drive with open questions."""
    drive = known_drive()
    asked = replace(drive.known, questions=questions, bounds={**drive.known.bounds, **RANGES, **changed})
    return replace(drive, known=asked)


def test_truth_between__a_quarter_of_the_way__sizes_are_scaled_and_shared_values_interpolated():
    found = truth_between(tied(), 0.25)
    assert found.truth == f"{STRUCTURE}+current_control+delay"
    assert found.values == pytest.approx({**VALUES, "J1": 0.0225, "T_d": 0.0025, "T_1": 0.0075})
    assert found.gradient == (1.0, 0.0, 0.0, -0.5)  # linear in the share
    assert found.deviance == 0.5  # and its square
    assert found.rival == tied().rival


def test_truth_between__speed_of_stribeck_friction__is_no_size():
    rival = known()
    values = {**VALUES, "M_S": 0.4, "omega_S": 2.0}
    question = Question(("stribeck",), "tied", f"{STRUCTURE}+stribeck", values, rival, (0.0,) * 3, 0.0, 2, 7.8)
    found = truth_between(question, 0.5)
    assert (found.values["M_S"], found.values["omega_S"]) == (0.2, 2.0)


def test_truth_between__an_effect_or_none__stays():
    question = size("delay", T_d=0.004)
    assert truth_between(question, 0.5) is question


def test_share_that_matters__tied_structures__evenly_from_the_least_size_on():
    between = replace(tied(), least_share=0.2)
    assert [share_that_matters(between, part) for part in (0.0, 0.5, 1.0)] == pytest.approx([0.2, 0.6, 1.0])
    assert share_that_matters(size("delay", T_d=0.004), 0.5) == 1.0


def test_against_largest__share_of_the_way__change_is_that_of_the_truth_and_of_the_rival_by_their_parts():
    rng = np.random.default_rng(3)
    changes, J = rng.standard_normal((50, 2)), rng.standard_normal((50, 4))  # from the truth, from the rival
    products = changes.T @ changes
    deviances = ((products[0, 0], products[0, 1]), (products[1, 0], products[1, 1]))
    largest = LargestRival(known_of("one_mass", VALUES), tuple(map(tuple, changes.T @ J)), deviances)
    (found,) = against_largest(replace(tied(), largest=(largest,)), 0.3)
    change = 0.3 * changes[:, 0] + 0.7 * changes[:, 1]
    assert found.gradient == pytest.approx(tuple(J.T @ change))
    assert found.deviance == pytest.approx(change @ change)
    assert found.rival == largest.known
    assert (found.parameters, found.critical) == (tied().parameters, tied().critical)  # the threshold of the rival


def test_with_free_width__old_recordings__say_nothing_of_the_width_and_the_rest_is_eliminated():
    H, g = np.array([[4.0, 2.0], [2.0, 3.0]]), np.array([1.0, 3.0])
    values = {"J1": 0.02, FRICTION_WIDTH: 0.1}
    rival = Known("one_mass+coulomb", values, tuple(values), tuple(map(tuple, H.tolist())))
    found = with_free_width(Question(("delay",), "size", "", {}, rival, tuple(g.tolist()), 5.0, 1, 5.4))
    step = 0.3  # of J1; the width takes its best value
    wanted = min(5.0 + 2.0 * g @ d + d @ H @ d for d in (np.array([step, w]) for w in np.linspace(-3.0, 3.0, 6001)))
    (row, _), (slope, free) = found.rival.information, found.gradient
    assert found.rival.information[1] == (0.0, 0.0)
    assert free == 0.0
    assert found.deviance + 2.0 * slope * step + row[0] * step**2 == pytest.approx(wanted, abs=1e-5)


def test_with_free__parameters_that_act_nearly_alike__nothing_is_left_of_them_and_the_rest_is_right():
    J = np.random.default_rng(0).standard_normal((200, 5))
    J[:, 3] = J[:, 2] + 1e-5 * J[:, 3]
    names = ("J1", "M_C", "M_S", "omega_S", "f_v")
    change = J @ np.array([0.0, 1.0, 1.0, 0.0, 0.0]) + np.random.default_rng(1).standard_normal(200)
    information = tuple(map(tuple, (J.T @ J).tolist()))
    rival = Known("one_mass", dict.fromkeys(names, 1.0), names, information)
    question = Question(
        ("coulomb",), "size", "one_mass", {}, rival, tuple(J.T @ change), float(change @ change), 1, 4.0
    )
    found = with_free(question, {"M_S", "omega_S"})
    H = np.array(found.rival.information)
    assert not H[2:4].any()
    assert not H[:, 2:4].any()
    assert found.gradient[2:4] == (0.0, 0.0)
    basis, _ = np.linalg.qr(J[:, 2:4])
    others = J[:, [0, 1, 4]] - basis @ (basis.T @ J[:, [0, 1, 4]])
    rounding = 200.0 * np.finfo(float).eps / 1e-5**2  # the nearly equal columns magnify it by the square
    np.testing.assert_allclose(H[np.ix_([0, 1, 4], [0, 1, 4])], others.T @ others, rtol=0.0, atol=rounding)


def test_remaining__step_beyond_a_bound__is_held_there_and_the_others_are_fitted():
    change, J = np.array([2.0, -1.0]), np.eye(2)
    nothing = np.zeros((2, 2))
    assert remaining(nothing, np.zeros(2), 0.0, change, J) == pytest.approx(0.0, abs=1e-12)
    box = (np.array([-0.5, -9.0]), np.array([0.0, 9.0]))
    assert remaining(nothing, np.zeros(2), 0.0, change, J, box) == pytest.approx(1.5**2)


def test_score__rival_that_is_the_truth_with_other_values__is_fitted_until_nothing_remains():
    far = {"J1": 0.04, "M_C": 0.2, "f_v": 0.1}
    question = Question(("delay",), "size", STRUCTURE, VALUES, known_of(STRUCTURE, far), (0.0,) * 3, 0.0, 1, 5.4)
    drive = drive_with(question, M_C=(1e-3, 10.0))
    (linear,) = score(drive, TORQUE).answers
    (fitted,) = score(drive, TORQUE, refit=True).answers
    assert linear.noncentrality > 100.0
    assert fitted.noncentrality < 0.1


def test_score__truth_nearer_to_its_rival__less_remains():
    drive = drive_with(replace(tied(), values={**VALUES, "T_d": 0.01}, gradient=(0.0,) * 4, deviance=0.0))
    shares = (0.1, 0.3, 0.6, 1.0)
    found = [score(replace(drive, share=s), TORQUE, refit=True).answers[0].noncentrality for s in shares]
    assert found == sorted(found)
    assert found[0] < 0.1 * found[-1]


def test_mean_powers__tied_structures__less_is_promised_than_for_the_truth_alone():
    drive = drive_with(replace(tied(), values={**VALUES, "T_d": 0.01}, gradient=(0.0,) * 4, deviance=0.0))
    drive = replace(drive, share=1.0)
    for factor in np.geomspace(0.02, 1.0, 12):
        (alone,) = score(drive, factor * TORQUE, refit=True).answers
        if alone.power > 0.9:
            break
    (mean,) = mean_powers(drive, factor * TORQUE, seed=0)
    assert 0.1 < mean < alone.power - 0.2
