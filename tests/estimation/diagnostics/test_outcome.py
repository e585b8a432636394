"""Outcomes of fits, and cautions on what a recording does not identify."""

import re

import numpy as np
import pytest

from brightgrey.estimation import fit, predict
from brightgrey.estimation.diagnostics.chaos import chaos_findings
from brightgrey.estimation.diagnostics.equivalent_models import resolve_lag_pole_exchange
from brightgrey.estimation.diagnostics.finding import Finding
from brightgrey.estimation.diagnostics.informativity import uninformative_reason
from brightgrey.estimation.diagnostics.outcome import Outcome
from brightgrey.estimation.optimisation.least_squares import fit_to_convergence
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.estimation.uncertainty.identifiability import power_product
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

DT, SAMPLES = 1e-3, 1800
F_TANH = 2.5
TORQUE = PAPER_EXPERIMENT.torque()
FORWARD = 1.0 + 0.5 * np.abs(TORQUE)  # never lets the drive turn back


def recording(y, u=TORQUE, *, unit="N m", given=True, kind="velocity", hold="linear", name="made"):
    names = ("torque", "velocity")
    options = {"kind": kind, "unit": "rad/s", "input_unit": unit, "input_unit_given": given, "hold": hold}
    return make_recording(u, y, dt=DT, names=names, name=name, **options)


def measured_from(text, values, u=TORQUE, *, seed=0, hold="linear", **settings):
    """Recording of a drive by the reference solver, with noise of 0.1 % and steps of 0.01 rad/s."""
    y = reference(text, values, u, DT, f_tanh=F_TANH, hold=hold).reshape(-1)
    y = y + 1e-3 * np.abs(y).max() * np.random.default_rng(seed).standard_normal(y.shape)
    return recording(np.round(y, 2), u, **settings)


def fitted(text, *recordings, **settings):
    return fit(PAPER.parse(text), recordings, f_tanh=F_TANH, starts=3, level="fast", **settings)


def texts_of(found, kind):
    texts = [found.outcome.text] if found.outcome.kind == kind else []
    return " | ".join(texts + [f.text for f in found.outcome.findings if f.kind == kind])


RIGID = {"J1": 0.02, "M_C": 0.9}


# --- uninformative recordings ---

RNG = np.random.default_rng(5)
NOISE = RNG.standard_normal(SAMPLES)
NOTHING = {
    "standstill": (0 * TORQUE, TORQUE, "moves by no more than its resolution"),
    "flicker of the last digit": (0.01 * (RNG.random(SAMPLES) < 0.5), TORQUE, "resolution"),
    "constant torque": (np.sin(np.arange(SAMPLES) / 100), 0 * TORQUE + 3.0, "torque never changes"),
    "constant torque, noisy sensor": (np.arange(SAMPLES) / 50, 3.0 + 0.01 * NOISE, "torque never changes"),
    "white noise": (NOISE, TORQUE, "does not follow the input"),
    "slow noise": (np.cumsum(NOISE), TORQUE, "does not follow the input"),
    "stuck at the limit": (0 * TORQUE + 50.0, TORQUE, "resolution"),
    "saturated": (np.clip(1e3 * np.sin(np.arange(SAMPLES) / 60), -5, 5), TORQUE, "is saturated"),
}


@pytest.mark.parametrize("case", NOTHING)
def test_fit__uninformative_recording__says_so_without_a_search(case):
    y, u, says = NOTHING[case]
    found = fitted("two_mass+coulomb+viscous", recording(y, u))
    assert found.evaluations == 1
    assert found.outcome.kind == "not identifiable"
    assert says in found.outcome.text
    assert all(np.isnan(e.std) for e in found.estimates.values())


@pytest.mark.parametrize("noise", [1e-3, 0.1, 1.0])
def test_uninformative_reason__motion_in_noise__is_none(noise):
    clean = measured_from("one_mass+coulomb", RIGID).y[0]
    y = clean + noise * clean.std() * np.random.default_rng(2).standard_normal(SAMPLES)
    assert uninformative_reason(recording(y)) is None
    # White torque and the acceleration it makes at once are white, too, and yet tell all.
    u = np.random.default_rng(3).standard_normal(SAMPLES)
    assert uninformative_reason(recording(u / 0.02 + 5 * NOISE, u, kind="acceleration")) is None


@pytest.mark.parametrize("samples", [20, 40, 70, 200])
def test_uninformative_reason__short_motion__is_none(samples):
    clean = measured_from("one_mass+coulomb", RIGID)
    cut = slice(60, 60 + samples)  # the drive starts here
    assert uninformative_reason(recording(clean.y[:, cut], clean.u[cut])) is None


def test_uninformative_reason__independent_noise__is_given():
    rng = np.random.default_rng(11)
    for pole in (0.0, 0.9, 0.99, 1.0):
        for _ in range(20):
            e = rng.standard_normal(SAMPLES)
            y = e.copy()
            for k in range(1, SAMPLES):
                y[k] += pole * y[k - 1]
            assert uninformative_reason(recording(y)) is not None, pole


def test_fit__one_uninformative_recording_of_two__is_named():
    good, bad = measured_from("one_mass+coulomb", RIGID), recording(0 * TORQUE, name="bad")
    found = fitted("one_mass+coulomb", good, bad)
    assert "bad" in texts_of(found, "uninformative")
    assert found.outcome.kind != "uninformative"


def test_fit__clipped_output__is_saturated():
    y = measured_from("one_mass+coulomb", RIGID).y[0]
    found = fitted("one_mass+coulomb", recording(np.clip(y, -30, 30)))
    assert found.outcome.kind == "saturated"
    pattern = r"in made, velocity is cut off at its limits in \d+ % of the samples"
    assert re.fullmatch(pattern, texts_of(found, "saturated"))
    assert "saturated" not in [f.kind for f in fitted("one_mass+coulomb", recording(y)).outcome.findings]


# --- how fits end ---


def test_outcome__is_the_gravest_finding():
    found = Outcome.of([Finding("sampling", "a"), Finding("at bound", "b"), Finding("not identifiable", "c")])
    assert (found.kind, found.text) == ("not identifiable", "c")
    assert [f.kind for f in found.findings] == ["at bound", "sampling"]
    only = Outcome.of([Finding("sampling", "a")])
    assert only.kind == "converged"
    assert [f.kind for f in only.findings] == ["sampling"]


def test_fit__good_model__converges_without_findings():
    found = fitted("one_mass+coulomb", measured_from("one_mass+coulomb", RIGID))
    assert found.outcome.kind == "converged"
    assert found.outcome.findings == ()


def test_fit__parameter_at_its_bound__is_named():
    found = fitted("one_mass+coulomb", measured_from("one_mass+coulomb", RIGID), bounds={"M_C": (1.0, 2.0)})
    assert found.outcome.kind == "at bound"
    assert found.outcome.text == "M_C at its lower bound"


def test_fit__one_torque_level__either_friction_may_stand_for_both():
    """A square wave: in both directions the drive settles at one speed, which either friction explains."""
    u = np.where(np.arange(SAMPLES) // 450 % 2, -2.0, 2.0)
    slow = {"J1": 0.004, "f_v": 0.05}  # time constant 80 ms
    r = measured_from("one_mass+viscous", slow, u, seed=0)
    alone, both = (
        fitted(text, r, bounds={"J1": (0.001, 0.02)}) for text in ("one_mass+viscous", "one_mass+coulomb+viscous")
    )
    assert both.estimates["M_C"].at_bound == "low"
    low, high = both.estimates["f_v"].ci95
    narrow = np.subtract(*alone.estimates["f_v"].ci95)
    assert low <= slow["f_v"] <= high
    assert low - high < 2.0 * narrow
    assert "with those of f_v" in texts_of(both, "at bound")


def test_fit__divergence__names_recording_and_time():
    r = measured_from("one_mass", {"J1": 0.02})
    found = fitted("one_mass", r, fixed={"J1": 1e-14})
    assert found.outcome.kind == "diverged"
    assert " s" in found.outcome.text
    assert "made" in found.outcome.text


def test_power_product__is_written_with_powers():
    # Slow motion of a nearly massless drive, u = f_v v, with the gain left open by a factor on both sides.
    assert power_product(["J1", "f_v"], [0.7, -0.71]) == "J1/f_v"
    assert power_product(["c1", "J1", "J2"], [2.0, -1.0, -1.0]) == "c1^2/(J1·J2)"
    assert power_product(["c1", "d1"], [-0.5, -0.25]) == "c1^2·d1"


def test_fit__unidentifiable_parameter__is_named():
    # The torque never turns: the shaft stays wound up one way, the gap is never crossed.
    u = 2.0 * np.minimum(DT * np.arange(SAMPLES) / 0.5, 1.0)
    values = {"J1": 0.012, "J2": 0.008, "c1": 75.0, "d1": 0.036, "alpha": 0.01}
    found = fitted("two_mass+backlash", measured_from("two_mass+backlash", values, u))
    assert "this recording does not determine alpha" in texts_of(found, "not identifiable")
    assert np.isnan(found.estimates["alpha"].std)


def test_fit__model_explains_nothing__is_not_identifiable():
    # A load that moves by itself: what follows the torque is a thousandth of it.
    y = measured_from("one_mass", {"J1": 0.02}).y[0]
    wandering = 30 * np.cumsum(NOISE) + y
    assert fitted("one_mass+coulomb+viscous", recording(wandering)).outcome.kind == "not identifiable"


def test_fit__recordings_that_differ__disagree_on_the_parameter():
    one = measured_from("one_mass+coulomb", RIGID, seed=1)
    same = measured_from("one_mass+coulomb", RIGID, seed=2)
    other = measured_from("one_mass+coulomb", RIGID | {"M_C": 0.95}, seed=2)
    agreed, apart = fitted("one_mass+coulomb", one, same), fitted("one_mass+coulomb", one, other)
    assert agreed.outcome.kind == "converged"
    assert apart.outcome.kind == "recordings disagree"
    assert "M_C" in apart.outcome.text
    assert "J1" not in apart.outcome.text
    assert apart.estimates["M_C"].between == pytest.approx(0.05 / np.sqrt(2), rel=0.1)
    assert fitted("one_mass+coulomb", one).estimates["M_C"].between is None


# --- equivalent models and cautions ---

LAGGED = {"J1": 0.02, "f_v": 0.4, "T_1": 0.01}  # J1/f_v is 50 ms


def test_fit__equivalent_model__is_named_and_the_shorter_lag_kept():
    r = measured_from("one_mass+viscous+current_control", LAGGED)
    found = fitted("one_mass+viscous+current_control", r)
    assert "J1/f_v" in texts_of(found, "equivalent model")
    assert "T_1 = 0.05" in texts_of(found, "equivalent model")
    for name, value in LAGGED.items():
        assert found.estimates[name].value == pytest.approx(value, rel=0.02)


def test_lag_pole_exchange__longer_lag__is_exchanged():
    structure = PAPER.parse("one_mass+viscous+current_control")
    r = measured_from(str(structure), LAGGED)
    space = parameter_space(structure, scales([r]), {"J1": (1e-4, 1.0), "T_1": (1e-4, 1.0)}, {})
    problem, settings = SimulationErrorProblem.of(structure, [r]), Settings(F_TANH, 40.0, "fast")
    twin = fit_to_convergence(problem, space, settings, np.array([0.004, 0.4, 0.05]))
    assert twin.values[2] == pytest.approx(0.05, rel=0.02)
    kept, findings = resolve_lag_pole_exchange(problem, space, settings, twin)
    np.testing.assert_allclose(kept.values, list(LAGGED.values()), rtol=0.02)
    assert kept.cost == pytest.approx(twin.cost, rel=1e-3)
    assert [f.kind for f in findings] == ["equivalent model"]


def test_lag_pole_exchange__friction__has_no_equivalent_model():
    r = measured_from("one_mass+coulomb+viscous+current_control", LAGGED | {"M_C": 0.9})
    assert not texts_of(fitted("one_mass+coulomb+viscous+current_control", r), "equivalent model")


def test_cautions__lags_below_a_sample__are_sampling_and_give_their_sum():
    values = {"J1": 0.02, "T_1": 0.0006, "T_d": 0.0007}
    found = fitted("one_mass+current_control+delay", measured_from("one_mass+current_control+delay", values))
    text = texts_of(found, "sampling")
    assert "only T_1 + T_d = 0.001" in text
    assert found.estimates["T_1"].value + found.estimates["T_d"].value == pytest.approx(0.0013, rel=0.03)
    assert "sampling explains it, so it is no evidence of a lag" in text


def test_cautions__zoh_or_differenced__look_like_half_a_sample():
    held = fitted("one_mass+coulomb+delay", measured_from("one_mass+coulomb", RIGID, hold="zoh"))
    assert held.estimates["T_d"].value == pytest.approx(0.5 * DT, abs=0.05 * DT)
    assert "half a sample" in texts_of(held, "sampling")
    assert "zoh" in texts_of(held, "sampling")
    q = reference("one_mass+coulomb", RIGID, TORQUE, DT, f_tanh=F_TANH, outputs=["position"]).reshape(-1)
    differenced = fitted("one_mass+coulomb+delay", recording(np.diff(q, prepend=0.0) / DT))
    assert "velocity-differenced" in texts_of(differenced, "sampling")
    long = fitted("one_mass+coulomb+delay", measured_from("one_mass+coulomb+delay", RIGID | {"T_d": 0.004}))
    assert not texts_of(long, "sampling")


def test_cautions__gravity__confounded_with_offset_or_friction():
    values = {"J1": 0.02, "M_C": 0.3, "M_G": 0.1}
    both = fitted("one_mass+coulomb+gravity", measured_from("one_mass+coulomb+gravity", values))
    assert "offset of the input" in texts_of(both, "confounded")
    assert "never reverses" not in texts_of(both, "confounded")
    one = fitted("one_mass+coulomb+gravity", measured_from("one_mass+coulomb+gravity", values, FORWARD))
    assert "never reverses" in texts_of(one, "confounded")


@pytest.mark.parametrize(
    ("omega_S", "kind", "says"),
    [(25.0, "confounded", "above a third"), (0.6, "not observable", "5/f_tanh"), (5.5, "converged", "minimum")],
)
def test_cautions__stribeck_speed__outside_the_observable_range(omega_S, kind, says):
    values = {"J1": 0.02, "M_C": 0.6, "f_v": 0.02, "M_S": 0.5, "omega_S": omega_S}
    text = "one_mass+coulomb+viscous+stribeck"
    assert says in texts_of(fitted(text, measured_from(text, values)), kind)


def test_cautions__stribeck_without_coulomb__is_confounded():
    values = {"J1": 0.02, "M_S": 0.5, "omega_S": 8.0}
    assert "without Coulomb" in texts_of(
        fitted("one_mass+stribeck", measured_from("one_mass+stribeck", values)), "confounded"
    )


@pytest.mark.parametrize(("unit", "given", "says"), [("V", True, "is in V"), ("N m", False, "has no unit")])
def test_cautions__unknown_gain__leaves_ratios(unit, given, says):
    r = measured_from("one_mass+coulomb+delay", RIGID | {"T_d": 0.004}, unit=unit, given=given)
    text = texts_of(fitted("one_mass+coulomb+delay", r), "scale unknown")
    assert says in text
    assert "J1, M_C only ratios are known" in text
    assert "T_d" not in text


@pytest.mark.parametrize(("d1", "says"), [(3e-3, "times in 0.6 s: intervals"), (3.0, None)])
def test_chaos_findings__free_rattling__intervals_unreliable(d1, says):
    """One whose damper ends every bounce does not."""
    structure = PAPER.parse("two_mass+viscous+backlash")
    values = {"J1": 4.5e-3, "J2": 1e-4, "c1": 1e4, "d1": d1, "f_v": 2e-2, "alpha": 1e-3}
    u = np.sin(2.0 * np.pi * 8.0 * DT * np.arange(600))
    settings = Settings(F_TANH, 1.0)
    y = predict(structure, values, recording(u, u), settings)
    r = recording(y + 1e-3 * RNG.standard_normal(y.shape), u)
    problem, space = SimulationErrorProblem.of(structure, [r]), parameter_space(structure, scales([r]), {}, {})
    best = fit_to_convergence(problem, space, settings, np.array([values[n] for n in space.names]), limit=0)
    found = chaos_findings(problem, space, settings, best)
    assert [f.kind for f in found] == (["chaotic"] if says else [])
    assert not says or says in found[0].text
    fixed = {name: value for name, value in values.items() if name != "f_v"}
    assert bool(texts_of(fit(structure, [r], f_tanh=F_TANH, fixed=fixed, patience=0, starts=1), "chaotic")) == bool(
        says
    )
