"""Search for the border on recordings of the reference solver: what its restarts find."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER, Placed
from brightgrey.search import border_search
from brightgrey.search.border import Border, Refutation
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.lattice import Lattice
from brightgrey.search.policy import BORDER
from brightgrey.search.unexplained.doubtful import Doubts
from support.searches import simulated_task

VALUES = {
    "J1": 4.9e-4,
    "J2": 1.8e-3,
    "J3": 1.15e-2,
    "J4": 2.2e-3,
    "c1": 380.0,
    "c2": 19.0,
    "c3": 45.0,
    "d1": 0.023,
    "d2": 0.0084,
    "d3": 0.0059,
    "f_v": 0.013,
    "M_G": -0.48,
    "T_d": 0.015,
}


@pytest.mark.long
@pytest.mark.parametrize(("seed", "torque"), [(4, 1.0), (5, 0.5)])
def test_run__four_masses_that_single_batches_miss__patient_multistarts_find_them(seed, torque):
    truth = PAPER.parse("four_mass+viscous+gravity+delay")
    offered = {*truth.names, "one_mass", "two_mass", "three_mass", "current_control"}
    lattice = Lattice.of(PAPER, (), [e for e in PAPER.places if e not in offered])
    u = torque * E.torque()[:1200]
    task = simulated_task(truth, VALUES, u, 0.05, dt=E.dt, f_tanh=E.f_tanh, seed=seed, step=0.01)
    with ThreadPoolExecutor(1) as pool:
        search = BorderSearch(task, lattice, pool)
        border = search.run()
        assert search.is_explained()
    assert [lattice.structure(m) for m in border.minimal] == [truth]


BEYOND = ("improves_simplest", "offer_further", "offer_mass_left_out", "offer_mass")


@pytest.mark.parametrize(("masses", "asked"), [(1, ["offer_further"]), (2, [*BEYOND])])
def test_goes_further__doubtful_mass__calls_for_no_other(monkeypatch, masses, asked):
    """Where effects have been offered and model error remains, and the model without doubtful effects has one mass."""
    one, two = (PAPER.parse(f"{name}+viscous") for name in ("one_mass", "two_mass"))
    doubts = Doubts((two,), one if masses == 1 else two, {})
    monkeypatch.setattr(border_search, "doubts_about", lambda *args: doubts)
    calls = []
    for name in BEYOND:
        monkeypatch.setattr(BorderSearch, name, lambda search, *args, name=name: calls.append(name))
    monkeypatch.setattr(BorderSearch, "has_model_error", lambda search: True)
    monkeypatch.setattr(BorderSearch, "simplest", lambda search, border: two)
    lattice = Lattice.of(PAPER, exclude=[e for e in PAPER.places if e not in ("one_mass", "two_mass", "viscous")])
    task = simulated_task("one_mass+viscous", {"J1": 0.02, "f_v": 0.02}, E.torque()[:300], 0.05, dt=E.dt, f_tanh=100.0)
    with ThreadPoolExecutor(1) as pool:
        search = BorderSearch(task, lattice, pool)
        search.offered = (Placed("viscous", 2),)
        mask = lattice.mask(two)
        assert not search.goes_further(Border(mask, 0.0, (mask,), (), (), {mask: 0.0}, frozenset({mask})))
    assert calls == asked


@pytest.mark.parametrize(("excess", "restarts"), [(0.9, BORDER.restarts), (1.1, BORDER.restarts_costly)])
def test_restart__refutation_far_above_its_threshold__is_tried_once(monkeypatch, excess, restarts):
    """The certificate names the starts that agree, however large the excess is."""
    lattice = Lattice.of(PAPER, exclude=[e for e in PAPER.places if e not in ("one_mass", "viscous", "coulomb")])
    viscous, coulomb = (1 << lattice.index(e) for e in ("viscous", "coulomb"))
    monkeypatch.setattr(BorderSearch, "has_model_error", lambda search: False)
    monkeypatch.setattr(BorderSearch, "beside_refuted", lambda search, found, border: found.mask)
    restarted = []

    def restart_at(search, structure):
        search.restarts[structure] = search.restarts.get(structure, 0) + 1
        restarted.append(str(structure))

    monkeypatch.setattr(BorderSearch, "restart_at", restart_at)
    task = simulated_task("one_mass+viscous", {"J1": 0.02, "f_v": 0.02}, E.torque()[:300], 0.05, dt=E.dt, f_tanh=100.0)
    with ThreadPoolExecutor(1) as pool:
        search = BorderSearch(task, lattice, pool)
        refuted = Refutation(coulomb, excess * BORDER.far * 10.0, 10.0, coulomb)
        border = Border(viscous, 0.0, (viscous,), (refuted,), (), {viscous: 0.0}, frozenset({viscous}))
        while search.restart(border):
            pass
    assert restarted == ["one_mass+coulomb"] * restarts
