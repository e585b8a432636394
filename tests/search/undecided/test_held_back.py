"""Effects that a search has not offered: a verdict on each at first order."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import Placed, function_set, grammar_named
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.decision import decide_structures
from brightgrey.search.detectability import Detectability
from brightgrey.search.lattice import Lattice
from brightgrey.search.undecided.held_back import first_order_verdicts, verdicts_on_masses
from brightgrey.search.verdicts import EffectVerdict, Reason
from support.searches import simulated_task

VALUES = {"J1": 0.012, "f_v": 0.004, "M_C": 0.3}


def held_back(noise, part=slice(None)):
    task = simulated_task(
        "one_mass+coulomb+viscous", VALUES, E.torque()[part], noise * E.speed, dt=E.dt, f_tanh=200.0, step=1e-3
    )
    found = decide_structures(task, grammar_named("drive"), exclude=("three_mass", "current_control", "delay"))
    return found, {card.effect: card for card in found.evidence.held_back}


@pytest.fixture(scope="module")
def clean():
    return held_back(0.002)


def test_first_order__little_noise__springs_and_directions_are_not_needed(clean):
    _, said = clean
    assert said["directional_viscous"].verdict == said["ground_spring"].verdict == "not needed"
    assert "it would have shown" in said["ground_spring"].reason


@pytest.mark.long
def test_first_order__much_noise__not_decidable():
    _, said = held_back(0.5)
    assert said["directional_viscous"].verdict == "not decidable"


def test_first_order__effects_at_masses_that_no_structure_has__no_verdict(clean):
    _, said = clean
    assert not {"coulomb@2", "ground_spring@2", "cubic_spring"} & said.keys()


def test_first_order__certificate__names_both_kinds(clean):
    found, said = clean
    certificate = found.evidence.certificate
    assert certificate.held_back == {effect: card.verdict for effect, card in said.items()}
    assert any("a spring to the ground" in s and "not needed" in s for s in certificate.sentences())


def test_first_order__requires_what_no_structure_has__verdict_of_that():
    task = simulated_task(
        "one_mass+coulomb", {"J1": 0.012, "M_C": 0.3}, E.torque(), 0.3 * E.speed, dt=E.dt, f_tanh=200.0
    )
    found = decide_structures(
        task, grammar_named("drive"), exclude=("two_mass", "current_control", "delay", "stribeck")
    )
    said = {card.effect: card.verdict for card in (*found.evidence.cards, *found.evidence.held_back)}
    assert "viscous" not in found.evidence.minimal[0].structure.names
    assert said["directional_viscous"] == said["viscous"]


def test_first_order__hardening_shaft_fits_as_well_with_other_masses__is_not_decidable():
    """A linear shaft explains this chirp with half the inertia. The derivatives there say nothing of the truth."""
    t, rate = E.dt * np.arange(E.samples), np.log(100.0) / (E.samples * E.dt)
    torque = 8.0 * np.minimum(1.0, t / 0.02) * np.sin(2.0 * np.pi * np.expm1(rate * t) / rate)  # 1 to 100 Hz
    truth = {"J1": 0.00605, "J2": 0.0141, "c1": 16.67, "d1": 0.006335, "f_v@2": 0.04677, "c_cubic": 210.3}
    task = simulated_task("two_mass+viscous@2+cubic_spring", truth, torque, 0.001 * E.speed, dt=E.dt, f_tanh=200.0)
    kit = function_set()
    own = kit.parse("two_mass+viscous@2")
    found = {"J1": 0.00306, "J2": 0.01774, "c1": 84.23, "d1": 0.02111, "f_v@2": 0.04699}
    kept = {"one_mass", *map(str, own.placed)}
    lattice = Lattice.of(kit, (), [str(p) for p in kit.whole.placed if str(p) not in kept])
    with ThreadPoolExecutor(1) as workers:
        search = BorderSearch(task, lattice, workers)
        search.fits.fit_from(own, found, workers)
        search.refined.begin_round(own)
        detectability = Detectability(search.refined, search.round, workers)
        (card,) = first_order_verdicts(detectability, [own], [Placed("cubic_spring")], [])
    assert card.verdict == "not decidable"
    assert "A fit with it is no worse" in card.reason


@pytest.mark.parametrize("verdict", ["not needed", "not decidable"])
def test_masses__larger_than_those_offered__get_the_verdict_of_the_largest(verdict):
    known = [EffectVerdict("two_mass", verdict, None, None, Reason("small gain"))]
    found = verdicts_on_masses(grammar_named("drive"), ("four_mass",), known)
    assert {c.effect: c.verdict for c in found} == {"three_mass": verdict}
    assert "a second mass is not called for" in found[0].reason


def test_masses__none_is_asked_for__none():
    assert verdicts_on_masses(grammar_named("drive"), (), []) == ()
