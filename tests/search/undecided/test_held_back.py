"""Effects that a search has not offered: a verdict on each at first order."""

import pytest

from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import grammar_named
from brightgrey.search.decision import decide_structures
from brightgrey.search.undecided.held_back import verdicts_on_masses
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


@pytest.mark.parametrize("verdict", ["not needed", "not decidable"])
def test_masses__larger_than_those_offered__get_the_verdict_of_the_largest(verdict):
    known = [EffectVerdict("two_mass", verdict, None, None, Reason("small gain"))]
    found = verdicts_on_masses(grammar_named("drive"), ("four_mass",), known)
    assert {c.effect: c.verdict for c in found} == {"three_mass": verdict}
    assert "a second mass is not called for" in found[0].reason


def test_masses__none_is_asked_for__none():
    assert verdicts_on_masses(grammar_named("drive"), (), []) == ()
