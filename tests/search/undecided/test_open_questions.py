"""Questions that a search leaves open: their truths, and the largest structures that lack an effect."""

import numpy as np
import pytest

from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER, Structure
from brightgrey.search.decision import decide_structures
from support.searches import simulated_task

TRUTH = {"J1": 0.015, "M_C": 0.3, "M_G": -0.9}
TORQUE = 1.2 + 0.8 * np.sin(2.0 * np.pi * 3.0 * E.dt * np.arange(E.samples))  # the drive never turns back


@pytest.fixture(scope="module")
def coulomb():
    """Questions for Coulomb friction, which gravity can take the part of where nothing reverses."""
    task = simulated_task("one_mass+coulomb+gravity", TRUTH, TORQUE, 0.2, dt=E.dt, f_tanh=200.0, step=1e-3)
    found = decide_structures(task, PAPER, exclude=("two_mass", "current_control", "delay"))
    said = {card.effect: card.verdict for card in found.evidence.cards}
    assert said["coulomb"] == "not decidable"
    assert said["viscous"] == "not needed"  # so it is no question, and yet it may stand beside another effect
    return [q for q in found.evidence.questions.questions if q.effects == ("coulomb",)]


def test_size_questions__least_size_and_largest_one_that_fits__all_else_is_fitted_beside_them(coulomb):
    least, most = coulomb
    assert least.values["M_C"] == pytest.approx(0.01 * np.abs(TORQUE).max())
    assert 4.0 * least.values["M_C"] <= most.values["M_C"] < 1.2  # without gravity it would be 1.2 N m
    for question in coulomb:
        assert question.values["M_G"] - question.values["M_C"] == pytest.approx(question.rival.values["M_G"], abs=0.02)
        assert question.deviance < question.critical


def test_largest_rival__has_all_effects_but_the_one_in_question__whatever_was_not_needed(coulomb):
    (largest,) = coulomb[0].largest
    assert Structure.parse(largest.known.structure) == Structure.parse("one_mass+viscous+stribeck+gravity")
    assert len(largest.gradients[0]) == len(largest.known.names)
    (of_truth, both), (same, of_rival) = largest.deviances
    assert both == pytest.approx(same)
    assert both**2 <= of_truth * of_rival * (1.0 + 1e-9)
