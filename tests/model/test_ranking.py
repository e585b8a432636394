"""ranking.csv and the criterion in it."""

import csv
import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brightgrey.model.criterion import bic_of_traces
from brightgrey.model.ranking import Row, front, ranking_csv
from brightgrey.model.trace import Trace, pooled_fit
from brightgrey.recordings import Signal

TORQUE = Signal("torque", "input", "N m")
SPEED = Signal("n, filtered", "velocity", "rpm")


def trace(residual, seed=0):
    generator = np.random.default_rng(seed)
    measured = np.cumsum(generator.normal(size=(1, len(residual))), axis=1)
    t = 0.001 * np.arange(len(residual))
    return Trace("a.csv", t, np.sin(t), measured, measured - residual, TORQUE, (SPEED,))


def test_ranking_csv__reads_back_exactly():
    rows = [Row("two_mass+coulomb", 5, 1 / 3, 99.9, -12.5, True, "minimal"), Row("one_mass", 1, 2e-300, -3.0, None)]
    best, other = csv.DictReader(io.StringIO(ranking_csv(rows)))
    assert list(best) == [
        "rank",
        "structure",
        "n_parameters",
        "rss",
        "fit_percent",
        "criterion",
        "tied",
        "front",
        "status",
    ]
    assert (best["rank"], other["rank"]) == ("1", "2")
    assert float(best["rss"]) == 1 / 3
    assert float(other["rss"]) == 2e-300
    assert (best["tied"], other["tied"]) == ("true", "false")
    assert other["criterion"] == ""
    assert (best["status"], other["status"]) == ("minimal", "")  # nothing was decided of the other


def test_front__has_the_structures_that_no_other_beats():
    rows = [
        Row("d", 3, 1.0, 99.0, None),
        Row("as good with more", 4, 1.0, 99.0, None),
        Row("worse with as many", 3, 1.5, 98.0, None),
        Row("b", 1, 4.0, 90.0, None),
        Row("worse than b with more", 2, 5.0, 90.0, None),
        Row("diverged", 0, np.inf, -np.inf, None),
        Row("never simulated", 0, np.nan, np.nan, None),
    ]
    assert [row.structure for row in front(rows)] == ["b", "d"]
    assert front([]) == ()
    marks = [row["front"] for row in csv.DictReader(io.StringIO(ranking_csv(rows)))]
    assert marks == ["true", "false", "false", "true", "false", "false", "false"]


@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 9)), max_size=25))
def test_front__random_rows__agrees_with_its_definition(pairs):
    rows = [Row(str(k), d, float(rss), 0.0, None) for k, (d, rss) in enumerate(pairs)]

    def beaten(row):
        return any(
            other.n_parameters <= row.n_parameters
            and other.rss <= row.rss
            and (
                (other.n_parameters, other.rss) != (row.n_parameters, row.rss)
                or int(other.structure) < int(row.structure)
            )
            for other in rows
        )

    assert sorted(r.structure for r in front(rows)) == sorted(r.structure for r in rows if not beaten(r))


def test_bic__white_residuals__is_its_formula():
    residual = np.random.default_rng(1).normal(size=500)
    expected = 500 * np.log(np.mean(residual**2)) + 3 * np.log(500)
    assert bic_of_traces([trace(residual)], 3, [1e-9]) == pytest.approx(expected, rel=1e-12)


def test_bic__useless_parameter__grows():
    residual = np.random.default_rng(1).normal(size=500)
    assert bic_of_traces([trace(residual)], 4, [1e-9]) > bic_of_traces([trace(residual)], 3, [1e-9])


def test_bic__perfect_fit__has_the_resolution_as_floor():
    assert bic_of_traces([trace(np.zeros(100))], 0, [0.1]) == pytest.approx(100 * np.log(0.1**2 / 12), rel=1e-12)


def test_bic_and_fit__diverged_simulation__are_none():
    residual = np.append(np.zeros(50), np.nan)
    assert bic_of_traces([trace(residual)], 1, [0.1]) is None
    fit = pooled_fit([trace(residual)])["n, filtered"]
    assert (fit.rss, fit.rmse, fit.fit_percent) == (None, None, None)


@given(scale=st.floats(1e-6, 1e6), seed=st.integers(0, 100))
def test_pooled_fit__random_residuals__agrees_with_its_definition(scale, seed):
    generator = np.random.default_rng(seed)
    residual = scale * generator.normal(size=60)
    one, two = trace(residual[:25], seed), trace(residual[25:], seed + 1)
    fit = pooled_fit([one, two])["n, filtered"]
    spread = sum(np.sum((tr.measured - tr.measured.mean()) ** 2) for tr in (one, two))
    assert fit.rss == pytest.approx(np.sum(residual**2), rel=1e-6)  # the difference of two sums rounds
    assert fit.rmse == pytest.approx(np.sqrt(fit.rss / 60))
    assert fit.fit_percent == pytest.approx(100 * (1 - np.sqrt(fit.rss / spread)))


def test_trace_csv__reads_back_exactly():
    shown = trace(np.random.default_rng(2).normal(size=30))
    rows = list(csv.reader(io.StringIO(shown.csv_text())))
    assert rows[0] == ["t [s]", "torque [N m]", "n, filtered [rpm]", "n, filtered simulated [rpm]"]
    values = np.array(rows[1:], float).T
    np.testing.assert_array_equal(values, [shown.t, shown.u, shown.measured[0], shown.simulated[0]])
