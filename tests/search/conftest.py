"""Trees without recordings, and an estimator that knows the answer at once; and short recordings of real drives."""

import numpy as np
import pytest

from brightgrey.estimation import scales
from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER
from brightgrey.search import IdentificationTask, Misfit
from brightgrey.search.genetic import Evaluated
from brightgrey.search.genetic.rules import Rules
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

TRUTH = "two_mass+coulomb+viscous+stribeck"


def draw_unit(placed, rng):
    return tuple((q.symbol, float(rng.random())) for q in placed.effect.parameters)


def distance(structure):
    """How far a structure is from the truth: effects and masses that differ."""
    truth = PAPER.parse(TRUTH)
    apart = {p for p in structure.placed if not p.effect.masses} ^ {p for p in truth.placed if not p.effect.masses}
    return len(apart) + abs(structure.masses - truth.masses)


def know(structure, starts):
    """RSS by distance; the estimate is the start, halved, so that starts change from generation to generation."""
    rss = 1.0 + distance(structure)
    return [
        Evaluated(
            tuple((n, 0.5 * v) for n, v in start),
            Misfit((rss,), (1e-3,), 100, (100.0,)),
            len(start),
            SimulationCount(10, 1000),
        )
        for start in starts
    ]


@pytest.fixture(scope="session")
def rules():
    return Rules(PAPER)


@pytest.fixture(scope="session")
def draw():
    return draw_unit


@pytest.fixture(scope="session")
def estimate():
    return know


@pytest.fixture
def rng():
    return np.random.default_rng(7)


@pytest.fixture(scope="session")
def true_values():
    """Parameters of the drive of `task`, a two_mass+coulomb."""
    return {"J1": 0.012, "J2": 0.008, "c1": 40.0, "d1": 0.05, "M_C": 0.5}


@pytest.fixture(scope="session")
def task(true_values):
    """Half a second of that drive, with noise."""
    t = 0.001 * np.arange(500)
    torque = 4.0 * np.sign(np.sin(2.0 * np.pi * 5.0 * t)) * np.minimum(1.0, 20.0 * t)
    (v,) = reference("two_mass+coulomb", true_values, torque, 0.001, f_tanh=4.0)
    v = v + 0.05 * np.random.default_rng(2).normal(size=t.size)
    recording = make_recording(torque, v)
    known = scales(recording)
    return IdentificationTask((recording,), known, Settings(f_tanh=4.0, speed_scale=known.speed, level="fast"))


def rattling(noise, part=1):
    """A drive whose gap is passed all the time, so that without it nothing is alike; and its values.

    `noise` is in parts of the largest speed; the experiment takes one `part` of its time.
    """
    truth = {"J1": 7.56e-3, "J2": 8.01e-3, "c1": 52.9, "d1": 0.0203, "alpha": 0.137, "T_d": 7.42e-3}
    e, rng = PAPER_EXPERIMENT, np.random.default_rng(8)
    k, t = np.arange(1, 60 // part + 1), e.dt * np.arange(e.samples // part)
    phase = rng.uniform(0.0, 2.0 * np.pi, k.size)
    u = np.sum(np.sin(2.0 * np.pi * k[:, None] * t / t[-1] + phase[:, None]) / np.sqrt(k)[:, None], axis=0)
    u *= np.minimum(1.0, t / 0.02) * 10.0 / np.abs(u).max()
    (v,) = reference("two_mass+backlash+delay", truth, u, e.dt, f_tanh=e.f_tanh)
    v += noise * np.abs(v).max() * rng.standard_normal(v.size)
    r = make_recording(u, v, dt=e.dt, names=("torque", "velocity"), name="loose")
    known = scales([r])
    return IdentificationTask((r,), known, Settings(f_tanh=e.f_tanh, speed_scale=known.speed, level="fast")), truth


@pytest.fixture(scope="module")
def loose():
    """With hardly any noise."""
    return rattling(1e-3)


@pytest.fixture(scope="module")
def briefly_loose():
    """With hardly any noise, for a third of the time."""
    return rattling(1e-3, 3)


@pytest.fixture(scope="module")
def exact_loose():
    """Without noise."""
    return rattling(0.0)
