"""Structures with which a search begins, and those that it restarts."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from brightgrey.kit import PAPER, Placed
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.fitting.anchors import anchors, mass_masks
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.lattice import Lattice
from support.searches import simulated_task

LATTICE = Lattice.of(PAPER)


def test_anchors__paper__two_for_each_number_of_masses_without_gap():
    found = anchors(LATTICE)
    assert [s.masses for s in found] == [1, 1, 2, 2, 3, 3, 4, 4]
    assert not any(s.has_hard_limit for s in found)
    assert str(found[2]) == "two_mass+coulomb+viscous+stribeck+gravity"
    assert str(found[3]) == "two_mass+coulomb+viscous+stribeck+gravity+current_control+delay"


def test_anchors__required_effects__in_all_of_them():
    found = anchors(Lattice.of(PAPER, ("backlash",)))
    assert found
    assert all("backlash" in s.names for s in found)


def test_mass_masks__fewest_first():
    assert [m.bit_count() for m in mass_masks(LATTICE)] == [0, 1, 2, 3]


@pytest.fixture
def search():
    task = simulated_task("one_mass", {"J1": 0.02}, np.sin(np.arange(200) / 20.0), 0.1, dt=0.002, f_tanh=5.0)
    with ThreadPoolExecutor(1) as pool:
        yield BorderSearch(task, LATTICE, pool)


@pytest.mark.parametrize(
    ("leaders", "beside"),
    [
        (("three_mass+coulomb",), ["leader", "4"]),
        (("four_mass+coulomb",), ["leader"]),
        (("two_mass+coulomb", "three_mass+coulomb+backlash"), ["leader", "3", "2 gap", "leader gap", "4 gap"]),
        (("two_mass+coulomb", "four_mass+coulomb+backlash"), ["leader", "3", "2 gap", "3 gap", "leader gap"]),
    ],
)
def test_beside_leaders__one_mass_more_after_and_with_a_gap_fewer_before(leaders, beside, search, monkeypatch):
    search.tops = {PAPER.parse(f"{n}_mass+coulomb+viscous+backlash") for n in ("two", "three", "four")}
    leading = [PAPER.parse(text) for text in leaders]
    monkeypatch.setattr(search, "leaders", lambda: leading)
    found = search.beside_leaders()
    names = ["leader" if s in leading else str(s.masses) for s in found]
    assert [n + " gap" * s.has_hard_limit for n, s in zip(names, found, strict=True)] == beside


@pytest.mark.parametrize(
    ("without", "with_gap", "leading"),
    [
        (100.0, 95.0, [False]),  # the gap takes off too little
        (100.0, 50.0, [False, True]),
        (1000.0, 50.0, [True]),  # without it the best is far behind
    ],
)
def test_leaders__gap_that_tells_and_best_without_it_unless_far_behind(without, with_gap, leading, search, monkeypatch):
    monkeypatch.setattr(search, "has_model_error", lambda: False)
    costs = {"two_mass": without, "two_mass+backlash": with_gap}
    fits = [StructureFit(PAPER.parse(text), {"J1": 0.01}, cost, 3) for text, cost in costs.items()]
    search.fits.done.update({f.structure: f for f in fits})
    search.fits.error_floor_cost = lambda fitted: 0.0
    assert [s.has_hard_limit for s in search.leaders()] == leading


@pytest.mark.parametrize(("model_error", "masses"), [(True, [4]), (False, [2])])
def test_leaders__coloured_residual__masses_lead_for_model_error_only(model_error, masses, search, monkeypatch):
    sizes = {"two_mass": (100.0, 3), "four_mass": (80.0, 9)}
    fits = [StructureFit(PAPER.parse(text), {}, cost, free) for text, (cost, free) in sizes.items()]
    search.fits.done.update({f.structure: f for f in fits})
    monkeypatch.setattr(search, "has_model_error", lambda: model_error)
    monkeypatch.setattr("brightgrey.search.border_search.effective_samples_of", lambda task, fitted: 20.0)
    assert [s.masses for s in search.leaders()] == masses


def test_find_best_patiently__each_once_until_explained(search, monkeypatch):
    found = []
    monkeypatch.setattr(search, "beside_leaders", lambda: [PAPER.parse(f"{n}_mass") for n in ("one", "two", "three")])
    monkeypatch.setattr(search, "restart_at", lambda s, patiently: found.append((s.masses, patiently)))
    monkeypatch.setattr(search, "is_explained", lambda: len(found) == 2)
    monkeypatch.setattr(search, "changes_task", lambda: False)
    search.find_best_patiently()
    assert found == [(1, True), (2, True)]
    monkeypatch.setattr(search, "is_explained", lambda: False)
    found.clear()
    search.find_best_patiently()
    assert [masses for masses, _ in found] == [1, 2, 3]


@pytest.mark.parametrize("better", [False, True])
@pytest.mark.parametrize(
    ("model_error", "thorough", "offered", "resonance", "restarted"),
    [
        (True, True, (), False, ["two_mass+coulomb", "three_mass+coulomb"]),
        (False, True, (), True, []),
        (True, False, (Placed("gravity"),), True, ["three_mass+coulomb"]),
        (True, False, (Placed("gravity"),), False, []),
        (True, False, (), True, []),
    ],
)
def test_improves_simplest__model_error__it_and_one_mass_more_once(
    model_error, thorough, offered, resonance, restarted, better, search, monkeypatch
):
    found, own = [], PAPER.parse("two_mass+coulomb")
    search.thorough, search.offered = thorough, offered
    for structure in (own, PAPER.parse("three_mass+coulomb")):
        search.fits.done[structure] = StructureFit(structure, {"J1": 0.01}, 1.0, 1)
    monkeypatch.setattr(search, "simplest", lambda border: own)
    monkeypatch.setattr(search, "has_model_error", lambda: model_error)
    monkeypatch.setattr("brightgrey.search.border_search.calls_for_mass", lambda task, fitted: resonance)
    monkeypatch.setattr(search, "fit", lambda structures: None)
    monkeypatch.setattr(search, "restart_at", lambda s, patiently: found.append(str(s)) or better)
    assert search.improves_simplest(None) == (better and bool(restarted))
    assert found == restarted
    assert not search.improves_simplest(None)


@pytest.mark.parametrize(
    ("atoms", "restarted"),
    [
        (
            ("coulomb", "viscous", "backlash", "delay"),
            [("two_mass+viscous+backlash+delay", True), ("two_mass+coulomb+viscous+backlash+delay", False)],
        ),
        (("viscous", "backlash"), [("two_mass+viscous+backlash", True)]),
    ],
)
def test_fit_hard_limits__least_gap__beside_linear_effects_first_and_once_each(atoms, restarted, monkeypatch):
    lattice = Lattice.of(PAPER, exclude=[e for e in PAPER.places if e not in {"one_mass", "two_mass", *atoms}])
    task = simulated_task("one_mass", {"J1": 0.02}, np.sin(np.arange(200) / 20.0), 0.1, dt=0.002, f_tanh=5.0)
    with ThreadPoolExecutor(1) as pool:
        search, found = BorderSearch(task, lattice, pool), []
        monkeypatch.setattr(search, "fit", lambda structures: search.fits.done.update(dict.fromkeys(structures)))
        monkeypatch.setattr(search, "is_explained", lambda: False)
        monkeypatch.setattr(search, "restart_at", lambda s, patiently=False: found.append((str(s), patiently)))
        search.fit_hard_limits()
    assert found == restarted
