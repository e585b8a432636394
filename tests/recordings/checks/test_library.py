"""Checks of recordings: each finds its fault, and is silent without one."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from brightgrey.errors import RecordingError
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.recordings import Recording, Signal
from brightgrey.recordings.checks.checkup import all_checks, check
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.checks.library import outliers
from brightgrey.simulation.reference import reference

VALUES = {"J1": 0.012, "J2": 0.006, "c1": 300.0, "d1": 0.1, "M_C": 0.4, "f_v": 0.02}
NOISE = {"position": 0.005, "velocity": 0.05}


@pytest.fixture(scope="module")
def motion():
    found = reference(
        "two_mass+coulomb+viscous", VALUES, E.torque(), E.dt, f_tanh=200.0, outputs=("position", "velocity")
    )
    return dict(zip(("position", "velocity"), found, strict=True))


@pytest.fixture
def made(motion):
    """Recordings of the drive: noise on the outputs, and changes that a test makes."""

    def make(*kinds, u=None, masses=(1, 1), **changed):
        rng = np.random.default_rng(3)
        y = {kind: motion[kind] + NOISE[kind] * rng.standard_normal(E.samples) for kind in ("position", "velocity")}
        y |= changed
        signals = tuple(
            Signal(kind, kind, {"position": "rad", "velocity": "rad/s"}[kind], mass=mass)
            for kind, mass in zip(kinds, masses, strict=False)
        )
        outputs = np.array([y[kind] for kind in kinds])
        torque = E.torque() if u is None else u
        return Recording(
            "axis", E.dt * np.arange(E.samples), torque, outputs, Signal("torque", "input", "N m"), signals
        )

    return make


def said(recording, name, *grades):
    return [r for r in check(recording).results if r.check == name and r.grade in (grades or ("stop", "mind", "note"))]


def test_all_checks__each_asks_a_question():
    assert len(all_checks()) >= 15
    assert all(c.question.endswith("?") and c.name for c in all_checks())


def test_check__position_printed_with_five_significant_digits__no_fault(made):
    """A slow reversal repeats the printed number, and its steps are larger where the number is."""
    t = E.dt * np.arange(E.samples)
    exact = 60.0 * np.sin(2.0 * np.pi * t) + 3.0 * np.sin(2.0 * np.pi * 3.3 * t)
    printed = np.array([float(f"{q:.5g}") for q in exact])
    found = check(made("position", position=printed))
    assert not {r.check for r in found.of_grade("stop", "mind")} & {"outliers", "limits", "repeated samples"}


@pytest.mark.parametrize("kinds", [("velocity",), ("position",), ("position", "velocity")])
def test_check__sound_recording__no_fault(made, kinds):
    assert check(made(*kinds)).of_grade("stop", "mind") == ()


@pytest.mark.parametrize("kind", ["velocity", "position"])
def test_input_sign__turned__stops_and_says_the_gain(made, kind):
    found = check(made(kind, u=-E.torque()))
    (stop,) = found.of_grade("stop")
    assert (stop.check, stop.remedy) == ("sign of the input", {"input_gain": -1.0})
    with pytest.raises(RecordingError, match=r"axis: a positive 'torque' slows the motion down.*--no-check"):
        found.refuse()


def test_check__same_recording_twice__is_minded(made):
    """As a second recording, or as the one that is only predicted."""
    found = check([made("velocity"), made("position"), replace(made("velocity"), name="again")]).of_grade("mind")
    assert [(r.check, r.recording) for r in found] == [("same recording", "again")]


def test_remedies__two_recordings_with_one_fault__one_option_for_a_column(made, motion):
    """Their factors differ in the last digits, and an option may name a column once."""
    both = [made("position", "velocity", velocity=factor * motion["velocity"]) for factor in (57.2958, 57.2)]
    (gear,) = check(both).remedies()["gear"]
    assert gear.startswith("velocity=")


@pytest.mark.parametrize("gain", [1.0, -1.0])
def test_input_sign__one_direction_and_friction_that_falls_with_speed__is_left_open(made, gain):
    """Whatever drives a load in one direction at a steady speed, its torque may fall with speed."""
    t, rng = E.dt * np.arange(E.samples), np.random.default_rng(4)
    speed = 20.0 + np.sin(2.0 * np.pi * 0.7 * t)
    torque = gain * (1.0 - 0.1 * (speed - 20.0)) + 0.01 * rng.standard_normal(t.size)
    velocity = speed + 0.01 * rng.standard_normal(t.size)
    assert said(made("velocity", u=torque, velocity=velocity), "sign of the input") == []


def test_input_sign__turned_and_one_direction_from_standstill__stops(made):
    """A fan that is started in steps."""
    u = np.repeat(np.linspace(0.2, 2.0, 10), -(-E.samples // 10))[: E.samples]
    (v,) = reference("one_mass+viscous", {"J1": 1e-3, "f_v": 0.02}, u, E.dt, f_tanh=200.0)
    noisy = v + 0.05 * np.random.default_rng(3).standard_normal(v.size)
    (stop,) = said(made("velocity", u=-u, velocity=noisy), "sign of the input", "stop")
    assert stop.remedy == {"input_gain": -1.0}


def test_input_sign__sine_of_one_frequency__is_left_open(made):
    """The second derivative of a sine is the sine with its sign turned, so that elasticity could turn it."""
    t = E.dt * np.arange(E.samples)
    v = 5.0 * np.sin(40.0 * t)
    recording = made("velocity", u=0.01 * np.gradient(v, E.dt), velocity=v)
    assert check(recording).of_grade("stop") == ()


@pytest.mark.parametrize(
    ("factor", "cause"),
    [(180 / np.pi, "degrees"), (30 / np.pi, "rpm"), (-1.0, "sign is turned"), (3.7, "gear ratio or a unit")],
)
def test_outputs__factor__stops_with_its_cause(made, motion, factor, cause):
    (stop,) = said(made("position", "velocity", velocity=factor * motion["velocity"]), "outputs")
    assert stop.grade == "stop"
    assert cause in stop.sentence
    name, ratio = stop.remedy["gear"][0].split("=")
    assert name == "velocity"
    assert float(ratio) == pytest.approx(1 / factor, rel=0.01)


def test_outputs__late_velocity__says_how_late(made, motion):
    late = np.interp(np.arange(E.samples) - 5.0, np.arange(E.samples), motion["velocity"])
    (mind,) = said(made("position", "velocity", velocity=late), "outputs")
    assert mind.grade == "mind"
    name, shift = mind.remedy["shift"][0].split("=")
    assert name == "velocity"
    assert float(shift) == pytest.approx(-5 * E.dt, abs=0.5 * E.dt)


def test_outputs__position_far_noisier_than_velocity__one_sample_is_found(made, motion):
    """The filter's time is the ratio of the noises; a tenth of the recording would leave 1.3 times the error."""
    rng = np.random.default_rng(0)
    position = motion["position"] + 0.3 * rng.standard_normal(E.samples)
    late = np.interp(np.arange(E.samples) - 1.0, np.arange(E.samples), motion["velocity"])
    velocity = late + 0.1 * rng.standard_normal(E.samples)
    (mind,) = said(made("position", "velocity", position=position, velocity=velocity), "outputs")
    assert float(mind.remedy["shift"][0].split("=")[1]) == pytest.approx(-E.dt, abs=0.3 * E.dt)


def test_outputs__first_sample_far_off__is_no_delay(made, motion):
    """The filter begins with it, and forgets it slowly."""
    noisy = motion["position"] + 0.3 * np.random.default_rng(2).standard_normal(E.samples)
    noisy[0] = 1.0
    assert said(made("position", "velocity", position=noisy), "outputs") == []


def test_outputs__twisted_shaft__is_no_delay(made, motion):
    """The load's position lags by what accelerates the load, which is no delay."""
    load = reference(
        "two_mass+coulomb+viscous", VALUES | {"c1": 30.0}, E.torque(), E.dt, f_tanh=200.0, outputs=("position", "q2")
    )
    recording = replace(
        made("position", "position", masses=(1, 2)),
        y=load + 1e-4 * np.random.default_rng(0).standard_normal(load.shape),
    )
    assert said(recording, "outputs") == []


def test_swapped_channels__torque_for_velocity__is_minded(made, motion):
    noisy = motion["velocity"] + 0.05 * np.random.default_rng(1).standard_normal(E.samples)
    (mind,) = said(made("velocity", u=noisy, velocity=E.torque()), "swapped channels")
    assert "swap --input and --output" in mind.sentence


def test_swapped_channels__elastic_drive__is_minded():
    """Its velocity is smooth and rings; only the order of cause and effect tells."""
    values = VALUES | {"J2": 0.02, "c1": 10.0, "d1": 0.01}
    t = E.dt * np.arange(E.samples)
    u = 2.0 * np.sin(2.0 * np.pi * (2.0 * t + 5.0 * t**2))
    v = reference("two_mass+coulomb+viscous", values, u, E.dt, f_tanh=200.0, outputs=("velocity",))[0]
    noisy = v + 0.01 * np.ptp(v) * np.random.default_rng(1).standard_normal(v.size)
    signals = Signal("torque", "input", "N m"), (Signal("velocity", "velocity", "rad/s"),)
    assert said(Recording("axis", t, noisy, u[None], *signals), "swapped channels", "mind")
    assert said(Recording("axis", t, u, noisy[None], *signals), "swapped channels") == []


def test_swapped_channels__controller_that_answers_to_the_velocity__is_none(made, motion):
    noise = 0.3 * np.random.default_rng(5).standard_normal(E.samples)
    recording = made("velocity", u=E.torque() - 0.5 * np.roll(noise, 1), velocity=motion["velocity"] + noise)
    assert said(recording, "swapped channels") == []


def test_setpoint__polynomial_course__is_minded(made, motion):
    t = np.linspace(0.0, 1.0, E.samples)
    planned = np.round(40.0 * (10 * t**3 - 15 * t**4 + 6 * t**5), 6)
    assert said(made("position", position=planned), "setpoint", "mind")


def test_repeated_samples__at_random__are_counted(made, motion):
    y = motion["velocity"] + 0.05 * np.random.default_rng(1).standard_normal(E.samples)
    for k in np.flatnonzero(np.random.default_rng(2).random(E.samples) < 0.18):
        y[k] = y[max(k - 1, 0)]
    (mind,) = said(made("velocity", velocity=y), "repeated samples")
    assert float(mind.figure.split()[0]) == pytest.approx(18.0, abs=3.0)


def test_repeated_samples__every_eighth_row_of_a_noisy_speed_is_new__suggests_to_keep_these(made):
    """The noise is not much larger than the resolution."""
    t = E.dt * np.arange(E.samples)
    y = 20.0 * np.sin(np.pi * t) + 0.075 * np.random.default_rng(3).standard_normal(E.samples)
    held = 0.05 * np.round(np.repeat(y[::8], 8)[: E.samples] / 0.05)
    (mind,) = said(made("velocity", velocity=held), "repeated samples")
    assert mind.remedy == {"decimate": 8}


def test_repeated_samples__drive_at_rest__no_fault(made, motion):
    """Noise of the speed ends at rest, where an encoder does not move."""
    y = motion["velocity"] + NOISE["velocity"] * np.random.default_rng(3).standard_normal(E.samples)
    y[: E.samples // 2] = 0.0
    assert said(made("velocity", velocity=0.02 * np.round(y / 0.02)), "repeated samples") == []


def test_repeated_samples__every_fourth_row_is_new__suggests_to_keep_these(made, motion):
    (mind,) = said(made("velocity", velocity=np.repeat(motion["velocity"][::4], 4)[: E.samples]), "repeated samples")
    assert mind.remedy == {"decimate": 4}


def test_differenced_velocity__counts_per_sample__names_the_kind(made, motion):
    step = 2e-3
    counts = np.floor(motion["position"] / step)
    y = np.diff(counts, prepend=counts[0]) * step / E.dt
    (mind,) = said(made("velocity", velocity=y), "differenced velocity")
    assert mind.remedy == {"output": ["velocity:velocity-differenced"]}
    rounded = np.round(motion["velocity"] / (step / E.dt)) * step / E.dt
    assert said(made("velocity", velocity=rounded), "differenced velocity") == []


def test_differenced_velocity__fast_motion__names_the_kind(made):
    """Its second differences are those of the motion, its third ones those of the encoder."""
    t = E.dt * np.arange(E.samples)
    counts = np.floor(np.cumsum(5.0 * np.sin(2.0 * np.pi * 20.0 * t)))
    y = np.diff(counts, prepend=counts[0])
    (mind,) = said(made("velocity", velocity=y), "differenced velocity")
    assert mind.remedy == {"output": ["velocity:velocity-differenced"]}


def test_limits__clipped_output__is_minded(made, motion):
    y = np.minimum(motion["velocity"], 0.8 * motion["velocity"].max())
    assert said(made("velocity", velocity=y), "limits", "mind")


def test_outliers__rounded_position_that_stops_and_starts__no_jump(made):
    """A step of the resolution is no jump, however still the drive stands around it."""
    speed = np.zeros(E.samples)
    speed[E.samples // 4 : E.samples // 2] = 2e-3 / E.dt
    rng = np.random.default_rng(2)
    position = np.round(np.cumsum(speed) * E.dt + 2e-5 * rng.standard_normal(E.samples), 4)
    assert said(made("position", position=position), "outliers") == []


def test_outliers__single_sample_and_wrapping_counter(made, motion):
    y = np.array(motion["position"])
    y[900] += 2.0
    (mind,) = said(made("position", position=y), "outliers")
    assert f"{900 * E.dt:g} s" in mind.sentence
    (mind,) = said(made("position", position=np.mod(motion["position"], 3.0)), "outliers")
    assert "wraps around" in mind.sentence


@pytest.mark.parametrize("lost_samples", [10, 40])
def test_outliers__samples_lost_without_a_gap_in_the_time__is_a_jump(made, motion, lost_samples):
    whole = made("position")
    at = int(np.argmax(np.abs(motion["velocity"][: E.samples // 2])))  # where it moves fast
    kept = np.r_[0:at, at + lost_samples : E.samples]
    shorter = replace(whole, t=whole.t[: kept.size], u=whole.u[kept], y=whole.y[:, kept], resolution=np.empty(0))
    (jump,) = said(shorter, "outliers", "mind")
    assert "jumps 1 times" in jump.figure
    assert f"{shorter.t[at - 1]:.6g} s" in jump.sentence


def test_outliers__samples_lost_of_a_smooth_input__is_a_jump_of_it(made):
    """Where the drive hardly moves, its position does not show the loss."""
    t = E.dt * np.arange(E.samples)
    u = np.round(np.sin(2.0 * np.pi * 3.0 * t) + 0.5 * np.sin(2.0 * np.pi * 7.0 * t + 1.0), 3)
    whole = made("position", u=u, position=0.01 * np.random.default_rng(2).standard_normal(E.samples))
    assert said(whole, "outliers") == []
    kept = np.r_[0:600, 610 : E.samples]
    shorter = replace(whole, t=whole.t[: kept.size], u=whole.u[kept], y=whole.y[:, kept], resolution=np.empty(0))
    (jump,) = said(shorter, "outliers", "mind")
    assert f"'torque' jumps at {shorter.t[599]:.6g} s" in jump.sentence


def test_outliers__planned_step_of_the_input__is_no_jump(made):
    u = np.where(np.arange(E.samples) < 300, 0.0, 1.0)
    assert said(made("velocity", u=u), "outliers") == []


def test_outliers__a_long_recording_with_many_steps_of_the_input__takes_little_memory():
    samples = 100_000
    u = np.repeat(np.random.default_rng(1).standard_normal(samples // 100), 100)
    made = Recording(
        "long",
        1e-3 * np.arange(samples),
        u,
        np.cumsum(u)[None],
        Signal("torque", "input", "N m"),
        (Signal("speed", "velocity", "rad/s"),),
    )
    examined = Examined(made)
    tracemalloc.start()
    try:
        list(outliers.run(examined))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 40 * u.nbytes  # a few filtered copies of each channel


def test_outliers__impacts_of_a_gap__are_no_jumps(made):
    found = reference(
        "two_mass+coulomb+viscous+backlash",
        {**VALUES, "alpha": 0.05},
        E.torque(),
        E.dt,
        f_tanh=200.0,
        outputs=("position",),
    )
    noise = NOISE["position"] * np.random.default_rng(5).standard_normal(E.samples)
    assert said(made("position", position=found[0] + noise), "outliers", "mind") == []


def test_resolution__few_steps__is_minded(made, motion):
    step = 0.2 * np.ptp(motion["velocity"])
    assert said(made("velocity", velocity=np.round(motion["velocity"] / step) * step), "resolution", "mind")


def test_constant_channel__output_stops_and_input_is_minded(made):
    assert said(made("velocity", velocity=np.zeros(E.samples)), "constant channel", "stop")
    assert said(made("velocity", u=np.ones(E.samples)), "constant channel", "mind")


def test_same_channel__output_is_the_input__stops(made):
    assert said(made("velocity", velocity=2.0 * E.torque()), "same channel", "stop")


@pytest.mark.parametrize(("late", "noise", "grades"), [(2.3e-3, 1e-5, ["stop"]), (2.3e-3, 1e-2, []), (0.0, 1e-2, [])])
def test_same_channel__output_twice_at_two_times__stops_with_the_time(made, motion, late, noise, grades):
    t, position = E.dt * np.arange(E.samples), motion["position"]
    error = noise * np.std(position) * np.random.default_rng(5).standard_normal(t.size)
    later = np.interp(t - late, t, position) + error
    recording = made("position", "position", masses=(1, 2), position=position)
    found = said(replace(recording, y=np.array([position, later])), "same channel")
    assert [result.grade for result in found if result.grade != "passed"] == grades
    if grades:
        assert float(found[0].figure.split(" and ")[2].split()[0]) == pytest.approx(1e3 * late, abs=0.02)


def test_closed_loop__noise_in_the_input__is_noted(made, motion):
    noise = 0.05 * np.random.default_rng(5).standard_normal(E.samples)
    recording = made("velocity", u=E.torque() - 0.5 * noise, velocity=motion["velocity"] + noise)
    assert said(recording, "closed loop", "note")


def test_drift__ramp_of_torque__is_noted(made):
    ramp = 0.5 * np.abs(E.torque()).max() * np.linspace(-0.5, 0.5, E.samples)
    (note,) = said(made("velocity", u=E.torque() + ramp), "drift")
    assert float(note.figure.split()[3]) == pytest.approx(0.5 * np.abs(E.torque()).max(), rel=0.3)


def test_drift__motion_one_way__may_be_with_the_position():
    """A position that goes one way is like the time: a spring explains the torque as well."""
    t = E.dt * np.arange(2000)
    velocity = 5.0 + 0.2 * np.sin(4.0 * np.pi * t)
    noise = np.random.default_rng(2).standard_normal((2, t.size))
    u = 0.02 * np.gradient(velocity, t) + 0.06 * velocity + 0.2 + 0.3 * (t / t[-1] - 0.5) + 0.1 * noise[0]
    signals = Signal("torque", "input", "N m"), (Signal("velocity", "velocity", "rad/s"),)
    recording = Recording("axis", t, u, (velocity + 0.002 * noise[1])[None], *signals)
    (note,) = said(recording, "drift")
    assert "with the time or with the position" in note.sentence


def test_start__in_motion__is_noted(made):
    whole = made("velocity")
    late = replace(whole, t=whole.t[700:], u=whole.u[700:], y=whole.y[:, 700:])
    assert said(late, "start", "note")
    assert said(whole, "start") == []


def test_motion__one_direction_and_no_acceleration(made, motion):
    noise = 1e-3 * np.random.default_rng(0).standard_normal((2, E.samples))
    found = said(made("velocity", u=0.4 + noise[0], velocity=1.0 + noise[1]), "motion")
    assert [r.grade for r in found] == ["note", "note"]
