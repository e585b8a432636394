"""What a search hands on of structures that it cannot tell apart: the public result and the terminal."""

import csv
from pathlib import Path

import numpy as np
import pytest

from brightgrey import identify
from brightgrey.cli.terminal.results import result as show
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

DT, F_TANH = 0.002, 5.0
VALUES = {"J1": 0.02, "M_C": 0.4, "f_v": 0.03}


@pytest.fixture(scope="module")
def found():
    """The speed never turns: Coulomb friction and a constant torque look the same."""
    t = DT * np.arange(700)
    u = 2.0 * np.minimum(1.0, 10.0 * t) + 1.2 * np.sin(2.0 * np.pi * 3.0 * t) * (t > 0.4)
    (v,) = reference("one_mass+coulomb+viscous", VALUES, u, DT, f_tanh=F_TANH)
    y = v + 0.1 * np.random.default_rng(1).normal(size=v.size)
    recording = make_recording(u[200:], y[200:], dt=DT, unit="rpm")
    few = ("two_mass", "current_control", "delay", "stribeck")
    return identify(recording, search="exhaustive", exclude=few, f_tanh=F_TANH)


def test_ties_say_what_differs_for_control(found):
    structures = [d.structure for d in found.differences]
    least = [d.structure for d in found.differences if d.minimal]
    assert len(least) == len(found.evidence.minimal) > 1
    assert structures[0] == found.model.structure
    assert len({tuple(name for name, _ in d.rows) for d in found.differences}) == 1
    first, *_ = found.differences
    assert (first.figures.gain_difference, first.figures.phase_difference) == pytest.approx((0.0, 0.0), abs=1e-9)
    by_name = {str(d.structure): dict(d.rows) for d in found.differences}
    friction = by_name["one_mass+coulomb+viscous"]["friction at standstill"]
    assert friction.endswith(" N m")
    assert float(friction.split()[0]) == pytest.approx(0.4, rel=0.1)
    constant = by_name["one_mass+viscous+gravity"]
    assert float(constant["friction at standstill"].split()[0]) < 0.05
    assert float(constant["constant part of the input"].split()[0]) == pytest.approx(0.4, rel=0.1)


def test_front_is_part_of_the_ranking_and_of_its_file(found, tmp_path):
    assert set(found.front) <= set(found.ranking)
    counts = [row.n_parameters for row in found.front]
    errors = [row.rss for row in found.front]
    by_name = {row.structure: row for row in found.ranking}
    # Estimated with the speed at the first sample, and ranked with it.
    assert by_name["one_mass+coulomb+viscous"].rss == pytest.approx(by_name["one_mass+viscous+gravity"].rss, rel=0.01)
    assert counts == sorted(set(counts))
    assert errors == sorted(errors, reverse=True)
    found.write(tmp_path)
    with (tmp_path / "ranking.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(found.ranking) == 8
    assert {r["structure"] for r in rows if r["front"] == "true"} == {r.structure for r in found.front}


def test_terminal_shows_ties_and_front(found, capsys):
    show(found, Path("out"), quiet=False, json=False, verbose=True)
    printed = capsys.readouterr().out
    assert "friction at standstill" in printed
    assert "front" in printed
    for symptom in found.symptoms:
        assert symptom.title in printed
