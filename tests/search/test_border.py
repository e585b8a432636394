"""The border of the adequate structures, on tables made by hand and on random ones; no simulation is needed."""

from hypothesis import given, settings
from hypothesis import strategies as st

from brightgrey.kit import PAPER
from brightgrey.search.adequacy import Deviance, Round
from brightgrey.search.border import assess, inclusion_minimal, largest_avoiding
from brightgrey.search.fitting.anchors import largest_by_masses
from brightgrey.search.lattice import Lattice

WHOLE = Lattice.of(PAPER)
SMALL = Lattice.of(PAPER, exclude=("three_mass", "stribeck", "current_control"))
REQUIRED = Lattice.of(PAPER, require=("two_mass",), exclude=("four_mass", "stribeck", "current_control", "delay"))
LATTICES = (WHOLE, SMALL, REQUIRED)
ALWAYS = 60.0  # error floor beyond any quantile, so that all structures have one threshold


def mask(text, lattice=SMALL):
    return lattice.mask(PAPER.parse(text))


def circumstances(lattice=SMALL, floor=ALWAYS):
    return Round(lattice, 1, {s.masses: 1 + lattice.mask(s).bit_count() for s in largest_by_masses(lattice)}, floor)


def table(costs, lattice=SMALL):
    """Deviances by names of structures, one parameter for each atom."""
    masks = {mask(text, lattice): cost for text, cost in costs.items()}
    return {m: Deviance(cost, 1 + m.bit_count(), lattice.structure(m).masses) for m, cost in masks.items()}


TOP = "two_mass+coulomb+viscous+gravity+backlash+delay"


def test_assess__single_fit__is_minimal_and_the_rest_undecided():
    border = assess(table({TOP: 100.0}), circumstances())
    assert border.minimal == (border.best,) == (mask(TOP),)
    assert not border.refuted
    assert {str(SMALL.structure(m)) for m in border.undecided} == {
        TOP.replace(f"+{e}", "") for e in ("coulomb", "viscous", "gravity", "backlash", "delay")
    }


def test_assess__larger_structure_with_worse_fit__has_what_it_contains():
    """A fit that has missed its optimum does not refute: what it contains shows what it could do."""
    costs = {TOP: 100.0, "one_mass+coulomb": 110.0, "two_mass+coulomb+delay": 900.0}
    border = assess(table(costs), circumstances())
    assert border.excess[mask("two_mass+coulomb+delay")] == 10.0
    assert border.minimal == (mask("one_mass+coulomb"),)
    assert mask("two_mass+coulomb+delay") in border.adequate


def test_assess__border_known__refutations_and_nothing_undecided():
    costs = {TOP: 100.0, "one_mass+coulomb+viscous": 103.0}
    costs |= {TOP.replace("+coulomb", ""): 400.0, TOP.replace("+viscous", ""): 250.0}
    border = assess(table(costs), circumstances())
    assert border.minimal == (mask("one_mass+coulomb+viscous"),)
    assert not border.undecided
    assert {(str(SMALL.structure(r.mask)), r.excess, r.threshold) for r in border.refuted} == {
        (TOP.replace("+coulomb", ""), 300.0, ALWAYS),
        (TOP.replace("+viscous", ""), 150.0, ALWAYS),
    }


def test_assess__alternatives__both_minimal_and_their_common_lack_is_refuted():
    """Coulomb friction and gravity cancel: either explains the recording, and what lacks both does not."""
    costs = {TOP: 100.0, "one_mass+coulomb": 101.0, "one_mass+gravity": 102.0}
    costs["two_mass+viscous+backlash+delay"] = 500.0
    border = assess(table(costs), circumstances())
    assert set(border.minimal) == {mask("one_mass+coulomb"), mask("one_mass+gravity")}
    assert [r.mask for r in border.refuted] == [mask("two_mass+viscous+backlash+delay")]
    assert not border.undecided


def test_refutation__several_fits_within_it__rests_on_the_least_of_them():
    """The largest has missed its optimum: it leaves no more than what it contains."""
    costs = {TOP: 100.0, "one_mass+coulomb": 103.0}
    bare = TOP.replace("+coulomb", "")
    costs |= {bare: 600.0, "one_mass+viscous": 520.0, "one_mass": 5000.0}
    (found,) = assess(table(costs), circumstances()).refuted
    assert (found.mask, found.witness) == (mask(bare), mask("one_mass+viscous"))
    assert found.excess == 420.0


def test_assess__rejected_structure_that_contains_a_minimal_one__adequate():
    """Refuted is what is rejected with everything within it; thresholds shrink with the number of parameters."""
    costs = {TOP: 100.0, "one_mass+coulomb": 112.0, TOP.replace("+delay", ""): 111.0, "one_mass": 900.0}
    border = assess(table(costs), circumstances(floor=0.0))
    assert border.minimal == (mask("one_mass+coulomb"),)
    assert border.adequate == {mask(text) for text in costs} - {mask("one_mass")}


@st.composite
def falling(draw, lattices=LATTICES):
    """A lattice, and deviances that never rise with the effects: each of some sets of atoms explains a part."""
    lattice = draw(st.sampled_from(lattices))
    atoms = list(lattice.bits(lattice.everything))
    parts = draw(st.lists(st.tuples(st.sets(st.sampled_from(atoms), min_size=1, max_size=3), st.floats(1.0, 300.0))))
    sets = [(sum(chosen), gain) for chosen, gain in parts]

    def deviance(m):
        value = 1000.0 + sum(gain for chosen, gain in sets if not m & chosen)
        return Deviance(value, 1 + m.bit_count(), lattice.structure(m).masses)

    return lattice, deviance


def by_force(lattice, deviance, known):
    """Masks of all adequate structures: those that contain one that is not rejected."""
    least = known.least([deviance(m) for m in lattice.masks()])
    fits = [m for m in lattice.masks() if deviance(m).value <= known.limit(deviance(m), least)]
    return {m for m in lattice.masks() if any(not n & ~m for n in fits)}


@settings(max_examples=60, deadline=None, derandomize=True)
@given(falling((SMALL, REQUIRED)))
def test_assess__all_structures_fitted__as_by_force(case):
    """Also with thresholds that differ between structures."""
    lattice, deviance = case
    known = circumstances(lattice, 0.0)
    border = assess({m: deviance(m) for m in lattice.masks()}, known)
    adequate = by_force(lattice, deviance, known)
    refuted = [m for m in lattice.masks() if m not in adequate]
    largest = {m for m in refuted if not any(n != m and not m & ~n for n in refuted)}
    assert border.adequate == adequate
    assert not border.undecided
    assert {r.mask for r in border.refuted} == largest
    assert set(border.minimal) == {m for m in adequate if not any(n != m and not n & ~m for n in adequate)}


def children(lattice, m):
    """Largest structures within `m` that lack one of its atoms."""
    return [lattice.without(m, b) for b in lattice.bits(m & ~lattice.required) if m & b]


@settings(max_examples=60, deadline=None, derandomize=True)
@given(falling())
def test_border__fits_where_it_is_undecided__decides_all_as_by_force(case):
    """Shrink a minimal structure, and fit what is undecided: few fits decide the lattice as all of them do."""
    lattice, deviance = case
    known, fitted = circumstances(lattice), {lattice.everything: deviance(lattice.everything)}
    while True:
        border = assess(fitted, known)
        wanted = [m for least in border.minimal for m in children(lattice, least) if m not in fitted]
        wanted = wanted[:1] or list(border.undecided[:1])
        if not wanted:
            break
        fitted |= {m: deviance(m) for m in wanted if not lattice.required & ~m}
    adequate = by_force(lattice, deviance, known)
    for m in lattice.masks():
        assert any(not least & ~m for least in border.minimal) == (m in adequate)
        assert any(not m & ~r.mask for r in border.refuted) == (m not in adequate)
    assert len(fitted) <= 1 + (len(border.minimal) + len(border.refuted)) * len(lattice.atoms)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.sampled_from(LATTICES), st.data())
def test_largest_avoiding__any_masks__as_by_force(lattice, data):
    listed = lattice.masks()
    masks = data.draw(st.lists(st.sampled_from(listed), max_size=5))
    free = [m for m in listed if not any(not n & ~m for n in masks)]
    largest = [m for m in free if not any(n != m and not m & ~n for n in free)]
    assert largest_avoiding(masks, lattice) == sorted(largest)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.lists(st.integers(0, 63), max_size=12))
def test_inclusion_minimal__any_masks__those_that_contain_no_other(masks):
    wanted = {m for m in masks if not any(n != m and not n & ~m for n in masks)}
    assert inclusion_minimal(masks) == sorted(wanted)
