"""What small recordings say about the effects of a restricted set of structures."""

import re
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from brightgrey.estimation import scales
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER, Placed
from brightgrey.recordings import Signal
from brightgrey.search import IdentificationTask, fitting
from brightgrey.search.comparison import Judged
from brightgrey.search.evidence import assess_effects
from brightgrey.search.exhaustive import fit_all
from brightgrey.search.structure_fit import StructureFit
from brightgrey.search.judging import Bench
from brightgrey.search.lattice import contains
from brightgrey.search.parallel import thread_pool
from brightgrey.search.task import FAST_LEVEL_ACCURACY, TRUSTED_ACCURACY
from brightgrey.search.yardstick import Yardstick
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

DT = 0.002
F_TANH = 5.0


def task_of(structure, values, torque, noise, *, begin=0, f_tanh=F_TANH, dt=DT):
    (v,) = reference(structure, values, torque, dt, f_tanh=f_tanh)
    y = (v + noise * np.random.default_rng(1).normal(size=v.size))[begin:]
    recording = make_recording(torque[begin:], y, dt=dt)
    known = scales(recording)
    return IdentificationTask((recording,), known, Settings(f_tanh=f_tanh, speed_scale=known.speed, level="fast"))


def structures(effects, ladders=("one_mass",)):
    """All of the grammar's that have nothing but these."""
    allowed = {*effects, *ladders}
    return [s for s in PAPER.structures() if set(s.names) <= allowed]


def evidence(task, effects, ladders=("one_mass",)):
    return assess_effects(task, fit_all(task, structures(effects, ladders)))


def reversing():
    t = DT * np.arange(500)
    return 3.0 * np.sign(np.sin(2.0 * np.pi * 2.0 * t + 0.7)) * np.minimum(1.0, 20.0 * t)


def one_way():
    """Speed does not fall near standstill again once it has risen."""
    t = DT * np.arange(700)
    return 2.0 * np.minimum(1.0, 10.0 * t) + 1.2 * np.sin(2.0 * np.pi * 3.0 * t) * (t > 0.4)


@pytest.fixture(scope="module")
def friction():
    values = {"J1": 0.02, "M_C": 0.5, "f_v": 0.03}
    return evidence(
        task_of("one_mass+coulomb+viscous", values, reversing(), 0.1), ("coulomb", "viscous", "gravity", "delay")
    )


def test_evidence__friction__truth_is_only_minimal_structure(friction):
    assert [str(j.structure) for j in friction.minimal] == ["one_mass+coulomb+viscous"]
    verdicts = {c.effect: c.verdict for c in friction.cards}
    assert verdicts == {"coulomb": "needed", "viscous": "needed", "gravity": "not needed", "delay": "not needed"}
    assert friction.optional == ()


def test_verdict__each_effect__loss_gain_and_sentence(friction):
    for card in friction.cards:
        assert card.reason.endswith(".")
        assert str(card) == f"{card.title}: {card.verdict}. {card.reason}"
        if card.verdict == "needed":
            assert card.loss > 0.01
        else:
            assert 0.0 <= card.gain < 0.01


def test_reason__not_needed__size_and_estimate(friction):
    reasons = {c.effect: c.reason for c in friction.cards}
    assert reasons["gravity"].startswith("M_G of ±0.03 N m or more would have shown; the fit puts it at ")
    assert reasons["delay"].startswith("T_d of 0.0004 s or more would have shown; the fit puts it at ")
    for effect in ("gravity", "delay"):
        assert re.search(r", which explains \S+ % of the residual\.$", reasons[effect])


def test_reason__not_detectable__detection_limit_grows_with_noise():
    """What a linear drive shows is in proportion to its noise, and doubled until it shows."""
    told = []
    for noise in (4.0, 8.0, 16.0):
        task = task_of("one_mass+viscous", {"J1": 0.02, "f_v": 0.03}, reversing(), noise)
        (card,) = (c for c in evidence(task, ("viscous", "gravity")).cards if c.effect == "gravity")
        assert card.verdict == "not decidable"
        before, size = card.reason.split("; it would from M_G of ")
        assert before == "At a size that matters (M_G of 0.03 N m) this recording would not have shown it"
        told.append(float(size.removesuffix(" N m on.")))
    assert told[1:] == pytest.approx([2.0 * told[0], 4.0 * told[0]])


def test_reason__limit_beyond_bounds__no_detection_limit():
    task = task_of("one_mass+viscous", {"J1": 0.02, "f_v": 0.03}, reversing(), 16.0)
    bounded = replace(task, bounds={"M_G": (-0.04, 0.04)})
    (card,) = (c for c in evidence(bounded, ("viscous", "gravity")).cards if c.effect == "gravity")
    assert card.verdict == "not decidable"
    assert "it would from" not in card.reason


def test_reason__size_of_two_parameters__in_units_of_recording():
    """Stribeck friction is held with its width: a narrower one need not have shown."""
    values = {"J1": 20.0, "M_C": 500.0, "f_v": 30.0}
    task = task_of("one_mass+coulomb+viscous", values, 1000.0 * reversing(), 0.1)
    (recording,) = task.recordings
    axis = replace(
        recording, input=Signal("u", "input", "N"), outputs=(Signal("v", "velocity", "mm/s"),), y=1e-3 * recording.y
    )
    known = scales(axis)
    task = IdentificationTask((axis,), known, Settings(f_tanh=1e3 * F_TANH, speed_scale=known.speed, level="fast"))
    reasons = {c.effect: c.reason for c in evidence(task, ("coulomb", "viscous", "stribeck")).cards}
    assert f"M_S of 30 N at omega_S of {50.0 * known.speed:.2g} mm/s" in reasons["stribeck"]


def test_evidence__effect_in_all_structures__no_verdict():
    """Of what is required nothing is known: no structure without it was tried."""
    values = {"J1": 0.02, "M_C": 0.5, "f_v": 0.03}
    task = task_of("one_mass+coulomb+viscous", values, reversing(), 0.1)
    required = [s for s in structures(("coulomb", "viscous", "gravity")) if "gravity" in s.names]
    found = assess_effects(task, fit_all(task, required))
    assert {c.effect: c.verdict for c in found.cards} == {"coulomb": "needed", "viscous": "needed"}
    assert assess_effects(task, fit_all(task, required[:1])).cards == ()


def test_evidence__best_criterion__contains_minimal_structure(friction):
    best = min(friction.criterion, key=lambda s: friction.criterion[s])
    assert contains(best, friction.minimal[0].structure)


def test_evidence__no_reversal__gravity_not_decidable():
    values = {"J1": 0.02, "M_C": 0.4, "f_v": 0.03}
    found = evidence(
        task_of("one_mass+coulomb+viscous", values, one_way(), 0.1, begin=200),
        ("coulomb", "viscous", "gravity", "stribeck"),
    )
    verdicts = {c.effect: c.verdict for c in found.cards}
    assert verdicts["viscous"] == "needed"
    assert verdicts["coulomb"] != "not needed"
    assert verdicts["gravity"] == "not decidable"
    assert verdicts["stribeck"] == "not decidable"


@pytest.mark.parametrize("noise", [0.1, 0.03])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_evidence__effects_cancel__not_decidable(way, noise):
    """A load helps by as much as Coulomb friction brakes: neither shows where speed never turns, and both are there."""
    values = {"J1": 0.02, "M_C": 0.4, "f_v": 0.03, "M_G": 0.4 * way}
    task = task_of("one_mass+coulomb+viscous+gravity", values, way * one_way(), noise, begin=200)
    found = evidence(task, ("coulomb", "viscous", "gravity"))
    assert [str(j.structure) for j in found.minimal] == ["one_mass+viscous"]
    cards = {c.effect: c for c in found.cards}
    for effect, other in (("coulomb", "gravity"), ("gravity", "coulomb")):
        assert cards[effect].verdict == "not decidable"
        assert cards[effect].reason.endswith(f"beside another effect: {Placed.parse(other).effect.title}.")
        assert "At a size that matters (M_" in cards[effect].reason


def test_refine_at_fixed_size__hard_limit__other_effect_compensates():
    """Speed never turns, so that gravity makes up for Coulomb friction exactly; no small step there leads to it."""
    values = {"J1": 0.005, "J2": 0.02, "c1": 150.0, "d1": 0.3, "M_C": 0.6, "M_G": 1.3, "alpha": 0.3}
    t = DT * np.arange(700)
    torque = 3.0 * np.sin(2.0 * np.pi * (1.0 + 3.0 * t) * t) * np.minimum(1.0, 20.0 * t)
    task = task_of("two_mass+coulomb+gravity+backlash", values, torque, 0.2)
    big, small = (PAPER.parse(name) for name in ("two_mass+coulomb+gravity+backlash", "two_mass+gravity+backlash"))
    net = {name: value for name, value in values.items() if name != "M_C"} | {"M_G": 0.7}
    with thread_pool(None) as workers:
        bench = Bench(task, {small: StructureFit(small, net, np.inf, len(net))}, workers)
        own = bench.judge(small)
        held = bench.held(big, own.values, {}, {"M_C": 0.08}, own.cost)()
    assert held.cost < 1.01 * own.cost
    assert held.values["M_G"] == pytest.approx(0.78, rel=0.01)


def test_refine_at_fixed_size__rattling_load__approached_in_steps():
    """A tenth of the last mass may come loose, but not at once: its optimum is far from where that was not."""
    small, big = (PAPER.parse(f"{n}_mass+viscous+backlash+current_control") for n in ("three", "four"))
    values = {"J1": 0.001355, "J2": 0.01226, "J3": 0.00097, "c1": 1688.0, "c2": 1.449, "d1": 0.4328, "d2": 0.00504}
    values |= {"f_v": 0.00206, "alpha": 0.6313, "T_1": 0.002561}
    e = PAPER_EXPERIMENT
    t, rate = e.dt * np.arange(e.samples), np.log(100.0) / (e.dt * e.samples)
    torque = np.abs(e.torque()).max() * np.minimum(1.0, t / 0.02) * np.sin(2.0 * np.pi * np.expm1(rate * t) / rate)
    task = task_of(str(small), values, torque, 0.002, f_tanh=e.f_tanh, dt=e.dt)
    with thread_pool(None) as workers:
        bench = Bench(task, {small: StructureFit(small, values, np.inf, len(values))}, workers)
        own = bench.judge(small)
        least = PAPER.parse("four_mass").placed[0].relevant_size(task.scales, own.values)
        held = {name: least[name] for name in ("J4", "c3", "d3")}
        found = bench.held(big, {**task.default_start(big), **own.values}, {"J3": least["J3"]}, held, own.cost)()
    assert found.cost < 1.015 * own.cost  # 1.02 at once


def test_restart__light_middle_mass__is_found():
    """Refits end where the search did: with the light mass behind the others, and one mass more would be called for."""
    t, k = DT * np.arange(600), np.arange(1, 60)
    phase = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, k.size)
    u = np.sum(np.sin(2.0 * np.pi * k[:, None] * t / 1.2 + phase[:, None]) / np.sqrt(k)[:, None], axis=0)
    true = {"J1": 0.0112, "J2": 0.00097, "J3": 0.0096, "c1": 105.0, "c2": 84.0, "d1": 0.0187, "d2": 0.0509, "f_v": 0.02}
    task = task_of("three_mass+viscous", true, 0.5 * u * np.minimum(1.0, 50.0 * t), 0.005)
    structure = PAPER.parse("three_mass+viscous")
    ended = {
        "J1": 0.0115,
        "J2": 0.0102,
        "J3": 2.5e-5,
        "c1": 49.0,
        "c2": 0.36,
        "d1": 0.0199,
        "d2": 0.00116,
        "f_v": 0.0198,
    }
    problem = task.problem(structure)
    cost, least = (
        float(problem.costs({n: np.array([v]) for n, v in values.items()}, task.settings)[0])
        for values in (ended, true)
    )
    with thread_pool(None) as workers:
        bench = Bench(task, {structure: StructureFit(structure, ended, cost, len(ended))}, workers)
        assert bench.judge(structure).cost > 1.05 * least
        assert bench.seek(structure, 4)
        assert bench.judge(structure).cost < least
        assert bench.sought == {structure: 4}


def test_restart__repeated__new_starts_each_time(monkeypatch):
    t = DT * np.arange(300)
    values = {"J1": 0.0112, "J2": 0.004, "c1": 105.0, "d1": 0.0187, "f_v": 0.02}
    task = task_of("two_mass+viscous", values, 2.0 * np.sin(2.0 * np.pi * 15.0 * t**2), 0.005)
    structure, seen, explored = PAPER.parse("two_mass+viscous"), [], fitting.multistart

    def noted(*given, **options):
        found = explored(*given, **options)
        seen.append({tuple(begin) for begin in found.starts.T})
        return found

    monkeypatch.setattr(fitting, "multistart", noted)
    hub = fitting.from_everywhere(task, structure, fitting.Options(), 0)
    with thread_pool(None) as workers:
        bench = Bench(task, {structure: hub}, workers)
        bench.judge(structure)
        bench.seek(structure, 1)
        bench.seek(structure, 2)
    assert len(seen) == 4
    for a, b in combinations(seen, 2):  # the declared start is in all, the search's optimum in all later ones
        assert len(a & b) <= 1 + (a is not seen[0])


def test_evidence__masses__cumulative():
    values = {"J1": 0.012, "J2": 0.01, "c1": 25.0, "d1": 0.05, "f_v": 0.03}
    found = evidence(
        task_of("two_mass+viscous", values, reversing(), 0.1), ("viscous",), ("one_mass", "two_mass", "three_mass")
    )
    verdicts = {c.effect: c.verdict for c in found.cards}
    assert verdicts["two_mass"] == "needed"
    assert verdicts["viscous"] == "needed"
    assert verdicts["three_mass"] != "needed"
    assert "one_mass" not in verdicts


def test_evidence__no_motion__nothing_decidable():
    task = task_of("one_mass+coulomb", {"J1": 0.02, "M_C": 0.12}, 0.02 * reversing(), 0.1, f_tanh=500.0)
    found = evidence(task, ("coulomb", "viscous", "backlash"), ("one_mass", "two_mass", "three_mass"))
    assert {c.verdict for c in found.cards} == {"not decidable"}


def test_evidence__no_noise__only_the_truth_is_minimal():
    values = {"J1": 0.02, "M_C": 0.5, "f_v": 0.03}
    found = evidence(
        task_of("one_mass+coulomb+viscous", values, reversing(), 0.0),
        ("coulomb", "viscous", "stribeck", "gravity", "delay"),
        ("one_mass", "two_mass"),
    )
    assert [str(j.structure) for j in found.minimal] == ["one_mass+coulomb+viscous"]


def test_evidence__effect_below_accuracy__not_needed():
    """Without noise the least trace shows; no more than a sensor's and a simulation's own error is left without it."""
    values = {"J1": 0.02, "M_C": 0.5, "f_v": 2e-5}
    task = task_of("one_mass+coulomb+viscous", values, reversing(), 0.0)
    found = evidence(task, ("coulomb", "viscous"))
    without = found.minimal[0].descent.residual
    trusted = float(task.error_floor(task.problem(found.minimal[0].structure).weights, TRUSTED_ACCURACY).sum())
    assert [str(j.structure) for j in found.minimal] == ["one_mass+coulomb"]
    assert 0.01 * trusted < without @ without < trusted
    assert {c.effect: c.verdict for c in found.cards}["viscous"] != "needed"


def test_evidence__fit_at_fixed_size_within_accuracy__not_refuted():
    """With a lag of its least size held, no more is left than a sensor's error may be."""
    task = task_of("one_mass+viscous+delay", {"J1": 0.02, "f_v": 0.03, "T_d": 0.005}, reversing(), 0.0)
    found = evidence(task, ("viscous", "delay", "current_control", "gravity"), ("one_mass", "two_mass"))
    card = {c.effect: c for c in found.cards}["current_control"]
    assert (card.verdict, card.reason) == (
        "not decidable",
        "Held at a size that matters (T_1 of 0.0004 s), it makes the fit no worse.",
    )


@pytest.mark.parametrize(("seed", "size"), [(0, 0.1), (1, 0.5), (4, 0.1), (9, 0.1)])
def test_evidence__drifting_load__second_mass_not_decidable(seed, size):
    """A second mass swings along with any slow torque, undamped or so softly that it does not come back while it is
    recorded: the residual is 4 to 21 times smaller."""
    t, rng = DT * np.arange(1000), np.random.default_rng(seed)
    torque = 3.0 * np.sign(np.sin(2.0 * np.pi * 2.0 * t + 0.7)) * np.minimum(1.0, 20.0 * t)
    load = size * np.cumsum(rng.normal(size=t.size)) * np.sqrt(DT)
    (v,) = reference(
        "one_mass+coulomb+viscous", {"J1": 0.02, "M_C": 0.5, "f_v": 0.03}, torque + load, DT, f_tanh=F_TANH
    )
    q = DT * np.cumsum(v) + 0.001 * np.random.default_rng(1).normal(size=v.size)
    recording = make_recording(torque, q, dt=DT, kind="position", names=("u", "q"))
    known = scales(recording)
    task = IdentificationTask((recording,), known, Settings(f_tanh=F_TANH, speed_scale=known.speed, level="fast"))
    found = evidence(task, ("coulomb", "viscous"), ("one_mass", "two_mass"))
    card = {c.effect: c for c in found.cards}["two_mass"]
    assert card.verdict == "not decidable"
    assert found.minimal[0].structure.masses == 1


@pytest.mark.parametrize(
    ("stiffness", "damping", "minimal", "told"),
    [(1.0, 0.001, "one_mass+viscous", "It explains "), (100.0, 0.3, "two_mass", "Without it the residual is ")],
)
def test_evidence__inertia_at_bound__not_decidable(stiffness, damping, minimal, told):
    """A spring to the wall is fitted as one to the largest mass there may be, needed for the fit or not."""
    values = {"J1": 0.02, "J2": 20.0, "c1": stiffness, "d1": damping, "f_v": 0.03}
    task = task_of("two_mass+viscous", values, reversing(), 0.05)
    known = fit_all(task, structures(("viscous",), ("one_mass", "two_mass")))
    found = assess_effects(task, known)
    card = next(c for c in found.cards if c.effect == "two_mass")
    assert [str(j.structure) for j in found.minimal] == [minimal]
    assert card.verdict == "not decidable"
    assert card.reason.startswith(told)
    assert "a lag, or a spring to a wall, looks like that" in card.reason


def drives(structure, values, task):
    """A yardstick that knows `task`, and a drive as it is, nothing at a bound."""
    free = len(task.space(structure, initial=True).names)
    return Yardstick(Bench(task, {}, None), None, {}), Judged(structure, values, None, free, tuple(range(free)))


def test_absorbs_drift__parameter_at_bound__unless_bound_is_the_users():
    values = {"J1": 0.02, "J2": 0.01, "c1": 20.0, "d1": 0.05}
    task = task_of("two_mass", values, reversing(), 0.05)
    one, two = map(PAPER.parse, ("one_mass", "two_mass"))
    second = task.space(two, initial=True).names.index("J2")
    yardstick, big = drives(two, values, task)
    small = drives(one, values, task)[1]
    assert not yardstick.follows_drifts(big, small)
    at_bound = replace(big, inside=tuple(i for i in big.inside if i != second))
    assert yardstick.follows_drifts(at_bound, small)
    assert (yardstick.ran(at_bound), yardstick.inertias(at_bound)) == ({"J2"}, 1)
    gap = PAPER.parse("two_mass+backlash")
    with_gap = replace(at_bound, structure=gap, values=values | {"alpha": 0.01}, inside=(*at_bound.inside, 4))
    assert not yardstick.follows_drifts(with_gap, at_bound)  # it was so without the gap
    own = Yardstick(Bench(replace(task, bounds={"J2": (0.001, 0.01)}), {}, None), None, {})
    assert not own.follows_drifts(at_bound, small)
    assert (own.ran(at_bound), own.inertias(at_bound)) == (set(), 2)


@pytest.mark.parametrize(("damping", "digits"), [(1e-4, range(12)), (0.05, (0,)), (50.0, (0,))])
def test_absorbs_drift__less_than_one_oscillation__true(damping, digits):
    """By its springs and masses alone: with no more digits nor damping than that anything may be a slow oscillation."""
    task = task_of("two_mass", {"J1": 0.02, "J2": 0.01, "c1": 20.0, "d1": 0.05}, reversing(), 0.05)
    duration = task.recordings[0].t[-1]
    one, two = map(PAPER.parse, ("one_mass", "two_mass"))
    for swings in (0.9, 1.1, 200.0):
        for digit in digits:
            values = {"J1": 0.02, "J2": 0.01 * (1.0 + digit * np.finfo(float).eps), "d1": damping}
            values["c1"] = (2.0 * np.pi * swings / duration) ** 2 / (1.0 / values["J1"] + 1.0 / values["J2"])
            yardstick, big = drives(two, values, task)
            assert yardstick.swings(big) == pytest.approx(swings)
            assert yardstick.follows_drifts(big, drives(one, values, task)[1]) == (swings < 1.0)


def test_reason__white_residuals__few_samples_not_slow():
    """White noise and few samples make a further mass by chance, too: here one that explains 4 %."""
    task = task_of("one_mass+coulomb+viscous", {"J1": 0.02, "M_C": 0.5, "f_v": 0.03}, reversing()[:160], 0.0)
    (r,) = task.recordings
    y = r.y + 0.1 * np.random.default_rng(1).normal(size=r.y.shape)
    few = replace(task, recordings=(replace(r, y=y),))
    found = evidence(few, ("coulomb", "viscous", "gravity", "delay"), ("one_mass", "two_mass"))
    card = {c.effect: c for c in found.cards}["two_mass"]
    assert card.verdict == "not decidable"
    assert card.reason.endswith("may be chance with as few samples as these.")


def test_evidence__fixed_value__tested_at_that_value():
    """The user has ruled out all other sizes."""
    task = task_of("one_mass+coulomb+viscous", {"J1": 0.02, "M_C": 0.5, "f_v": 0.03}, reversing(), 0.05)
    found = evidence(replace(task, fixed={"M_G": 0.2}), ("coulomb", "viscous", "gravity"))
    card = {c.effect: c for c in found.cards}["gravity"]
    assert card.verdict == "not needed"
    assert card.reason == "M_G of 0.2 N m, as it is fixed, makes the fit worse."


def test_evidence__bound_without_width__search_completes():
    task = task_of("one_mass+coulomb+viscous", {"J1": 0.02, "M_C": 0.5, "f_v": 0.03}, reversing(), 0.05)
    found = evidence(replace(task, bounds={"M_G": (0.0, 0.0)}), ("coulomb", "viscous", "gravity"))
    assert [str(j.structure) for j in found.minimal] == ["one_mass+coulomb+viscous"]


def slow_and_late():
    """Dead time of less than a sample; a current loop differs by the fourth power of the lag, less than is trusted."""
    t = DT * np.arange(500)
    slow = 3.0 * np.sin(2.0 * np.pi * 2.0 * t) * np.minimum(1.0, 5.0 * t)
    task = task_of("one_mass+delay", {"J1": 0.02, "T_d": 0.75 * DT}, slow, 0.0)
    return task, fit_all(task, structures(("delay", "current_control")))


def test_evidence__alternatives_within_accuracy__all_minimal():
    task, fitted = slow_and_late()
    found = assess_effects(task, fitted)
    other = found.judged[PAPER.parse("one_mass+current_control")]
    trusted = float(task.error_floor(task.problem(other.structure).weights, TRUSTED_ACCURACY).sum())
    assert 0.4 * trusted < other.cost < trusted
    assert {str(j.structure) for j in found.minimal} == {"one_mass+delay", "one_mass+current_control"}


def test_evidence__unconverged_alternative__is_minimal_after_refit():
    """What is left of them may be the search's own error as well: a refit decides."""
    task, fitted = slow_and_late()
    late = PAPER.parse("one_mass+delay")
    values = {**fitted[late].values, "J1": fitted[late].values["J1"] * (1.0 + 0.6 * FAST_LEVEL_ACCURACY)}
    problem = task.problem(late)
    cost = float(problem.costs({n: np.array([v]) for n, v in values.items()}, task.settings)[0])
    trusted, rough = (
        float(task.error_floor(problem.weights, share).sum()) for share in (TRUSTED_ACCURACY, FAST_LEVEL_ACCURACY)
    )
    assert 2.0 * trusted < cost < rough
    found = assess_effects(task, {**fitted, late: replace(fitted[late], values=values, cost=cost)})
    assert {str(j.structure) for j in found.minimal} == {"one_mass+delay", "one_mass+current_control"}


def test_evidence__much_better_alternative__not_minimal():
    """Though neither contains the other: its lag, which its bound keeps, is what all that contain it have, too."""
    values = {"J1": 0.02, "M_C": 0.5, "f_v": 1.97e-5, "M_G": 7.98e-5, "T_d": 1.89e-5, "M_S": 0.0124, "omega_S": 2.0}
    task = task_of("one_mass+coulomb+viscous+stribeck+gravity+delay", values, reversing(), 0.0)
    found = evidence(task, ("coulomb", "viscous", "stribeck", "gravity", "delay", "current_control"))
    trusted = float(task.error_floor(task.problem(found.minimal[0].structure).weights, TRUSTED_ACCURACY).sum())
    assert min(j.cost for j in found.minimal) < trusted
    assert max(j.cost for j in found.minimal) < 1.02 * trusted
