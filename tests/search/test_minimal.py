"""Which structures are minimal, by costs made by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from brightgrey.kit import PAPER
from brightgrey.search.comparison import Judged
from brightgrey.search.structure_fit import StructureFit
from brightgrey.search.judging import Bench
from brightgrey.search.lattice import complexity, contains, mass_chain_of
from brightgrey.search.minimal import minimal_structures
from brightgrey.search.yardstick import Yardstick

ALL = list(PAPER.structures())
SAMPLES = 1200
NOISE = 1000.0  # sum of squares


class Known(Bench):
    """Costs of refits are known, and those that a second one from the optimum of a larger structure brings."""

    def __init__(self, costs, fitted, second, everywhere):
        super().__init__(None, fitted, None)
        self.costs, self.second, self.everywhere, self.succeeds = costs, second, everywhere, 1

    def made(self, structure, cost):
        return Judged(structure, {}, SimpleNamespace(cost=cost), complexity(structure), ())

    def held(self, structure, values, moved, held, rival):
        return lambda: self.made(structure, self.costs[tuple(held.items())])

    def judge_all(self, structures):
        for s in structures:
            self.judged.setdefault(s, self.made(s, self.costs[s]))
        return [self.judged[s] for s in structures]

    def seek(self, structure, fields):
        self.sought[structure] = self.sought.get(structure, 0) + fields
        self.vain += fields
        found = self.everywhere.get(structure, np.inf)
        if self.sought[structure] < self.succeeds or self.judged[structure].cost <= found:
            return False
        self.judged[structure], self.vain = self.made(structure, found), 0
        return True

    def improve(self, structure):
        own = self.judged[structure].cost
        larger = [j for s, j in self.judged.items() if s != structure and contains(s, structure) and j.cost < own]
        if larger and structure in self.second:
            self.judged[structure] = self.made(structure, self.second[structure])
        return bool(larger) and self.judged[structure].cost < own


def many(structure):
    """Number of independent samples in what any structure leaves."""
    return 300.0


class Costs(Yardstick):
    """Yardstick of residuals that are white, so that their sums of squares are all there is to compare."""

    def __init__(self, costs, *, fast=None, second=(), everywhere=(), doubt=0.0, white=(), few=many, loose=()):
        fitted = {s: StructureFit(s, {}, (fast or costs)[s], complexity(s)) for s in ALL}
        second, everywhere = ({PAPER.parse(name): c for name, c in dict(more).items()} for more in (second, everywhere))
        super().__init__(Known(costs, fitted, second, everywhere), SimpleNamespace(samples=SAMPLES), fitted)
        self.trust, self.white = doubt, {PAPER.parse(name): cost for name, cost in dict(white).items()}
        self.few, self.loose = few, loose

    @property
    def doubt(self):
        return self.trust

    @property
    def independent(self):
        return 300.0

    def independent_in(self, judged):
        return self.few(judged.structure)

    def follows_drifts(self, big, small):
        return mass_chain_of(big.structure).name in self.loose

    def left(self, judged):
        return max(judged.cost, self.trust)

    def misfit(self, judged):
        return self.white.get(judged.structure, self.left(judged))

    def minimal(self):
        examined = []
        return [str(j.structure) for j in minimal_structures(self, examined.append)], examined


def costs(least, otherwise):
    """The least cost of what a structure contains, by name."""
    return {s: min([c for name, c in least.items() if contains(s, PAPER.parse(name))], default=otherwise) for s in ALL}


def ratio(by):
    """Sum of squares whose twice the log-likelihood ratio over the noise's is `by`."""
    return NOISE * float(np.exp(by / SAMPLES))


def test_minimal__two_adequate_structures__both():
    least = {"one_mass+coulomb": NOISE, "one_mass+viscous+delay": 0.995 * NOISE}
    found, _ = Costs(costs(least, 5.0 * NOISE)).minimal()
    assert sorted(found) == sorted(least)


def test_minimal__submodel_rejected__supermodel_may_be_minimal():
    """Another one drives it out, but not what has one effect more."""
    least = {"one_mass+coulomb": ratio(0.0), "one_mass+coulomb+gravity": ratio(-8.0)}
    least["one_mass+viscous+delay"] = ratio(-19.0)
    found, _ = Costs(costs(least, ratio(100.0))).minimal()
    assert sorted(found) == ["one_mass+coulomb+gravity", "one_mass+viscous+delay"]


def test_minimal__several_accepted__each_can_reject():
    """What is left of one is less, but of another it is whiter."""
    white = {"one_mass+coulomb": 1.0, "one_mass+viscous": 0.6, "one_mass+gravity": 1.0}
    rms = {"one_mass+coulomb": 1.0, "one_mass+viscous": 1.015, "one_mass+gravity": 1.03}
    yardstick = Costs(
        {s: NOISE * rms.get(str(s), 1.5) for s in ALL}, white={str(s): NOISE * white.get(str(s), 1.5) for s in ALL}
    )
    found, _ = yardstick.minimal()
    assert sorted(found) == ["one_mass+coulomb", "one_mass+viscous"]


def test_minimal__refitted_submodel__is_examined():
    """Its refit has ended too high, and what has one effect more would pull it down; the search knew it no better."""
    least = {"one_mass+current_control": 0.9, "one_mass+coulomb": 2.6}
    yardstick = Costs(costs(least, 5.0), fast=dict.fromkeys(ALL, 5.0), second={"one_mass+coulomb": 0.9}, doubt=1.0)
    found, examined = yardstick.minimal()
    assert sorted(found) == sorted(least)
    assert str(examined[0]) == "one_mass"


def test_minimal__difference_within_error_floor__is_examined():
    truth = PAPER.parse("one_mass+coulomb")
    known = {s: 1.0 if contains(s, truth) else 5.0 for s in ALL}
    found, examined = Costs(known, doubt=1.0).minimal()
    assert found == ["one_mass+coulomb"]
    assert examined[0] == truth
    assert len(examined) > 1


def test_minimal__equal_within_error_floor__smaller_first():
    """Of two that leave no more than its error the smaller is the more hopeful."""
    truth, small = PAPER.parse("two_mass+coulomb"), PAPER.parse("one_mass+viscous")
    known = {s: 1.0 if contains(s, truth) else 5.0 for s in ALL} | {small: 1.1}
    _, examined = Costs(known, doubt=1.0).minimal()
    assert examined[0] == small


def test_minimal__improved_refit__is_used():
    """One that another accepted structure has led to meanwhile."""
    least = {"one_mass+coulomb": ratio(40.0), "one_mass+coulomb+gravity": ratio(0.0)}
    yardstick = Costs(costs(least, ratio(200.0)), second={"one_mass+coulomb": ratio(1.0)})
    (found,) = minimal_structures(yardstick, None)
    assert str(found.structure) == "one_mass+coulomb"
    assert found.cost == pytest.approx(ratio(1.0))


def test_minimal__redundant_effects__submodels_are_examined():
    """None of them was hopeful: the search has left them far away."""
    least = {"one_mass+coulomb+gravity": ratio(0.0)}
    second = {"one_mass+coulomb": ratio(1.0), "one_mass": ratio(2.0)}
    found, examined = Costs(costs(least, 5.0 * NOISE), second=second).minimal()
    assert found == ["one_mass"]
    assert [str(s) for s in examined] == ["one_mass+coulomb+gravity"]


def test_minimal__further_mass__smaller_structure_is_restarted_first():
    """A light mass between two others is found from there, not from what is around."""
    least = {"four_mass+coulomb": ratio(0.0), "three_mass+coulomb": ratio(60.0)}
    known = costs(least, ratio(200.0))
    assert Costs(known).minimal()[0] == ["four_mass+coulomb"]
    yardstick = Costs(known, everywhere={"three_mass+coulomb": ratio(-1.0)})
    assert yardstick.minimal()[0] == ["three_mass+coulomb"]
    assert {str(s): n for s, n in yardstick.bench.sought.items()} == {"three_mass+coulomb": 2, "two_mass+coulomb": 2}


@pytest.mark.parametrize(("between", "found"), [(60.0, "three_mass+coulomb"), (150.0, "four_mass+coulomb")])
def test_minimal__small_difference__more_restarts(between, found):
    least = {"four_mass+coulomb": ratio(0.0), "three_mass+coulomb": ratio(between)}
    yardstick = Costs(costs(least, ratio(300.0)), everywhere={"three_mass+coulomb": ratio(-1.0)})
    yardstick.bench.succeeds = 7  # the first fields in vain
    assert yardstick.minimal()[0] == [found]
    assert yardstick.bench.sought[PAPER.parse("three_mass+coulomb")] == (8 if between < 100.0 else 2)


@pytest.mark.parametrize(("between", "found"), [(60.0, "one_mass+coulomb"), (150.0, "one_mass+coulomb+delay")])
def test_minimal__small_difference__smaller_structure_is_restarted(between, found):
    least = {"one_mass+coulomb+delay": ratio(0.0), "one_mass+coulomb": ratio(between)}
    yardstick = Costs(costs(least, ratio(300.0)), everywhere={"one_mass+coulomb": ratio(-1.0)})
    assert yardstick.minimal()[0] == [found]


@pytest.mark.parametrize(("between", "found"), [(60.0, "two_mass+backlash"), (150.0, "three_mass+backlash")])
def test_minimal__small_difference_with_hard_limit__few_restarts(between, found):
    least = {"three_mass+backlash": ratio(0.0), "two_mass+backlash": ratio(between)}
    yardstick = Costs(costs(least, ratio(300.0)), everywhere={"two_mass+backlash": ratio(-1.0)})
    assert yardstick.minimal()[0] == [found]
    yardstick = Costs(costs(least, ratio(300.0)))
    yardstick.minimal()
    assert yardstick.bench.sought == ({PAPER.parse("two_mass+backlash"): 2} if between < 100.0 else {})


def test_minimal__fruitless_restarts__limit():
    whole = "two_mass+coulomb+viscous+gravity+delay"
    smaller = [whole.replace(f"+{name}", "") for name in ("coulomb", "viscous", "gravity", "delay")]
    known = costs({whole: ratio(0.0)} | dict.fromkeys(smaller, ratio(60.0)), ratio(300.0))
    yardstick = Costs(known)
    assert yardstick.minimal()[0] == [whole]
    assert sum(yardstick.bench.sought.values()) == 16
    first, second = yardstick.bench.sought
    for place in (first, second):  # what has helped once may help again
        yardstick = Costs(known, everywhere={str(place): ratio(50.0)})
        yardstick.minimal()
        assert sum(yardstick.bench.sought.values()) > 16


def test_minimal__late_better_supermodel__structure_removed():
    """One that contains it has come to fit better after it was asked."""
    small, big, more = ("one_mass+coulomb", "one_mass+coulomb+gravity", "one_mass+coulomb+gravity+delay")
    late = costs({small: ratio(0.0), big: ratio(-13.0), more: ratio(-13.2)}, ratio(200.0))
    fast = {s: ratio(70.0 if contains(s, PAPER.parse(small)) else 300.0) for s in ALL}
    fast |= {PAPER.parse(small): ratio(40.0), PAPER.parse(more): ratio(-13.2)}
    assert Costs(late).minimal()[0] == [big]
    yardstick = Costs(late | {PAPER.parse(big): ratio(0.0)}, fast=fast, second={big: ratio(-13.0)})
    found, _ = yardstick.minimal()
    assert found == [big]


def test_minimal__late_refit_of_larger_structure__rejects():
    """No single effect helps, two together do, and the search has not found that."""
    least = {"one_mass+coulomb": ratio(0.0), "one_mass+gravity+delay": ratio(2.0)}
    late = costs(least | {"one_mass+coulomb+gravity+delay": ratio(-40.0)}, ratio(200.0))
    assert Costs(late).minimal()[0] == ["one_mass+coulomb+gravity+delay"]
    found, _ = Costs(late, fast=costs(least, ratio(200.0))).minimal()
    assert found == ["one_mass+coulomb+gravity+delay"]


def test_minimal__best_of_many_supermodels__bonferroni_corrected():
    """Twice the log-likelihood ratio of two effects is 16: more than chance brings to one of ten, not of hundreds."""
    less, more = "one_mass+coulomb", "one_mass+coulomb+gravity+delay"
    known = {s: ratio(200.0) for s in ALL} | {s: ratio(0.0) for s in ALL if contains(s, PAPER.parse(less))}
    for by, wanted in ((16.0, less), (40.0, more)):
        far = {s: ratio(-by) for s in ALL if contains(s, PAPER.parse(more))}
        assert Costs(known | far).minimal()[0] == [wanted]


class Asked(Costs):
    """Both signs of gravity are asked; small changes would show, and no fit has it as large."""

    def least(self, structure, effect):
        return [{"M_G": 1.0}, {"M_G": -1.0}]

    def hidden(self, structure, effect, least):
        return None

    def fits_as_large(self, structure, effect):
        return False


@pytest.mark.parametrize(("plus", "minus"), [(20.0, 20.0), (20.0, 1.0), (1.0, 20.0)])
def test_refutation__both_signs__all_fits_have_to_be_worse(plus, minus):
    structure = PAPER.parse("one_mass+coulomb")
    held = {(("M_G", 1.0),): ratio(plus), (("M_G", -1.0),): ratio(minus)}
    yardstick = Asked(costs({str(structure): ratio(0.0)}, ratio(200.0)) | held)
    yardstick.bench.task = SimpleNamespace(default_start=lambda s: {})
    assert yardstick.refutation(structure, "gravity")() == (min(plus, minus) > 6.0)


def test_is_detectable__further_mass__needs_larger_change():
    """It has three parameters, and a tenth of the level: power of 80 % takes a squared size of 24.4 instead of 14.3."""
    structure = PAPER.parse("one_mass+coulomb")
    yardstick = Costs(costs({str(structure): ratio(0.0)}, ratio(200.0)))
    yardstick.known = {s: replace(f, free=len(s.parameters)) for s, f in yardstick.known.items()}
    assert not yardstick.visible(structure, "two_mass", 22.0)
    assert yardstick.visible(structure, "gravity", 22.0)


def test_minimal__late_rejection__supermodels_are_examined():
    """By what a second refit has led to."""
    least = {"one_mass+coulomb": ratio(0.0), "one_mass+coulomb+gravity": ratio(-8.0)}
    least["one_mass+viscous+delay"] = ratio(-19.0)
    known, late = costs(least, ratio(100.0)), PAPER.parse("one_mass+viscous+delay")
    yardstick = Costs(known | {late: ratio(5.0)}, fast=known, second={str(late): ratio(-19.0)})
    found, _ = yardstick.minimal()
    assert sorted(found) == ["one_mass+coulomb+gravity", "one_mass+viscous+delay"]


@pytest.mark.parametrize(("more", "by_chance"), [("one_mass+coulomb+viscous", False), ("two_mass+coulomb", True)])
def test_minimal__further_mass__needs_stronger_evidence(more, by_chance):
    """Its resonance may be anywhere; a log-likelihood ratio whose double is 12.5 is not enough."""
    less = "one_mass+coulomb"
    found, _ = Costs(costs({less: ratio(0.0), more: ratio(-12.5)}, ratio(200.0))).minimal()
    assert found == [less if by_chance else more]


@pytest.mark.parametrize(
    ("more", "own", "other", "loose", "called"),
    [
        ("two_mass+coulomb+viscous", 20.0, 20.0, (), True),  # it follows no drift
        ("two_mass+coulomb+backlash", 20.0, 300.0, (), False),
        ("two_mass+coulomb+backlash", 300.0, 20.0, (), True),
        ("two_mass+coulomb+backlash", 300.0, 20.0, ("two_mass", "three_mass", "four_mass"), False),
        ("three_mass+coulomb", 20.0, 300.0, (), False),
        ("three_mass+coulomb", 300.0, 20.0, (), True),
        ("three_mass+coulomb", 300.0, 20.0, ("three_mass", "four_mass"), False),
        ("three_mass+coulomb", 300.0, 300.0, ("three_mass", "four_mass"), True),
    ],
)
def test_rejects__absorbs_drift__f_test_with_fewer_samples(more, own, other, loose, called):
    """In those that are independent in what it leaves; if it hangs loose, also in what is left without it."""
    less = "two_mass+coulomb"
    known = costs({less: ratio(0.0), more: ratio(-60.0)}, ratio(5000.0))
    yardstick = Costs(known, few=lambda s: other if str(s) == less else own, loose=loose)
    assert yardstick.minimal()[0] == [more if called else less]


@pytest.mark.parametrize("best", [None, "two_mass+coulomb+delay"])
def test_minimal__mass_absorbs_drift__alternative_effect_is_examined(best):
    """It is far behind, and no search would call it hopeful; but that mass follows a drift, unlike what is best."""
    least = {"two_mass+coulomb": ratio(0.0), "one_mass+coulomb+viscous": ratio(1500.0), "one_mass+coulomb": ratio(2e3)}
    yardstick = Costs(
        costs(least, ratio(5000.0)) | ({PAPER.parse(best): ratio(-3.0)} if best else {}),
        few=lambda s: 5.0 if s.masses == 1 else 300.0,
    )
    yardstick.follows_drifts = lambda big, small: str(big.structure) != best
    assert sorted(yardstick.minimal()[0]) == ["one_mass+coulomb+viscous", "two_mass+coulomb"]


def test_minimal__best_of_many_unrelated__both_kept():
    """Twice the log-likelihood ratio is 14 more, which one comparison among hundreds may bring.

    What has both effects would be better than one of them for sure; it was not found here.
    """
    least = {"one_mass+coulomb": ratio(0.0), "one_mass+viscous": ratio(14.0)}
    one, other = (PAPER.parse(name) for name in least)
    known = costs(least, ratio(200.0))
    found, _ = Costs(known | {s: ratio(14.0) for s in ALL if contains(s, one) and contains(s, other)}).minimal()
    assert sorted(found) == sorted(least)


def test_minimal__several__best_criterion_first():
    """That of whitened residuals; what is left of them without that is more."""
    least = {"one_mass+coulomb+gravity": ratio(0.0), "one_mass+delay": ratio(3.0), "one_mass+viscous": ratio(1.0)}
    found, _ = Costs(costs(least, 5.0 * NOISE), white={"one_mass+delay": ratio(0.5)}).minimal()
    assert found == ["one_mass+delay", "one_mass+viscous", "one_mass+coulomb+gravity"]


def test_minimal__many_candidates__max_examined():
    """All fit alike, and none contains another but the largest, which contains all."""
    alike = [s for s in ALL if complexity(s) == 5]
    known = {s: NOISE if s in alike else 5.0 * NOISE for s in ALL}
    found, examined = Costs(known).minimal()
    assert len(alike) > len(examined) == 24
    assert found
