"""Optima that larger structures hand down."""

from dataclasses import replace

import numpy as np
import pytest

from brightgrey.estimation import scales
from brightgrey.estimation.optimisation.least_squares import normal_equations
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER, function_set
from brightgrey.search import IdentificationTask
from brightgrey.search.fitting.structure_fit import Options, StructureFit, fit_multistart, refit_from_supermodel
from brightgrey.search.fitting.warm_start import exchanged, handed_down, information
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference
from support.recordings import make_recording
from support.searches import fit_all, simulated_task


def parse(*names):
    return [PAPER.parse(name) for name in names]


def seen(values, columns):
    """J' J of `columns`, one for each of the values."""
    J = np.array([columns[name] for name in values]).T
    return J.T @ J


@pytest.fixture(scope="module")
def friction():
    """One mass whose motion hardly turns, and fits of what friction, gravity and dead time can do."""
    dt = 0.002
    t = dt * np.arange(400)
    u = (1.0 + np.sin(2.0 * np.pi * 4.0 * t)) * np.minimum(1.0, 20.0 * t)
    (v,) = reference("one_mass+coulomb", {"J1": 0.02, "M_C": 0.3}, u, dt, f_tanh=20.0)
    v += 1e-3 * np.abs(v).max() * np.random.default_rng(4).standard_normal(v.size)
    recording = make_recording(u, v, dt=dt, name="up")
    known = scales([recording])
    task = IdentificationTask((recording,), known, Settings(f_tanh=20.0, speed_scale=known.speed, level="fast"))
    names = {"one_mass", "coulomb", "viscous", "gravity", "delay"}
    return task, fit_all(task, [s for s in PAPER.structures() if set(s.names) <= names])


def wide(structure, **ranges):
    """Its parameters with wide ranges."""
    t = 0.01 * np.arange(100)
    recording = make_recording(np.sin(9.0 * t), np.sin(9.0 * t - 1.0), dt=0.01, name="any")
    limits = {name: (-1e3 if name == "M_G" else 1e-6, 1e3) for name in structure.parameters}
    return parameter_space(structure, scales([recording]), {**limits, **ranges}, {})


def test_project_to_submodel__effect_removed__similar_one_compensates():
    larger, structure = parse("two_mass+coulomb+gravity+delay", "two_mass+coulomb+delay")
    values = {"J1": 0.02, "J2": 0.01, "c1": 40.0, "d1": 0.05, "M_C": 8.0, "M_G": 7.8, "T_d": 3e-3}
    a, rng = np.random.default_rng(1).normal(size=(2, 50))
    columns = {name: np.roll(rng, i) for i, name in enumerate(values)} | {"M_C": a, "M_G": -a}
    plain, made_up = handed_down(values, seen(values, columns), larger, structure, wide(structure))
    assert plain == values
    assert made_up["M_C"] == pytest.approx(0.2)
    assert made_up["T_d"] == pytest.approx(values["T_d"])
    assert [made_up[name] for name in ("J1", "J2", "c1", "d1")] == [0.02, 0.01, 40.0, 0.05]


@pytest.mark.parametrize(
    ("larger", "structure"),
    [
        ("two_mass+coulomb+backlash", "two_mass+coulomb"),  # a gap is no small change
        ("two_mass+coulomb", "two_mass"),  # nothing is left to make up for it
        ("two_mass+coulomb+viscous", "two_mass+coulomb+viscous"),
    ],
)
def test_project_to_submodel__no_similar_effect__values_stay(larger, structure):
    larger, structure = parse(larger, structure)
    values = {name: 1.0 + i for i, name in enumerate(larger.parameters)}
    rng = np.random.default_rng(2)
    known = seen(values, {name: rng.normal(size=30) for name in values})
    space = wide(structure)
    assert handed_down(values, known, larger, structure, space) == [values]
    assert handed_down(values, None, larger, structure, space) == [values]
    assert handed_down(values, np.full_like(known, np.nan), larger, structure, space) == [values]


def test_project_to_submodel__friction_speeds__unchanged():
    """At no speed of fading its friction is gone, too; but that is not how it is left out."""
    larger, structure = parse("one_mass+coulomb+stribeck", "one_mass+coulomb")
    values = {"J1": 0.02, "M_C": 0.3, "M_S": 0.2, "omega_S": 5.0}
    a, b, c = np.random.default_rng(3).normal(size=(3, 50))
    known = seen(values, {"J1": c, "M_C": a, "M_S": 0.5 * a, "omega_S": b})
    made_up = handed_down(values, known, larger, structure, wide(structure))[-1]
    assert made_up["M_C"] == pytest.approx(0.4)


def test_project_to_submodel__bound_reached__others_compensate():
    """Clipped afterwards, the step would leave them where the whole share of the first was right."""
    larger, structure = parse("one_mass+coulomb+viscous+gravity", "one_mass+coulomb+viscous")
    values = {"J1": 0.02, "M_C": 0.3, "f_v": 0.1, "M_G": 0.5}
    a, b, c = np.random.default_rng(5).normal(size=(3, 50))
    columns = {"J1": c, "M_C": a, "f_v": b, "M_G": a + 0.2 * b}
    space = wide(structure, M_C=(1e-3, 0.7))
    made_up = handed_down(values, seen(values, columns), larger, structure, space)[-1]
    wanted = 0.1 + 0.5 * 0.2 + 0.1 * (a @ b) / (b @ b)  # the tenth that Coulomb friction may not have
    assert made_up["M_C"] == pytest.approx(0.7)
    assert made_up["f_v"] == pytest.approx(wanted)


def test_project_to_submodel__range_without_width__value_stays():
    larger, structure = parse("one_mass+coulomb+viscous+gravity", "one_mass+coulomb+viscous")
    values = {"J1": 0.02, "M_C": 0.5, "f_v": 0.1, "M_G": 0.5}
    a, b, c = np.random.default_rng(5).normal(size=(3, 50))
    columns = {"J1": c, "M_C": a, "f_v": b, "M_G": a + 0.2 * b}
    space = wide(structure, M_C=(0.5, 0.5))
    made_up = handed_down(values, seen(values, columns), larger, structure, space)[-1]
    assert made_up["M_C"] == 0.5
    assert made_up["f_v"] == pytest.approx(0.1 + 0.5 * (0.2 + (a @ b) / (b @ b)))


def test_project_to_submodel__near_collinear__small_steps():
    """They are good to a thousandth or so: what lies below is their error."""
    larger, structure = parse("one_mass+coulomb+viscous+gravity", "one_mass+coulomb+viscous")
    values = {"J1": 0.02, "M_C": 0.3, "f_v": 0.3, "M_G": 0.1}
    a, b, c = np.random.default_rng(6).normal(size=(3, 50))
    columns = {"J1": c, "M_C": a, "f_v": a + 1e-4 * b, "M_G": a + 0.1 * b}
    made_up = handed_down(values, seen(values, columns), larger, structure, wide(structure))[-1]
    assert made_up["M_C"] + made_up["f_v"] == pytest.approx(0.7, rel=0.05)
    assert 0.3 < made_up["M_C"] < 0.4
    assert 0.3 < made_up["f_v"] < 0.4


def test_fit_all__each_fit__has_information_matrix(friction):
    task, fitted = friction
    assert len(fitted) == 16
    told = [f for f in fitted.values() if f.information is not None]
    assert len(told) >= 12
    for f in told:
        problem, space = task.problem_and_space(f.structure)
        value = np.array(list(f.values.values()))
        assert tuple(f.values) == space.names
        curvature = normal_equations(problem, space, task.settings, space.to_scaled(value)[None]).curvature[0]
        assert f.information == pytest.approx(information(curvature, space.scale_derivative(value)), rel=1e-6)


def test_confounded_starts__sizes_of_one_unit__exchanged():
    (structure,) = parse("two_mass+coulomb+viscous+gravity+backlash+current_control+delay")
    values = {name: 10.0 + i for i, name in enumerate(structure.parameters)} | {"M_C": 0.5, "T_d": 0.25}
    found = exchanged(values, structure, {"M_C": 0.5})
    assert found == [{**values, "M_G": values["M_G"] + 0.5}, {**values, "M_G": values["M_G"] - 0.5}]
    found = exchanged(values, structure, {"T_d": 0.25})
    assert found == [{**values, "T_1": values["T_1"] + 0.25}, {**values, "T_1": values["T_1"] - 0.25}]
    assert exchanged(values, structure, {"f_v": 1.0}) == []
    assert exchanged(values, structure, {"alpha": 1.0, "J2": 1.0}) == []


def test_fit_all__friction_and_gravity_cancel__submodel_is_found(friction):
    """Where the motion hardly turns they cancel, and friction alone would hold the drive that large."""
    task, _ = friction
    larger, structure = parse("one_mass+coulomb+gravity", "one_mass+coulomb")

    def fitted(structure, **values):
        problem, space = task.problem_and_space(structure)
        theta = space.to_scaled(np.array([values[name] for name in space.names]))
        there = normal_equations(problem, space, task.settings, theta[None])
        pace = space.scale_derivative(space.from_scaled(theta))
        return StructureFit(
            structure, values, float(there.cost[0]), len(values), information=information(there.curvature[0], pace)
        )

    own = fitted(structure, J1=0.04, M_C=0.1)
    ridge = fitted(larger, J1=0.02, M_C=1.6, M_G=1.3)
    assert ridge.cost < 0.5 * own.cost
    found, _ = refit_from_supermodel(task, own, [ridge], Options())
    assert found.cost <= 1.001 * fitted(structure, J1=0.02, M_C=0.3).cost
    assert found.values == pytest.approx({"J1": 0.02, "M_C": 0.3}, rel=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_refit_from_supermodel__load_over_many_periods__is_found_from_far_off(seed):
    """All parameters are a third off. On the whole recording one of five descents ends at the optimum."""
    structure = function_set().parse("two_mass+viscous+pendulum@2")
    values = {
        "J1": 0.01,
        "J2": 0.0075,
        "c1": 19.3,
        "d1": 0.022,
        "f_v": 0.0285,
        "G@2": 4.0,
        "k@2": 0.6,
        "phi_0@2": -0.52,
    }
    u, noise = PAPER_EXPERIMENT.torque(), 0.01 * PAPER_EXPERIMENT.speed
    task = simulated_task(str(structure), values, u, noise, dt=PAPER_EXPERIMENT.dt, f_tanh=200.0)
    least = float(task.problem(structure).costs({n: np.array([v]) for n, v in values.items()}, task.settings)[0])
    factors = np.exp(0.3 * np.random.default_rng(seed).standard_normal(len(values)))
    begin = {name: value * f for (name, value), f in zip(values.items(), factors, strict=True)}
    start = StructureFit(structure, begin, np.inf, len(begin))
    found, _ = refit_from_supermodel(task, start, [start], Options(), anyway=True, growing=True)
    assert found.cost <= 1.001 * least


def test_refit_from_supermodel__further_mass__masses_are_joined(task, true_values):
    """Behind a stiff shaft: without its last mass alone, half of the load would be missing."""
    truth, larger = PAPER.parse("two_mass+coulomb"), PAPER.parse("three_mass+coulomb")
    split = true_values | {"J2": 0.5 * true_values["J2"], "J3": 0.5 * true_values["J2"], "c2": 1e5, "d2": 1.0}
    fitted = StructureFit(larger, split, 1.0, len(split))
    own = StructureFit(truth, true_values, np.inf, len(true_values))
    begin, _ = refit_from_supermodel(task, own, [fitted], Options(rounds=0))
    exact = {name: np.array([value]) for name, value in true_values.items()}
    assert begin.cost == pytest.approx(float(task.problem(truth).costs(exact, task.settings)[0]))
    assert begin.values == pytest.approx(true_values)


def test_fit_multistart__narrow_ranges__fewer_starts(task, true_values):
    truth = PAPER.parse("two_mass+coulomb")
    narrow = replace(task, bounds={name: (0.5 * v, 2.0 * v) for name, v in true_values.items()})
    spent = [
        fit_multistart(each, truth, Options(fresh=4, narrow=starts), 0).spent.sets
        for each in (narrow, task)
        for starts in (2, 4)
    ]
    assert spent[0] < 0.8 * spent[1]
    assert spent[2] == spent[3]
