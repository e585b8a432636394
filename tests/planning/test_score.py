"""Power by whitened projection: known optimal designs, the reference solver, and determinism."""

from dataclasses import replace

import numpy as np
import pytest

from brightgrey.kit import PAPER
from brightgrey.planning.rivals import refitted, refitted_from_torques, remaining, scales_with
from brightgrey.planning.score import score
from brightgrey.search.undecided.question import Known, LargestRival, Question
from brightgrey.simulation.reference import reference
from support.planning import DT, STRUCTURE, TORQUE, VALUES, known, known_drive


def discriminating(points, weights, n):
    """T-criterion of a design between a polynomial of degree n with leading coefficient 1 and degree n - 2."""
    root = np.sqrt(weights)
    rival = root[:, None] * np.vander(points, n - 1, increasing=True)
    nothing = np.zeros((n - 1, n - 1))
    return remaining(nothing, np.zeros(n - 1), 0.0, root * points**n, rival)


@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_polynomials_of_degrees_n_and_n_minus_1__chebyshev_points_are_optimal(n):
    # The T-optimal design on [-1, 1] has the extremes of the Chebyshev polynomial of degree n, the ends with half the
    # weight of the others; the criterion is the squared distance of x^n to the rivals in the maximum norm, 4^(1 - n).
    points = np.cos(np.pi * np.arange(n + 1) / n)
    weights = np.r_[0.5, np.ones(n - 1), 0.5] / n

    def criterion(x, w):
        rival = np.sqrt(w)[:, None] * np.vander(x, n, increasing=True)
        return remaining(np.zeros((n, n)), np.zeros(n), 0.0, np.sqrt(w) * x**n, rival)

    best = criterion(points, weights)
    assert best == pytest.approx(4.0 ** (1 - n), rel=1e-9)
    rng = np.random.default_rng(n)
    for _ in range(50):
        assert criterion(rng.uniform(-1.0, 1.0, n + 3), rng.dirichlet(np.ones(n + 3))) <= best * (1.0 + 1e-9)


@pytest.mark.parametrize("n", [3, 4, 5])
def test_degrees_n_and_n_minus_2__weight_moved_to_any_point_lowers_the_criterion(n):
    # Dette and Titoff (2009, doi:10.1214/08-AOS635), by the equivalence theorem: a design is T-optimal if and only if
    # the squared residual of the best rival nowhere exceeds the criterion. With no term of degree n - 1 in the truth,
    # the points are again the extremes of the Chebyshev polynomial.
    points = np.cos(np.pi * np.arange(n + 1) / n)
    weights = np.r_[0.5, np.ones(n - 1), 0.5] / n
    best = discriminating(points, weights, n)
    assert best == pytest.approx(4.0 ** (1 - n), rel=1e-9)
    grid = np.linspace(-1.0, 1.0, 101)
    for x in grid:  # moving a little weight to any point lowers the criterion
        mixed = discriminating(np.r_[points, x], np.r_[0.99 * weights, 0.01], n)
        assert mixed <= best * (1.0 + 1e-9)


def test_remaining__old_recordings_hold_the_rival_back():
    # One parameter: min over p of H p^2 + |c + J p|^2 has a closed form.
    c, J, H = np.array([1.0, 2.0]), np.array([[1.0], [1.0]]), 3.0
    p = -(J[:, 0] @ c) / (H + 2.0)
    expected = H * p**2 + np.sum((c + J[:, 0] * p) ** 2)
    assert remaining(np.array([[H]]), np.zeros(1), 0.0, c, J) == pytest.approx(expected, rel=1e-12)


def test_information__as_finite_differences_of_the_reference_solver():
    drive = known_drive()
    known, structure = drive.known.model, "one_mass+coulomb+viscous"
    f_tanh = drive.settings.f_tanh
    base = dict(known.values)
    columns = []
    for name in known.names:
        step = 1e-4 * base[name]
        (up,), (down,) = (
            reference(structure, {**base, name: base[name] + s}, TORQUE, drive.known.sampling_time, f_tanh=f_tanh)
            for s in (step, -step)
        )
        columns.append(base[name] * (up - down) / (2.0 * step))  # all parameters are searched by their logarithm
    J = np.stack(columns, axis=1) * drive.known.noise[0].weight / np.sqrt(drive.known.noise[0].variance)
    wanted = np.array(known.information) + J.T @ J
    found = score(drive, TORQUE).information
    # Level fast is accurate to 3e-4 of the motion, and a slope to about 1 %.
    assert found == pytest.approx(wanted, rel=0.02, abs=0.01 * np.abs(wanted).max())
    assert PAPER.parse(structure).parameters.keys() == set(known.names)


def test_score__more_torque_decides_more_and_the_same_call_gives_the_same():
    drive = known_drive()
    (small,), (large,) = (score(drive, size * TORQUE).answers for size in (0.3, 1.0))
    assert small.noncentrality < large.noncentrality
    (again,) = score(drive, TORQUE).answers
    assert again.noncentrality == large.noncentrality
    (refitted,) = score(drive, TORQUE, refit=True).answers
    assert refitted.noncentrality <= large.noncentrality


def test_score__another_effect_that_does_the_same__is_not_promised_whatever_the_rival_lacks():
    # A dead time of 4 ms and a lag of 4 ms delay a slow torque alike. The recordings so far say nothing of either.
    base, ranges = known(), {"T_d": (0.0, 0.1), "T_1": (1e-5, 0.1)}
    values = {**VALUES, "T_1": 0.004}
    information = np.diag([1e3, 1e3, 1e3, 0.0])
    wide = Known(f"{STRUCTURE}+current_control", values, tuple(values), tuple(map(tuple, information.tolist())))
    largest = LargestRival(wide, ((0.0,) * 4, (0.0,) * 4), ((0.0, 0.0), (0.0, 0.0)))
    truth = {**VALUES, "T_d": 0.004}
    alone = Question(("delay",), "size", f"{STRUCTURE}+delay", truth, base, (0.0,) * 3, 0.0, 2, 7.8)
    drive = known_drive()

    def power(question, **options):
        wider = replace(drive.known, questions=(question,), bounds={**drive.known.bounds, **ranges})
        (answer,) = score(replace(drive, known=wider), TORQUE, **options).answers
        return answer.power

    assert power(alone, refit=True) > 0.95
    assert power(replace(alone, largest=(largest,))) > 0.95  # the search for a motion does without
    assert power(replace(alone, largest=(largest,)), refit=True) < 0.5


def test_scales_with__faster_motion__lets_friction_fade_at_its_speed():
    rival = {**VALUES, "M_S": 0.2, "omega_S": 2.0}
    zeros = tuple((0.0,) * 5 for _ in range(5))
    structure = Known(f"{STRUCTURE}+stribeck", rival, tuple(rival), zeros)
    drive = known_drive()
    drive = replace(drive, known=replace(drive.known, bounds={}))
    slow, fast = (scales_with(drive, size * TORQUE) for size in (0.1, 3.0))
    assert slow == replace(drive.known.scales, duration=DT * TORQUE.size)
    assert fast.speed > 2.0 * drive.known.scales.speed
    index = structure.names.index("omega_S")
    for scales in (slow, fast):
        assert drive.box(structure, scales)[1][index] == pytest.approx(np.log(scales.speed))


def test_refitted_from_torques__rival_that_held_no_friction__stands_for_coulomb_friction():
    truth = {"J1": 0.02, "M_C": 0.3, "f_v": 0.02}
    left = {"J1": 0.02, "f_v": 0.02, "M_S": 1e-3, "omega_S": 0.1}  # by recordings that hold no friction
    structure = "one_mass+viscous+stribeck"
    information = tuple(map(tuple, np.diag([1e3, 1e3, 1e-9, 1e-9]).tolist()))
    rival = Known(structure, left, tuple(left), information)
    question = Question(("coulomb",), "size", STRUCTURE, truth, rival, (0.0,) * 4, 0.0, 2, 7.8)
    drive = known_drive()
    drive = replace(drive, known=replace(drive.known, questions=(question,), bounds={}))
    torque = 3.0 * TORQUE
    (outputs,), scales = drive.truths((question,), torque), scales_with(drive, torque)
    far = refitted(drive, question, torque, outputs, scales)
    found = refitted_from_torques(drive, question, torque, outputs, scales)
    assert far > 100.0 * question.critical  # the descent from there is stuck
    assert found < 0.01 * far
    none = replace(question, rival=known())
    assert refitted_from_torques(drive, none, torque, outputs, scales) == np.inf  # nothing in it has a shape


def test_refitted_from_torques__recordings_so_far_leave_more__no_less_is_left_after_one_more():
    rival = {"J1": 0.02, "f_v": 0.02, "M_S": 1e-2, "omega_S": 0.1}
    information = tuple(map(tuple, np.diag([1e3, 1e3, 1.0, 1e-3]).tolist()))
    left = Known("one_mass+viscous+stribeck", rival, tuple(rival), information)
    question = Question(("coulomb",), "size", STRUCTURE, VALUES, left, (0.0, 0.0, 4.0, 0.0), 20.0, 2, 7.8)
    drive = known_drive()  # M_S is at its lower bound, and the gradient leads out
    still = 0.01 * TORQUE
    found = refitted_from_torques(drive, question, still, drive.truths((question,), still)[0], drive.known.scales)
    assert found >= 20.0


def test_refitted_from_torques__recordings_so_far_know_the_friction__what_they_say_counts():
    left = {"J1": 0.02, "f_v": 0.02, "M_S": 1.0, "omega_S": 8.0}
    truth = {**left, "M_C": 0.2, "M_S": 0.8}
    information = tuple(map(tuple, np.diag([1e6, 1e6, 1e6, 1e6]).tolist()))
    rival = Known("one_mass+viscous+stribeck", left, tuple(left), information)
    question = Question(("coulomb",), "size", f"{STRUCTURE}+stribeck", truth, rival, (0.0,) * 4, 0.0, 2, 7.8)
    drive = known_drive()
    (outputs,), scales = drive.truths((question,), TORQUE), scales_with(drive, TORQUE)
    found = refitted_from_torques(drive, question, TORQUE, outputs, scales)
    assert found == pytest.approx(refitted(drive, question, TORQUE, outputs, scales), rel=0.05)
    vague = replace(question, rival=replace(rival, information=tuple((0.0,) * 4 for _ in range(4))))
    assert refitted_from_torques(drive, vague, TORQUE, outputs, scales) < 0.5 * found


@pytest.mark.parametrize("kind", ["velocity", "speed", "acceleration"])
def test_start_by_torques__any_sensor__finds_the_friction_of_the_truth(kind):
    truth = {"J1": 0.02, "M_S": 0.5, "omega_S": 4.0}
    left = {"J1": 0.02, "M_S": 1e-3, "omega_S": 0.1}
    rival = Known("one_mass+stribeck", left, tuple(left), tuple((0.0,) * 3 for _ in range(3)))
    question = Question(("stribeck",), "size", "one_mass+stribeck", {}, rival, (0.0,) * 3, 0.0, 2, 7.8)
    drive = known_drive()
    unit = "rad/s^2" if kind == "acceleration" else "rad/s"
    output = drive.model.signals[1].model_copy(update={"kind": kind, "unit": unit})
    model = drive.model.model_copy(update={"signals": (drive.model.signals[0], output)})
    drive = replace(drive, model=model, known=replace(drive.known, bounds={}))
    at = drive.start_by_torques(replace(question, values=truth), {"omega_S"}, TORQUE, drive.known.scales, 64)
    found = np.exp(at)
    assert found[1] * np.exp(-1.0 / found[2]) == pytest.approx(0.5 * np.exp(-1.0 / 4.0), rel=0.3)  # at 1 rad/s
