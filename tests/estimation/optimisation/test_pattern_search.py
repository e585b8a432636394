"""Pattern search: known optima, limits, and independence of several searches."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import minimize

from brightgrey.errors import SettingsError
from brightgrey.estimation.optimisation.options import PatternSearchOptions
from brightgrey.estimation.optimisation.pattern_search import pattern_search

TARGET = np.array([0.3, -1.2, 2.0])
LOW, HIGH = np.full(3, -3.0), np.full(3, 3.0)


def bowl(points, upper_limits=None):
    return np.sum(np.array([1.0, 4.0, 0.2])[:, None] * (points - TARGET[:, None]) ** 2, axis=0)


def valley(points, upper_limits=None):
    x, y = points
    return (1 - x) ** 2 + 20 * (y - x * x) ** 2


class Counted:
    def __init__(self, cost):
        self.cost, self.batches, self.points, self.limits = cost, [], [], []

    def __call__(self, points, upper_limits):
        self.batches.append(points.shape[1])
        self.limits.append(upper_limits.copy())
        self.points.append(points.copy())
        return self.cost(points)


def test_pattern_search__optimum_inside_the_bounds__is_found():
    (end,) = pattern_search(bowl, np.zeros(3), LOW, HIGH)
    assert end.reason == "mesh"
    np.testing.assert_allclose(end.values, TARGET, atol=1e-5)
    assert end.cost == pytest.approx(0.0, abs=1e-9)


def test_pattern_search__optimum_on_a_bound__is_found():
    high = np.array([3.0, 3.0, 1.0])
    (end,) = pattern_search(bowl, np.zeros(3), LOW, high)
    np.testing.assert_allclose(end.values, [0.3, -1.2, 1.0], atol=1e-5)


def test_pattern_search__bent_valley__is_followed_from_several_starts():
    starts = np.array([[-1.2, 1.5, 0.0], [1.0, -1.0, 0.0]])
    ends = pattern_search(valley, starts, [-2, -2], [2, 2], iterations=5000)
    reference = minimize(lambda x: valley(x), [0.5, 0.5]).fun
    for end in ends:
        assert end.cost <= reference + 1e-6


def test_mesh__doubles_after_two_successes__halves_after_a_failure():
    cost = Counted(lambda points: points[0])  # the lower the better, down to the bound
    (end,) = pattern_search(cost, [0.5], [0.0], [1.0], options=PatternSearchOptions(first_mesh=0.0625, last_mesh=0.01))
    visited = [sorted(batch[0].tolist()) for batch in cost.points]
    # 0.5, then +-1/16 twice, from 3/8 +-1/8 and the way of two successes once more, which is as far; from 1/4 +-1/8 and
    # the last two once more, which goes further; from 1/16 +-1/4, and two such moves (put onto the bound).
    assert visited[:4] == [[0.5], [0.4375, 0.5625], [0.375, 0.5], [0.25, 0.25, 0.5]]
    assert visited[4:6] == [[0.0625, 0.125, 0.375], [0.0, 0.0, 0.0, 0.3125]]
    widths = [batch[0] for batch in visited[6:]]  # failures at 0, without moves
    np.testing.assert_allclose(widths, 0.25 / 2 ** np.arange(len(widths)))
    assert end.values == (0.0,)


def test_cost_many__gets_the_best_costs_as_upper_limits():
    cost = Counted(bowl)
    ends = pattern_search(cost, np.array([[0.0, 2.0]] * 3), LOW, HIGH, iterations=20)
    lowest = bowl(np.array([[0.0, 2.0]] * 3))
    assert np.all(np.isinf(cost.limits[0]))
    assert set(cost.limits[1]) == set(lowest)

    def aborted(points, upper_limits):
        found = bowl(points)
        return np.where(found < upper_limits, found, np.inf)

    assert pattern_search(aborted, np.array([[0.0, 2.0]] * 3), LOW, HIGH, iterations=20) == ends


def test_pattern_search__no_decrease_within_patience__stalls():
    (end,) = pattern_search(lambda p, upper_limits: 1.0 + 1e-4 * bowl(p), np.zeros(3), LOW, HIGH, patience=12)
    assert (end.reason, end.iterations) == ("stalled", 12)
    (end,) = pattern_search(bowl, np.zeros(3), LOW, HIGH, patience=12)
    assert end.reason == "mesh"  # every dozen polls gained


def test_pattern_search__several_searches__poll_in_one_batch():
    cost = Counted(bowl)
    ends = pattern_search(
        cost, np.zeros((3, 5)), LOW, HIGH, iterations=3, options=PatternSearchOptions(first_mesh=0.01)
    )
    assert cost.batches == [5, 30, 30, 35]  # the third with the way of two successes once more
    assert [end.iterations for end in ends] == [3] * 5
    assert all(end.reason == "iterations" for end in ends)


def test_pattern_search__several_searches__are_independent():
    rng = np.random.default_rng(4)
    starts = rng.uniform(-3, 3, (3, 6))
    together = pattern_search(bowl, starts, LOW, HIGH)
    alone = tuple(pattern_search(bowl, starts[:, i], LOW, HIGH)[0] for i in range(6))
    assert together == alone


@pytest.mark.parametrize("limit", [1, 7, 20, 21, 100])
def test_pattern_search__evaluation_limit__holds(limit):
    cost = Counted(bowl)
    (end,) = pattern_search(cost, np.zeros(3), LOW, HIGH, evaluations=limit)
    assert sum(cost.batches) == end.evaluations <= limit
    assert end.reason == "evaluations"


def test_pattern_search__stays_in_the_bounds__never_gets_worse():
    cost = Counted(bowl)
    starts = np.random.default_rng(1).uniform(-9, 9, (3, 4))  # some outside: put onto the bounds
    ends = pattern_search(cost, starts, LOW, HIGH)
    points = np.concatenate(cost.points, axis=1)
    assert np.all(points >= LOW[:, None])
    assert np.all(points <= HIGH[:, None])
    first = bowl(np.clip(starts, LOW[:, None], HIGH[:, None]))
    assert all(end.cost <= c for end, c in zip(ends, first, strict=True))


def test_pattern_search__costs_not_a_number__are_never_chosen():
    def holes(points, upper_limits):
        c = bowl(points)
        return np.where(points[0] > 0.5, np.nan, np.where(points[1] > 0.0, np.inf, c))

    (end,) = pattern_search(holes, [-2.0, 1.0, 0.0], LOW, HIGH)
    assert np.isfinite(end.cost)
    assert end.values[0] <= 0.5
    (nowhere,) = pattern_search(lambda p, upper_limits: np.full(p.shape[1], np.nan), [0.0, 0, 0], LOW, HIGH)
    assert nowhere.cost == np.inf
    assert nowhere.reason == "mesh"


def test_pattern_search__range_without_width__stays():
    (end,) = pattern_search(bowl, np.zeros(3), [-3, 0.5, -3], [3, 0.5, 3])
    assert end.values[1] == 0.5
    (fixed,) = pattern_search(bowl, TARGET, TARGET, TARGET)
    assert fixed.values == tuple(TARGET)
    (nothing,) = pattern_search(lambda p, upper_limits: np.ones(p.shape[1]), np.zeros((0, 1)), [], [])
    assert nothing.cost == 1.0


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"low": [0.0, 0.0]}, "do not fit"),
        ({"low": [4.0, 0.0, 0.0]}, "low <= high"),
        ({"high": [np.inf, 1.0, 1.0]}, "finite"),
        ({"iterations": 0}, "iterations 0"),
        ({"evaluations": 0}, "evaluations 0"),
        ({"patience": 0}, "patience 0"),
        ({"options": PatternSearchOptions(first_mesh=0.0)}, "mesh 0"),
    ],
)
def test_pattern_search__wrong_arguments__are_refused(wrong, says):
    arguments = {"low": LOW, "high": HIGH} | wrong
    with pytest.raises(SettingsError, match=says):
        pattern_search(bowl, np.zeros(3), **arguments)


def test_poll__in_blocks__ends_at_the_first_better_point():
    n = 10
    weights = np.linspace(1.0, 2.0, n)[:, None]
    cost = Counted(lambda points: np.sum(weights * (points - 0.3) ** 2, axis=0))
    (end,) = pattern_search(
        cost, np.zeros(n), np.full(n, -1.0), np.full(n, 1.0), options=PatternSearchOptions(last_mesh=1e-4)
    )
    np.testing.assert_allclose(end.values, 0.3, atol=2e-4)
    assert max(cost.batches) == 16  # of 20 and up to four moves
    assert end.evaluations == sum(cost.batches)
    costs = [cost.cost(points) for points in cost.points]
    least, polls = costs[0].min(), 0
    for before, now in pairwise(costs[1:]):
        if before.min() >= least and len(before) == 16:
            polls += 1  # what is left of a poll comes next
            assert len(now) <= 8
        least = min(least, before.min())
    assert polls > 0
