"""Structures with which a search begins, and those that it restarts."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from brightgrey.kit import PAPER
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.fitting.anchors import anchors, mass_masks
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


@pytest.mark.parametrize(
    ("leaders", "beside"),
    [
        (("three_mass+coulomb",), ["1", "2", "leader", "4"]),
        (("four_mass+coulomb",), ["1", "2", "3", "leader"]),
        (
            ("two_mass+coulomb", "three_mass+coulomb+backlash"),
            ["1", "leader", "3", "2 with a gap", "leader with a gap", "4 with a gap"],
        ),
    ],
)
def test_beside_leaders__fewer_masses_before_and_one_more_after(leaders, beside, monkeypatch):
    task = simulated_task("one_mass", {"J1": 0.02}, np.sin(np.arange(200) / 20.0), 0.1, dt=0.002, f_tanh=5.0)
    with ThreadPoolExecutor(1) as pool:
        search = BorderSearch(task, LATTICE, pool)
        search.tops = {PAPER.parse(f"{n}_mass+coulomb+viscous+backlash") for n in ("two", "three", "four")}
        leading = [PAPER.parse(text) for text in leaders]
        monkeypatch.setattr(search, "leaders", lambda: leading)
        found = search.beside_leaders()
    names = ["leader" if s in leading else str(s.masses) for s in found]
    assert [n + " with a gap" * s.has_hard_limit for n, s in zip(names, found, strict=True)] == beside


def test_find_best_patiently__each_once_until_explained(monkeypatch):
    task = simulated_task("one_mass", {"J1": 0.02}, np.sin(np.arange(200) / 20.0), 0.1, dt=0.002, f_tanh=5.0)
    with ThreadPoolExecutor(1) as pool:
        search, found = BorderSearch(task, LATTICE, pool), []
        ladder = [PAPER.parse(f"{n}_mass") for n in ("one", "two", "three", "four")]
        monkeypatch.setattr(search, "beside_leaders", lambda: ladder)
        monkeypatch.setattr(search, "restart_at", lambda s, patiently: found.append((s.masses, patiently)))
        monkeypatch.setattr(search, "is_explained", lambda: len(found) == 3)
        search.find_best_patiently()
        assert found == [(1, True), (2, True), (3, True)]
        monkeypatch.setattr(search, "is_explained", lambda: False)
        found.clear()
        search.find_best_patiently()
        assert [masses for masses, _ in found] == [1, 2, 3, 4]


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
