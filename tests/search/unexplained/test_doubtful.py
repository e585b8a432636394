"""Effects that help in some parts of a recording only, on recordings of the reference solver with a disturbance."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from brightgrey.api.to_si import identification_task
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER
from brightgrey.search.border import Refutation, assess
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.evidence import EffectVerdict, with_model
from brightgrey.search.lattice import Lattice
from brightgrey.search.unexplained import doubtful
from brightgrey.search.unexplained.doubtful import _unknown_sizes, doubts_about
from brightgrey.search.verdicts import Reason
from brightgrey.simulation.reference import reference
from support.recordings import make_recording
from support.searches import simulated_task

TRUTH = {"J1": 0.0277, "M_C": 0.8, "f_v": 0.05}
STRUCTURE = PAPER.parse("one_mass+coulomb+viscous")
WITH_GRAVITY = PAPER.parse("one_mass+coulomb+viscous+gravity")
LATTICE = Lattice.of(PAPER.whole, exclude=("two_mass", "stribeck", "current_control", "delay"))


def searched(recording):
    """Refined fits of the eight structures of a lattice, and their border."""
    task = identification_task([recording], None, {}, {}, 100.0)
    with ThreadPoolExecutor(1) as workers:
        search = BorderSearch(task, LATTICE, workers)
        search.fits.add([LATTICE.structure(mask) for mask in LATTICE.masks()], workers)
        search.refined.begin_round(WITH_GRAVITY)
        search.refined.of_all(list(search.fits.done))
        return search.refined, LATTICE, assess(search.deviances(), search.round)


def pushed(kinds, noise, begin=0.42, end=0.47):
    """Somebody leans on the load for a part of the time; `noise` is relative to the peak of each output."""
    rng = np.random.default_rng(1)
    t = E.dt * np.arange(800)
    u = 3.0 * np.cos(2.0 * np.pi * 2.5 * t) + 1.5 * np.sin(2.0 * np.pi * 0.9 * t)
    push = 0.8 * ((t > begin * t[-1]) & (t < end * t[-1]))
    y = reference(str(STRUCTURE), TRUTH, u + push, E.dt, f_tanh=100.0, outputs=kinds)
    y = y + np.array(noise)[:, None] * np.abs(y).max(axis=1, keepdims=True) * rng.standard_normal(y.shape)
    return make_recording(u, y, dt=E.dt, kind=kinds)


@pytest.fixture(scope="module")
def long_push():
    """The load that it is taken for has a known size, and helps in five of eight parts."""
    *search, border = searched(pushed(("velocity",), (0.003,), begin=0.5, end=0.9))
    without = LATTICE.mask(STRUCTURE)
    return *search, replace(border, refuted=(Refutation(without, 40.0, 10.0, without),))


def test_doubts_about__helps_in_few_parts__model_lacks_it_and_there_is_a_reservation(long_push):
    """Viscous friction is at its lower bound, and goes first."""
    doubts = doubts_about(*long_push, [WITH_GRAVITY])
    assert doubts.found == (WITH_GRAVITY,)
    assert str(doubts.model) == "one_mass+coulomb"
    assert doubts.reasons["gravity"] == "unsteady gain"
    assert "coulomb" not in doubts.reasons


def test_doubts_about__other_reservations__stay(long_push):
    doubts = doubts_about(*long_push, [WITH_GRAVITY], {"coulomb": "unconfirmed", "gravity": "unconfirmed"})
    assert (doubts.reasons["coulomb"], doubts.reasons["gravity"]) == ("unconfirmed", "unsteady gain")


def test_doubts_about__another_minimal_structure_is_steady__it_comes_first(long_push):
    doubts = doubts_about(*long_push, [WITH_GRAVITY, STRUCTURE])
    assert doubts.found == (STRUCTURE, WITH_GRAVITY)
    assert str(doubts.model) == "one_mass+coulomb"


def test_doubts_about__size_may_be_zero__model_lacks_it_and_there_is_a_reservation():
    doubts = doubts_about(*searched(pushed(("velocity",), (0.003,))), [WITH_GRAVITY])
    assert doubts.model == STRUCTURE
    assert doubts.reasons["gravity"] == "unknown size"
    assert not {"coulomb", "viscous"} & doubts.reasons.keys()


def test_doubts_about__two_sensors__parts_are_parts_of_time():
    """The friction shows in a precise position only, and there all the time."""
    *search, border = searched(pushed(("position", "velocity"), (1e-4, 1.0)))
    assert {LATTICE.lacking(r.mask) for r in border.refuted} == {("coulomb",), ("viscous",)}
    doubts = doubts_about(*search, border, [STRUCTURE])
    assert doubts.model == STRUCTURE
    assert "unsteady gain" not in doubts.reasons.values()


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (STRUCTURE, "No structure without it fits. The model leaves it out."),
        (WITH_GRAVITY, "No structure without it fits."),
    ],
)
def test_with_model__effect_that_the_model_lacks__is_said(model, said):
    card = EffectVerdict("gravity", "not decidable", None, None, Reason("indispensable"))
    assert with_model(card, WITH_GRAVITY, model).reason == said


def refined_of(structure, values, *others, fixed=None, bounds=None):
    """Refined fits of a lattice with the effects of a drive, and `others`, on a recording of it; and the lattice."""
    u, names = E.torque()[:900], {*structure.split("+"), *others}
    lattice = Lattice.of(PAPER, (), [e for e in PAPER.places if e not in names | {"one_mass"}])
    task = simulated_task(structure, values, u, 0.005 * E.speed, dt=E.dt, f_tanh=200.0)
    task = replace(task, fixed=fixed or {}, bounds=bounds or {})
    with ThreadPoolExecutor(1) as workers:
        search = BorderSearch(task, lattice, workers)
        search.fits.add([lattice.structure(mask) for mask in lattice.masks()], workers)
        search.refined.begin_round(PAPER.parse(structure))
        search.refined.of_all(list(search.fits.done))
        return search.refined, lattice


LIGHT = {"J1": 0.02, "J2": 0.004, "c1": 20.0, "M_C": 0.3}


def test_unknown_sizes__shaft_without_damping__the_mass_is_known():
    """Its inertia and its spring constant are, and no damping is at a bound or nearly so."""
    refined, lattice = refined_of("two_mass+coulomb", {**LIGHT, "d1": 1e-5})
    assert _unknown_sizes(refined, lattice, PAPER.parse("two_mass+coulomb")) == {}


def test_without_doubtful__mass_and_gap_are_not_known__the_gap_goes_first(monkeypatch):
    """Without the gap the mass is known."""
    refined, lattice = refined_of("two_mass+coulomb", {**LIGHT, "d1": 0.02}, "backlash")
    unknown = {True: {"two_mass": 0.0, "backlash": 0.1}, False: {}}
    monkeypatch.setattr(doubtful, "_unknown_sizes", lambda refined, lattice, s: unknown["backlash" in s.names])
    model, left_out = doubtful._without_doubtful(refined, lattice, PAPER.parse("two_mass+coulomb+backlash"), ())
    assert str(model) == "two_mass+coulomb"
    assert left_out == {"backlash": "unknown size"}


def test_unknown_sizes__size_is_fixed__is_known():
    refined, lattice = refined_of("one_mass+coulomb+gravity", {"J1": 0.024, "M_C": 0.3, "M_G": 0.1}, fixed={"M_G": 0.0})
    assert "gravity" not in _unknown_sizes(refined, lattice, PAPER.parse("one_mass+coulomb+gravity"))


def test_unknown_sizes__at_a_bound_of_the_user__is_known():
    values, bounds = {"J1": 0.024, "M_C": 0.3}, {"M_C": (0.01, 0.2)}
    refined, lattice = refined_of("one_mass+coulomb", values, bounds=bounds)
    own = PAPER.parse("one_mass+coulomb")
    assert refined.of(own).at_bound == ("M_C",)
    assert _unknown_sizes(refined, lattice, own) == {}
