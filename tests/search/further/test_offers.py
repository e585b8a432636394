"""Offers of a search: an effect whose place the recording does not show is called for at no place."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from brightgrey import identify, load_model
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER, Placed, function_set, grammar_named
from brightgrey.model.run_record import load_run_record
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.decision import decide_structures
from brightgrey.search.fitting.structure_fit import fit_multistart
from brightgrey.search.further import offers
from brightgrey.search.further.offers import OfferingSearch
from brightgrey.search.further.proposals import further_effects
from brightgrey.search.lattice import Lattice
from support.searches import minimal, simulated_task, verdicts

F_TANH = 200.0
VALUES = {"J1": 0.008, "J2": 0.006, "c1": 60.0, "d1": 0.05, "f_v": 0.004, "M_C": 0.3}
SPRING = {"c_g@2": 0.08}
FRICTION = {"M_C@2": 0.25}


def decision(structure, values):
    task = simulated_task(structure, values, E.torque(), 0.005 * E.speed, dt=E.dt, f_tanh=F_TANH, step=1e-3)
    excluded = ("three_mass", "stribeck", "current_control", "delay", "backlash", "gravity")
    return decide_structures(task, grammar_named("drive"), exclude=excluded)


@pytest.fixture(scope="module")
def on_stiff_shaft():
    return decision("two_mass+coulomb+viscous+ground_spring@2", VALUES | SPRING)


@pytest.mark.long
def test_ground_spring_on_a_stiff_shaft__neither_place_is_needed(on_stiff_shaft):
    certificate = on_stiff_shaft.evidence.certificate
    said = {**verdicts(on_stiff_shaft), **certificate.held_back}
    assert said["ground_spring"] == said["ground_spring@2"] == "not decidable"
    places = {"two_mass+coulomb+viscous+ground_spring", "two_mass+coulomb+viscous+ground_spring@2"}
    assert places <= set(minimal(on_stiff_shaft)) == set(certificate.minimal)


def test_ground_spring_on_a_stiff_shaft__identified__the_rival_is_in_every_file(tmp_path):
    task = simulated_task(
        "two_mass+coulomb+ground_spring@2",
        {n: v for n, v in VALUES.items() if n != "f_v"} | SPRING,
        E.torque(),
        0.005 * E.speed,
        dt=E.dt,
        f_tanh=F_TANH,
        step=1e-3,
    )
    excluded = ("three_mass", "viscous", "stribeck", "current_control", "delay", "backlash", "gravity")
    found = identify(task.recordings[0], exclude=excluded, workers=1)
    found.write(tmp_path)
    ties = load_model(tmp_path / "model.json").ties.minimal
    assert len(ties) == 2
    assert [(f.structure, f.status) for f in load_run_record(tmp_path).fits[:2]] == [
        (ties[0], "minimal"),
        (ties[1], "rival"),
    ]
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "One of several effects is needed, and the recording does not say which." in report
    assert "does not decide whether the drive has" not in report  # there is a spring, at one place or the other
    assert "would not show it if the drive had" not in report


def test_friction_at_the_second_mass__its_place_shows__needed_there():
    found = decision("two_mass+coulomb+viscous+coulomb@2", {**VALUES, "c1": 30.0} | FRICTION)
    assert len(minimal(found)) == 1
    assert verdicts(found)["coulomb@2"] == "needed"
    assert minimal(found)[0] == "two_mass+coulomb+coulomb@2+viscous"


def test_effect_explains_all_beside_one_mass__neither_more_masses_nor_gaps_are_gone_into():
    values = {"J1": 0.014, "f_v": 0.02, "M_C": 0.3, "c_g": 0.08}
    structure = "one_mass+coulomb+viscous+ground_spring"
    task = simulated_task(structure, values, E.torque(), 0.005 * E.speed, dt=E.dt, f_tanh=F_TANH, step=1e-3)
    excluded = ("stribeck", "current_control", "delay", "gravity")
    found = decide_structures(task, grammar_named("drive"), exclude=excluded)
    assert structure in minimal(found)
    assert max(s.masses for s in found.fitted) == 2


@pytest.mark.long
def test_friction_beside_a_gap__is_offered_beside_the_gap():
    task = simulated_task(
        "two_mass+coulomb+viscous+backlash+coulomb@2",
        {**VALUES, "c1": 40.0, "alpha": 0.05} | FRICTION,
        E.torque(),
        0.005 * E.speed,
        dt=E.dt,
        f_tanh=F_TANH,
        step=1e-3,
    )
    excluded = ("three_mass", "stribeck", "current_control", "delay", "gravity")
    found = decide_structures(task, grammar_named("drive"), exclude=excluded)
    assert verdicts(found)["coulomb@2"] == verdicts(found)["backlash"] == "needed"


def test_position_dependent_load_that_turns_often__is_found_by_multistart():
    values = {"J1": 0.012, "M_C": 0.3, "G": 3.5, "k": 0.25, "phi_0": -1.0}
    task = simulated_task(
        "one_mass+coulomb+pendulum", values, E.torque(), 0.005 * E.speed, dt=E.dt, f_tanh=F_TANH, step=1e-3
    )
    excluded = ("two_mass", "stribeck", "viscous", "current_control", "delay", "backlash")
    found = decide_structures(task, grammar_named("drive"), exclude=excluded)
    assert minimal(found)[0] == "one_mass+coulomb+pendulum"
    assert found.best.values["k"] == pytest.approx(0.25, rel=0.01)


class Unsuspecting(BorderSearch):
    """A search in which all model error passes for noise."""

    def has_model_error(self):
        return False


def search_with(kind, task, pool, left_out):
    """A search without some effects, which may be offered any further one."""
    grammar = grammar_named("drive")

    def with_effects(more, most=None):
        return Lattice.of(grammar.offering(more), (), left_out)

    return kind(task, with_effects(()), pool, 0, tuple(grammar.further), with_effects)


def search_of_one_mass(kind, task, pool):
    """A search that has Coulomb and viscous friction, and may be offered any further effect."""
    return search_with(kind, task, pool, ("two_mass", "stribeck", "current_control", "delay", "gravity"))


@pytest.mark.parametrize(("stiffness", "offered"), [(0.2, ["ground_spring"]), (0.002, [])])
def test_offer_further__model_error_not_seen__only_a_poor_fit_is_offered_effects(stiffness, offered):
    values = {"J1": 0.012, "M_C": 0.3, "c_g": stiffness}
    structure = "one_mass+coulomb+ground_spring"
    task = simulated_task(structure, values, E.torque(), 0.005 * E.speed, dt=E.dt, f_tanh=F_TANH, step=1e-3)
    with ThreadPoolExecutor(1) as pool:
        search = search_of_one_mass(Unsuspecting, task, pool)
        search.fit(search.anchors)
        assert search.fits_poorly() == bool(offered)
        assert search.offer_further(1) == bool(offered)
    assert list(map(str, search.offered)) == offered


@pytest.mark.parametrize("white", [False, True])
def test_offer_to_fewest_masses__model_error_not_seen__what_explains_more_with_less_is_offered(monkeypatch, white):
    """A second mass follows a spring to the ground. Its residual may pass for noise; it is not asked if it is white."""
    values = {"J1": 0.012, "M_C": 0.3, "c_g": 0.2}
    structure = "one_mass+coulomb+ground_spring"
    task = simulated_task(structure, values, E.torque(), 0.005 * E.speed, dt=E.dt, f_tanh=F_TANH, step=1e-3)
    with ThreadPoolExecutor(1) as pool:
        search = search_with(Unsuspecting, task, pool, left_out=("three_mass", "stribeck", "current_control", "delay"))

        def is_explained(fitted=None):
            return white and fitted is None and search.fits.best().structure.masses == 2

        monkeypatch.setattr(search, "is_explained", is_explained)
        assert search.offer_to_fewest_masses() != white
    assert ("ground_spring" in map(str, search.offered)) != white


@pytest.mark.parametrize(("share", "steady"), [(1.0, True), (0.25, False)])
def test_helps_steadily__load_in_a_part_of_the_recording__does_not(share, steady):
    """What is taken for gravity acts all the time, or somebody pushes in the last two of eight parts."""
    u, load = E.torque(), 0.3 * (np.arange(E.torque().size) >= (1.0 - share) * E.torque().size)
    values = {"J1": 0.012, "M_C": 0.3}
    pushed = simulated_task("one_mass+coulomb", values, u - load, 0.005 * E.speed, dt=E.dt, f_tanh=F_TANH)
    task = replace(pushed, recordings=(replace(pushed.recordings[0], u=u),))
    own, larger = map(PAPER.parse, ("one_mass+coulomb", "one_mass+coulomb+gravity"))
    lattice = Lattice.of(PAPER, ("coulomb",), [e for e in PAPER.places if e not in ("one_mass", "coulomb", "gravity")])
    with ThreadPoolExecutor(1) as pool:
        search = BorderSearch(task, lattice, pool)
        search.fit([own, larger])
        fits = search.fits.done
        assert search.helps_steadily(fits[own], fits[larger]) == steady
        assert fits[larger].cost < 0.9 * fits[own].cost
        assert not search.helps_steadily(fits[larger], fits[larger])


def test_larger_than__most_helpful_effect_is_not_steady__the_next_one_is_taken(monkeypatch):
    """Of two further effects one explains more, but here and there."""
    values = {"J1": 0.012, "M_C": 0.3, "f_v": 0.02, "c_g": 0.2}
    structure = "one_mass+coulomb+viscous+ground_spring"
    task = simulated_task(structure, values, E.torque(), 0.005 * E.speed, dt=E.dt, f_tanh=F_TANH, step=1e-3)
    with ThreadPoolExecutor(1) as pool:
        search = search_of_one_mass(BorderSearch, task, pool)
        search.fit(search.anchors)
        (own,) = search.best_with(1)
        first = search.larger_than(own)
        search._larger.clear()
        monkeypatch.setattr(search, "is_explained", lambda fitted=None: False)
        monkeypatch.setattr(search, "helps_steadily", lambda own, fit: fit.structure != first.structure)
        second = search.larger_than(own)
    assert str(first.structure) == structure
    assert second.structure != first.structure


def test_with_one_more__only_a_pendulum_is_tried__its_limiting_case_explains_alike(monkeypatch):
    """A fit of the spring to the ground from elsewhere may end far off. That of the pendulum has seen it."""
    values = {"J1": 0.014, "f_v": 0.02, "c_g": 0.1}
    task = simulated_task("one_mass+viscous+ground_spring", values, E.torque(), 0.005 * E.speed, dt=E.dt, f_tanh=F_TANH)
    tried = further_effects

    def pendulums(*args):
        return tuple(f for f in tried(*args) if f.placed.name == "pendulum")

    monkeypatch.setattr(offers, "further_effects", pendulums)
    more = (Placed("pendulum"), Placed("ground_spring"))
    with ThreadPoolExecutor(1) as workers:
        search = OfferingSearch(task, Lattice.of(PAPER, ("viscous",)), workers, further=more)
        own = PAPER.parse("one_mass+viscous")
        search.fits.add([own], workers)
        found = search.with_one_more(search.fits.done[own])
    assert str(found.structure) == "one_mass+viscous+ground_spring"
    assert found.values["c_g"] == pytest.approx(0.1, rel=0.05)


@pytest.mark.parametrize(("stiffness", "load", "turns"), [(0.1, 0.9, 0.9), (0.05, 2.0, 0.5), (0.2, 1.5, 1.0)])
def test_larger_than__spring_beside_a_position_dependent_load__is_found_by_multistart(stiffness, load, turns):
    """Without the spring the load has taken its part, with another period, and no descent leads back from there."""
    values = {"J1": 0.012, "M_C": 0.3, "c_g": stiffness, "G": load, "k": turns, "phi_0": -0.4}
    structure = "one_mass+coulomb+ground_spring+pendulum"
    task = simulated_task(structure, values, E.torque(), 0.005 * E.speed, dt=E.dt, f_tanh=F_TANH, step=1e-3)
    lattice = Lattice.of(grammar_named("drive").offering([Placed("pendulum")]), ("coulomb",))
    with ThreadPoolExecutor(1) as workers:
        search = OfferingSearch(task, lattice, workers, further=(Placed("ground_spring"),))
        own = fit_multistart(task, function_set().parse("one_mass+coulomb+pendulum"), search.options, 0)
        search.fits.done[own.structure] = own
        assert search.larger_than(own) is None
        found = search.larger_than(own, multistart=True)
    assert str(found.structure) == structure
    assert {name: found.values[name] for name in values} == pytest.approx(values, rel=0.05)
