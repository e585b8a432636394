"""A survey of a few structures: candidates, ranking, and that threads change nothing."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from brightgrey.errors import SettingsError
from brightgrey.estimation.problem.scales import scales
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER, Structure
from brightgrey.recordings import Recording, Signal
from brightgrey.search.exhaustive import candidates, search_exhaustively
from brightgrey.search.lattice import contains
from brightgrey.search.task import IdentificationTask
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference

TRUTH = "one_mass+coulomb+viscous"
VALUES = {"J1": 0.02, "M_C": 1.0, "f_v": 0.02}


@pytest.fixture(scope="module")
def task():
    u = E.torque()[:900]
    y = reference(TRUTH, VALUES, u, E.dt, f_tanh=E.f_tanh)
    noise = 1e-3 * np.abs(y).max()
    measured = y + noise * np.random.default_rng(5).standard_normal(y.shape)
    recording = Recording(
        name="drive.csv",
        t=E.dt * np.arange(len(u)),
        u=u,
        y=np.round(measured / 1e-2) * 1e-2,
        input=Signal("torque", "input", "N m"),
        outputs=(Signal("velocity", "velocity", "rad/s"),),
        hold="linear",
        notes=(),
        resolution=np.array([1e-2]),
    )
    known = scales([recording])
    return IdentificationTask((recording,), known, Settings(E.f_tanh, known.speed, "fast"))


def test_candidates_count_masses_cumulatively():
    assert len(candidates()) == 448
    two = candidates(require=("two_mass",), exclude=("three_mass", "backlash"))
    assert two
    assert all(s.masses == 2 and "backlash" not in s.names for s in two)
    assert all(s.masses <= 2 for s in candidates(exclude=("three_mass",)))


def test_candidates__unknown_effect__refused_with_suggestion():
    with pytest.raises(SettingsError, match="Did you mean 'coulomb'"):
        candidates(require=("colomb",))
    with pytest.raises(SettingsError, match="one mass at least"):
        candidates(exclude=("one_mass",))
    with pytest.raises(SettingsError, match=r"^'coulomb' is both required and excluded$"):
        candidates(require=("coulomb",), exclude=("coulomb",))
    with pytest.raises(SettingsError, match=r"^no structure has three_mass and lacks two_mass$"):
        candidates(require=("three_mass",), exclude=("two_mass",))


def test_search_exhaustively__any_number_of_threads__finds_truth(task):
    few = [s for s in candidates(exclude=("two_mass", "current_control", "delay")) if s.masses == 1]
    with ThreadPoolExecutor(2) as pool:
        found = search_exhaustively(task, few, executor=pool)
    again = search_exhaustively(task, few)
    assert [(r.structure, r.misfit, r.criterion, r.equivalent) for r in found.ranking] == [
        (r.structure, r.misfit, r.criterion, r.equivalent) for r in again.ranking
    ]
    assert len(found.ranking) == len(few)
    assert str(found.best.structure) == TRUTH
    assert found.ranking[0].structure == found.best.structure
    verdicts = {card.effect: card.verdict for card in found.evidence.cards}
    assert verdicts["coulomb"] == verdicts["viscous"] == "needed"
    for big in few:
        for small in few:
            if contains(big, small):
                assert found.fitted[big].cost <= 1.001 * found.fitted[small].cost
    for name, value in VALUES.items():
        assert found.best.values[name] == pytest.approx(value, rel=0.02)


def test_search_exhaustively__single_structure__ranked_alone(task):
    found = search_exhaustively(task, [Structure.parse(TRUTH)])
    assert [str(r.structure) for r in found.ranking] == [TRUTH]
    assert found.evidence.optional == ()
    assert PAPER.broken_rule(found.best.structure) is None
