"""Symptoms of fits that lack something, and none of a good fit."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from brightgrey.effects import registry
from brightgrey.estimation import fit
from brightgrey.estimation.diagnostics.residual_tests import Candidate, detect_regressors
from brightgrey.estimation.diagnostics.spectral_peaks import highest_peak
from brightgrey.estimation.diagnostics.symptoms import symptoms
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.uncertainty.estimates import Estimate
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER, Placed
from brightgrey.kit.in_words import effect_in_words
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

TORQUE = E.torque()
RIGID = {"J1": 0.02, "M_C": 0.9, "f_v": 0.02}


def recording(y, u=TORQUE, kind="velocity"):
    return make_recording(u, y, dt=E.dt, kind=kind, unit="rad/s")


def measured_from(text, values, *, u=TORQUE, pole=0.0, noise=1e-3, hold="linear", beside=0.0):
    """Speed by the reference solver with coloured noise, and what is added to it, in parts of its peak."""
    y = reference(text, values, u, E.dt, f_tanh=E.f_tanh, hold=hold).reshape(-1)
    white = np.random.default_rng(4).standard_normal(y.size + 200)
    coloured = lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)[200:]
    return recording(y + np.abs(y).max() * (noise * coloured + beside), u)


def symptoms_of(text, measured):
    found = fit(PAPER.parse(text), [measured], f_tanh=E.f_tanh, starts=3, patience=0)
    return {s.title: s for s in found.symptoms}


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_symptoms__true_structure__has_none(pole):
    assert symptoms_of("one_mass+coulomb+viscous", measured_from("one_mass+coulomb+viscous", RIGID, pole=pole)) == {}


@pytest.mark.parametrize(
    ("missing", "left"),
    [("coulomb", "one_mass+viscous"), ("viscous", "one_mass+coulomb"), ("gravity", "one_mass+coulomb+viscous")],
)
def test_symptoms__missing_effect__is_suspected(missing, left):
    values = RIGID | {"M_G": 0.3}
    text = "one_mass+coulomb+viscous+gravity"
    present = left if missing == "gravity" else f"{left}+gravity"
    found = symptoms_of(present, measured_from(text, values))
    title = f"{registry()[missing].title} suspected"
    assert title in found
    assert effect_in_words(Placed(missing)) in found[title].advice
    assert registry()[missing].residual_signature in found[title].observation


def test_symptoms__missing_friction_at_another_mass__is_suspected_there():
    values = {"J1": 0.01, "J2": 0.01, "c1": 60.0, "d1": 0.02, "M_C": 0.4, "M_C@2": 0.6}
    found = symptoms_of("two_mass+coulomb", measured_from("two_mass+coulomb+coulomb@2", values))
    symptom = found["Coulomb friction at mass 2 suspected"]
    assert "the sign of speed of mass 2" in symptom.observation
    assert "Coulomb friction at mass 2" in symptom.advice


def test_symptoms__friction_that_the_model_has_too_much_of__is_not_called_missing_at_another_mass():
    measured = measured_from("two_mass+coulomb", {"J1": 0.01, "J2": 0.01, "c1": 60.0, "d1": 0.02, "M_C": 0.4})
    found = fit(PAPER.parse("two_mass+coulomb"), [measured], f_tanh=E.f_tanh, fixed={"M_C": 0.9}, starts=3, patience=0)
    titles = [s.title for s in found.symptoms]
    assert "Friction is elsewhere" in titles
    assert "Coulomb friction at mass 2 suspected" not in titles


def test_symptoms__effect_without_a_size_that_matters__does_not_end_the_fit(monkeypatch):
    """It is tried with its start values: a size that matters is no duty of an effect."""
    monkeypatch.setattr(Placed, "relevant_size", lambda self, scales, values: {})
    values = {"J1": 0.01, "J2": 0.01, "c1": 60.0, "d1": 0.02, "M_C": 0.4, "M_C@2": 0.6}
    assert symptoms_of("two_mass+coulomb", measured_from("two_mass+coulomb+coulomb@2", values))


@pytest.mark.parametrize("periods", [3.3, 18.3])
def test_symptoms__torque_of_any_period_over_the_position__is_named(periods):
    travel = np.ptp(np.cumsum(reference("one_mass+coulomb+viscous", RIGID, TORQUE, E.dt, f_tanh=E.f_tanh)) * E.dt)
    values = RIGID | {"G": 0.2, "k": 2.0 * np.pi * periods / travel, "phi_0": 0.3}
    found = symptoms_of("one_mass+coulomb+viscous", measured_from("one_mass+coulomb+viscous+pendulum", values))
    assert "Torque repeats with the position" in found


def test_symptoms__missing_stribeck_friction__is_suspected():
    values = RIGID | {"M_S": 0.6, "omega_S": 5.5}
    found = symptoms_of("one_mass+coulomb+viscous", measured_from("one_mass+coulomb+viscous+stribeck", values))
    assert "Stribeck friction suspected" in found


@pytest.mark.parametrize("load", [0.002, 0.02])
def test_symptoms__missing_resonance__has_its_frequency(load):
    frequency = 30.0
    values = {"J1": 0.02, "J2": load, "M_C": 0.9}
    reduced = 0.02 * load / (0.02 + load)
    turning = 2.0 * np.pi * frequency
    values |= {"c1": reduced * turning**2, "d1": 2.0 * 0.03 * reduced * turning}
    found = symptoms_of("one_mass+coulomb", measured_from("two_mass+coulomb", values))
    symptom = found["Resonance suspected"]
    assert "a second mass" in symptom.advice
    frequency_of_symptom = float(symptom.observation.split("near ")[1].split(" Hz")[0])
    assert frequency_of_symptom == pytest.approx(frequency, rel=0.1)


def test_symptoms__hum__is_a_peak_not_coherent_with_the_input():
    t = E.dt * np.arange(TORQUE.size)
    found = symptoms_of(
        "one_mass+coulomb+viscous",
        measured_from("one_mass+coulomb+viscous", RIGID, beside=2e-3 * np.sin(2.0 * np.pi * 150.0 * t + 1.0)),
    )
    symptom = found["Peak in the residual"]
    assert float(symptom.observation.split(" at ")[1].split(" Hz")[0]) == pytest.approx(150.0, abs=1.5)
    assert "not coherent" in symptom.advice


def test_symptoms__drift__has_its_size():
    t = np.linspace(-0.5, 0.5, TORQUE.size)
    measured = measured_from("one_mass+coulomb+viscous", RIGID, beside=0.05 * t)
    symptom = symptoms_of("one_mass+coulomb+viscous", measured)["Drift"]
    size = float(symptom.observation.split("by ")[1].split(" rad")[0])
    assert size == pytest.approx(0.05 * np.abs(measured.y).max(), rel=0.2)


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_symptoms__torque_that_drifts__has_its_size(share):
    """A large one bends the parameters so far that the residual alone does not show it."""
    ramp = share * np.abs(TORQUE).max() * np.linspace(-0.5, 0.5, TORQUE.size)
    measured = measured_from("one_mass+coulomb+viscous", RIGID)
    found = symptoms_of("one_mass+coulomb+viscous", recording(measured.y[0], TORQUE - ramp))
    size = float(found["Torque drifts"].observation.split("by ")[1].split(" ±")[0])
    assert size == pytest.approx(share * np.abs(TORQUE).max(), rel=0.1)


def test_symptoms__start_in_another_state__names_the_first_part_and_the_option():
    t = E.dt * np.arange(TORQUE.size)
    measured = measured_from("one_mass+coulomb+viscous", RIGID, beside=0.1 * (t < 0.08) * np.sin(80.0 * t))
    symptom = symptoms_of("one_mass+coulomb+viscous", measured)["Start is off"]
    assert "--initial estimated" in symptom.advice
    assert not symptom.unmodelled
    assert "Start is off" not in symptoms_of(
        "one_mass+viscous", measured_from("one_mass+coulomb+viscous", RIGID)
    )  # what is missing is missing everywhere


def test_symptoms__drift_of_a_few_parts_per_million__does_not_matter():
    """With hardly any noise it is significant all the same."""
    ramp = 2e-5 * np.abs(TORQUE).max() * np.linspace(-0.5, 0.5, TORQUE.size)
    measured = measured_from("one_mass+coulomb+viscous", RIGID, noise=1e-7)
    assert "Torque drifts" not in symptoms_of("one_mass+coulomb+viscous", recording(measured.y[0], TORQUE - ramp))


def with_position(lost, noise=2e-3):
    """Position by the reference solver with noise, without the samples of a slice; and the position of all."""
    q = reference("one_mass+coulomb+viscous", RIGID, TORQUE, E.dt, f_tanh=E.f_tanh, outputs=["position"])[0]
    y = q + noise * np.abs(q).max() * np.random.default_rng(9).standard_normal(q.size)
    kept = np.delete(np.arange(q.size), lost)
    return make_recording(TORQUE[kept], y[kept], dt=E.dt, kind="position"), q


def test_symptoms__lost_samples__are_a_jump_of_the_position_with_time_and_size():
    measured, q = with_position(slice(700, 712))
    found = symptoms_of("one_mass+coulomb+viscous", measured)
    said = found["Position jumps"].observation
    size, std = (float(x) for x in said.split("jump by ")[1].split(" rad")[0].split(" ± "))
    assert size == pytest.approx(q[712] - q[700], abs=0.1 * abs(q[712] - q[700]) + 2.0 * std)
    assert float(said.split(" at ")[1].split(" s")[0]) == pytest.approx(700 * E.dt, abs=3 * E.dt)
    assert "Torque drifts" not in found


def test_symptoms__position_with_all_samples__does_not_jump():
    assert symptoms_of("one_mass+coulomb+viscous", with_position(slice(0))[0]) == {}


@pytest.mark.parametrize("counts", [100, 500, 3000])
def test_symptoms__rounding_of_an_encoder__is_no_jump(counts):
    _, q = with_position(slice(0))
    step = np.abs(q).max() / counts
    measured = make_recording(TORQUE, np.round(q / step) * step, dt=E.dt, kind="position")
    assert "Position jumps" not in symptoms_of("one_mass+coulomb+viscous", measured)


def test_symptoms__one_outlier_in_slow_noise__is_no_jump():
    _, q = with_position(slice(0))
    rng = np.random.default_rng(3)
    noise = np.cumsum(rng.standard_normal(q.size)) + 0.2 * rng.standard_normal(q.size)
    noise[900] += 40.0
    measured = make_recording(TORQUE, q + 1e-4 * np.abs(q).max() * noise, dt=E.dt, kind="position")
    assert "Position jumps" not in symptoms_of("one_mass+coulomb+viscous", measured)


def test_symptoms__jump_of_one_of_two_recordings__names_that_recording():
    measured, other = with_position(slice(700, 712))[0], with_position(slice(0))[0]
    both = [replace(other, name="first.csv"), replace(measured, name="second.csv")]
    found = fit(PAPER.parse("one_mass+coulomb+viscous"), both, f_tanh=E.f_tanh, starts=3, patience=0).symptoms
    said = [s.observation for s in found if s.title == "Position jumps"]
    assert len(said) == 1
    assert "of second.csv to jump" in said[0]


@pytest.mark.parametrize("text", ["one_mass+coulomb+viscous", "one_mass+coulomb+viscous+delay"])
@pytest.mark.parametrize("samples", [3.0, -1.5])
def test_symptoms__one_output_late__is_not_of_one_time(text, samples):
    """A delay of the model takes up most of it: the residual alone hardly shows it."""
    values = {name: (RIGID | {"T_d": 0.004})[name] for name in PAPER.parse(text).parameters}
    y = reference(text, values, TORQUE, E.dt, f_tanh=E.f_tanh, outputs=["position", "velocity"])
    late = np.interp(np.arange(TORQUE.size) - samples, np.arange(TORQUE.size), y[1])
    noise = 1e-3 * np.random.default_rng(7).standard_normal(y.shape) * np.abs(y).max(axis=1, keepdims=True)
    measured = make_recording(TORQUE, np.array([y[0], late]) + noise, dt=E.dt, kind=("position", "velocity"))
    symptom = symptoms_of(text, measured)["Outputs are not of one time"]
    assert ("later" if samples > 0.0 else "earlier") in symptom.observation
    shift = float(symptom.advice.split("=")[1].rstrip("'"))
    assert shift == pytest.approx(-samples * E.dt, rel=0.1)


def test_symptoms__outputs_of_one_time__are_said_to_be_nothing_else():
    text = "one_mass+coulomb+viscous"
    y = reference(text, RIGID, TORQUE, E.dt, f_tanh=E.f_tanh, outputs=["position", "velocity"])
    noise = 5e-3 * np.random.default_rng(8).standard_normal(y.shape) * np.abs(y).max(axis=1, keepdims=True)
    assert symptoms_of(text, make_recording(TORQUE, y + noise, dt=E.dt, kind=("position", "velocity"))) == {}


def test_symptoms__input_with_its_sign_turned__is_named():
    values = {"J1": 0.02, "M_C": 1.2, "f_v": 0.05, "M_G": 0.5}
    measured = measured_from("one_mass+coulomb+viscous+gravity", values)
    found = symptoms_of("one_mass+coulomb+viscous+gravity", replace(measured, u=-measured.u))
    assert "--input-gain -1" in found["Input has the wrong sign"].advice


@pytest.mark.parametrize("text", ["one_mass", "one_mass+viscous"])
def test_symptoms__structure_that_misses_the_motion__is_no_wrong_sign(text):
    values = {"J1": 0.01, "J2": 0.01, "c1": 40.0, "d1": 0.01, "M_C": 1.2, "f_v": 0.05}
    measured = measured_from("two_mass+coulomb+viscous", values)
    assert "Input has the wrong sign" not in {s.title for s in fit(PAPER.parse(text), (measured,)).symptoms}


def test_symptoms__friction_by_direction__is_named():
    pushed = TORQUE.copy()
    clean = reference("one_mass+coulomb+viscous", RIGID, TORQUE, E.dt, f_tanh=E.f_tanh).reshape(-1)
    # More friction forward than backward; a constant part would look like gravity while Coulomb friction holds.
    pushed -= 0.3 * np.abs(clean) / np.abs(clean).max()
    y = reference("one_mass+coulomb+viscous", RIGID, pushed, E.dt, f_tanh=E.f_tanh).reshape(-1)
    y = y + 0.03 * np.random.default_rng(0).standard_normal(y.size)
    found = symptoms_of("one_mass+coulomb+viscous+gravity", recording(y))
    assert "Friction depends on the direction" in found


def test_symptoms__zoh_or_differenced__late_by_less_than_a_sample():
    held = symptoms_of(
        "one_mass+coulomb+viscous", measured_from("one_mass+coulomb+viscous", RIGID, hold="zoh", noise=1e-4)
    )
    symptom = held["Late by less than a sample"]
    assert "zoh" in symptom.advice
    q = reference("one_mass+coulomb+viscous", RIGID, TORQUE, E.dt, f_tanh=E.f_tanh, outputs=["position"]).reshape(-1)
    differenced = np.diff(q, prepend=0.0) / E.dt
    symptom = symptoms_of("one_mass+coulomb+viscous", recording(differenced))["Late by less than a sample"]
    assert "velocity-differenced" in symptom.advice
    assert "Late by less than a sample" not in symptoms_of(
        "one_mass+coulomb+viscous", recording(differenced, kind="velocity-differenced")
    )


def test_symptoms__missing_delay__has_its_size():
    values = RIGID | {"T_d": 0.006}
    found = symptoms_of("one_mass+coulomb+viscous", measured_from("one_mass+coulomb+viscous+delay", values))
    assert float(found["Delay suspected"].observation.split("come ")[1].split(" s")[0]) == pytest.approx(
        0.006, rel=0.05
    )
    assert "dead time" in found["Delay suspected"].advice


def test_symptoms__negligible_effect__is_named():
    found = symptoms_of("one_mass+coulomb+viscous+delay", measured_from("one_mass+coulomb+viscous", RIGID))
    assert "leave out dead time" in found["Dead time is negligible"].advice


def test_symptoms__effect_at_its_bound_and_another_missing__is_not_called_negligible():
    drive = measured_from("two_mass+coulomb+viscous", RIGID | {"J2": 0.008, "c1": 75.0, "d1": 0.03})
    found = symptoms_of("one_mass+coulomb+viscous+delay", drive)
    assert "Dead time is negligible" not in found
    assert "the model lacks something" in found["Dead time is at its lower bound"].advice


def context(text, values, at):
    estimates = {name: Estimate(v, 0.0, (v, v), at.get(name)) for name, v in values.items()}
    return SimpleNamespace(
        problem=SimpleNamespace(structure=PAPER.parse(text)),
        space=SimpleNamespace(names=tuple(values), by_name=lambda _: values),
        best=SimpleNamespace(values=np.array(list(values.values())), residual=np.zeros(3), cost=0.0),
        estimates=SimpleNamespace(by_name=estimates),
    )


def test_symptoms__damping_at_bound_and_delay__another_mass():
    known = scales([measured_from("one_mass+coulomb+viscous", RIGID)])
    values = {"J1": 0.01, "J2": 0.01, "c1": 100.0, "d1": 1e-5, "T_d": 0.01}
    (symptom,) = symptoms(context("two_mass+delay", values, {"d1": "low"}), known)
    assert symptom.title == "Another mass suspected"
    assert "a third mass" in symptom.advice
    assert "d1 is at its lower bound" in symptom.observation
    assert symptoms(context("two_mass+delay", values, {}), known) == ()
    assert symptoms(context("two_mass+delay", values | {"T_d": 1e-3}, {"d1": "low"}), known) == ()


# --- the tests behind it ---


@pytest.mark.parametrize("pole", [0.0, 0.9, 0.99])
def test_highest_peak__noise__is_rare(pole):
    rng = np.random.default_rng(7)
    count = 0
    for _ in range(150):
        e = lfilter([1.0], [1.0, -pole], rng.standard_normal(1200))[200:]
        count += highest_peak(e, rng.standard_normal(1000), (), 1e-3, 0.01) is not None
    assert count <= 6  # 1 % of 150 are 1.5; more than 6 have a probability of 0.1 %


def test_highest_peak__line_of_the_input__is_none():
    rng, t = np.random.default_rng(8), 1e-3 * np.arange(2000)
    hum = np.sin(2.0 * np.pi * 60.0 * t)
    e, u = 0.5 * hum + 0.1 * rng.standard_normal(2000), rng.standard_normal(2000)
    assert highest_peak(e, u, (), 1e-3, 0.01).frequency == pytest.approx(60.0, abs=1.5)
    assert highest_peak(e, u + 30.0 * hum, (), 1e-3, 0.01) is None


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_detect_regressors__noise__is_rare(pole):
    rng, t = np.random.default_rng(9), np.linspace(0.0, 1.0, 1000)
    J = np.column_stack([np.sin(5.0 * t), t**2])
    questions = [Candidate(lambda: (t - 0.5)[:, None], "line"), Candidate(lambda: np.sin(40.0 * t)[:, None], "wave")]
    count = 0
    for _ in range(100):
        e = lfilter([1.0], [1.0, -pole], rng.standard_normal(1200))[200:]
        count += bool(detect_regressors(e - J @ np.linalg.lstsq(J, e, rcond=None)[0], J, [1000], questions, 0.01))
    assert count <= 5


def test_detect_regressors__have_their_size__once_per_kind():
    rng, t = np.random.default_rng(10), np.linspace(0.0, 1.0, 1000)
    J = np.ones((1000, 1))
    waves = [np.sin(w * t)[:, None] for w in (40.0, 41.0)]
    e = 0.5 * waves[0][:, 0] + 0.3 * (t - 0.5) + 0.1 * rng.standard_normal(1000)
    e = e - e.mean()
    questions = [
        Candidate(lambda: (t - 0.5)[:, None], "line", later=True),
        *(Candidate(lambda w=w: w, "wave") for w in waves),
    ]
    first, second = detect_regressors(e, J, [1000], questions, 0.01)
    assert (first.number, second.number) == (1, 0)
    assert first.coefficients[0] == pytest.approx(0.5, rel=0.1)
    assert second.coefficients[0] == pytest.approx(0.3, rel=0.2)


def slipping(v, q, distance):
    """Friction of size 1 that is a spring over a distance after each reversal, and slips then (Jenkins)."""
    course = np.empty(q.size)
    state = 0.0
    for k, step in enumerate(np.diff(q, prepend=q[0])):
        state = np.clip(state + step / distance, -1.0, 1.0)
        course[k] = state
    return course


@pytest.mark.parametrize(
    ("title", "torque"),
    [
        ("Friction grows with the square of speed", lambda v, q: np.sign(v) * (v / np.abs(v).max()) ** 2),
        (
            "Torque or friction depends on the position",
            lambda v, q: (q - 0.5 * (q.max() + q.min())) / (0.5 * np.ptp(q)),
        ),
        ("Torque repeats with the position", lambda v, q: np.sin(4.0 * np.pi * q / np.ptp(q))),
        ("Friction repeats with the position", lambda v, q: np.sign(v) * np.sin(4.0 * np.pi * q / np.ptp(q) + 1.0)),
        ("Friction builds up over a distance", lambda v, q: slipping(v, q, 5e-3 * np.ptp(q)) - np.sign(v)),
    ],
)
def test_symptoms__pattern_that_no_effect_describes__is_named(title, torque):
    text = "one_mass+coulomb+viscous"
    clean = reference(text, RIGID, TORQUE, E.dt, f_tanh=E.f_tanh).reshape(-1)
    y = reference(text, RIGID, TORQUE - 0.3 * torque(clean, np.cumsum(clean) * E.dt), E.dt, f_tanh=E.f_tanh).reshape(-1)
    y = y + 0.03 * np.random.default_rng(0).standard_normal(y.size)
    assert title in symptoms_of(text, recording(y))
