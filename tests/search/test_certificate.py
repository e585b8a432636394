"""The certificate of a search in words and numbers."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from brightgrey.kit import PAPER
from brightgrey.search.border import Refutation
from brightgrey.search.certificate import Certificate, RefutedStructure
from brightgrey.search.decision import _refuted
from brightgrey.search.lattice import Lattice


def refuted(*without, ratio=3.4, agreeing=3):
    return RefutedStructure(without, "one_mass", ratio, 812.3, 13.4, "one_mass", agreeing)


def certificate(*refutations, unexplained=()):
    return Certificate("paper", 1448, 31, ("two_mass+coulomb",), refutations, (), unexplained)


def test_sentences__refuted_structure__says_what_is_missing_and_how_sure_it_is():
    first, last = certificate(refuted("viscous")).sentences()
    assert first == (
        "Without viscous friction the residual is 3.4 times as large, whatever else is allowed. (Whitened sum of"
        " squares: 812 above the least one, where 13.4 are allowed; 3 independent starts agree.)"
    )
    assert last == ("31 fits decide all 1,448 structures of the function set 'paper', conditional on these optima.")


def test_sentences__budget_ended__fits_decide_all_but_what_is_open():
    found = replace(certificate(refuted("viscous")), undecided=("one_mass+coulomb",))
    *_, open_ones, last = found.sentences()
    assert open_ones == "The budget ended before these were decided. Open: one mass with Coulomb friction."
    assert last.startswith("31 fits decide all but these of the 1,448 structures")


def test_sentences__mass_is_missing__it_is_counted():
    first, _ = certificate(refuted("three_mass")).sentences()
    assert "Without a third mass the residual is" in first


def test_sentences__alternatives_and_single_start__are_in_words():
    first, _ = certificate(refuted("coulomb", "gravity", agreeing=1)).sentences()
    assert "Without Coulomb friction and a constant load the residual is" in first
    assert "1 independent start agrees.)" in first


def test_sentences__unexplained_residual__said_first():
    first, *_ = certificate(refuted("viscous"), unexplained=("it follows the position", "it is slow")).sentences()
    assert first == (
        "This recording holds something that none of the structures offered explains. It follows the position. It is"
        " slow."
    )


def test_loss__several_refutations__least_residual_without_the_effect():
    found = certificate(refuted("viscous", ratio=3.0), refuted("viscous", "gravity", ratio=1.5), refuted("delay"))
    assert found.without("viscous").ratio == 1.5
    assert found.loss("viscous") == pytest.approx(0.5)
    assert found.loss("delay") == pytest.approx(2.4)
    assert found.loss("coulomb") is None


@pytest.mark.parametrize(
    ("mask", "without"),
    [
        ("one_mass+coulomb+viscous+stribeck+gravity+current_control+delay", ("two_mass",)),
        ("two_mass+coulomb+viscous+stribeck+gravity+backlash+current_control+delay", ("three_mass",)),
        ("four_mass+coulomb+viscous+stribeck+gravity+current_control", ("backlash", "delay")),
    ],
)
def test_refuted_structure__masses_lacking__named_by_the_first_of_them(mask, without):
    """Without a second mass there is no third one, and no gap: the second mass is what is missing."""
    lattice = Lattice.of(PAPER)
    bare, best = lattice.mask(PAPER.parse(mask)), lattice.everything
    costs = {best: 4.0, bare: 9.0, lattice.required: 25.0}
    search = SimpleNamespace(lattice=lattice, fits=SimpleNamespace(agreeing={lattice.structure(bare): 2}))
    search.beside_refuted = lambda refutation, border: refutation.mask
    found = _refuted(search, None, Refutation(bare, 30.0, 13.4, bare), costs, 4.0)
    assert found.without == without
    assert found.structure == found.tried == mask
    assert found.ratio == pytest.approx(1.5)  # of the best within it, by the root of the sums of squares
    assert (found.excess, found.threshold, found.agreeing) == (30.0, 13.4, 2)
