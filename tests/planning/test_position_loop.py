"""Closed loop of a plan: the reference solver, a sampled controller, dead time, gains and files."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from brightgrey import SettingsError, plan
from brightgrey.control.design.cascade import Cascade
from brightgrey.control.design.closed_loop import Reference, closed_loop
from brightgrey.control.design.controllers import CascadeController
from brightgrey.kit import Structure, assemble
from brightgrey.planning.envelope import MotionCommand, command_of, envelope, nominal_reaction, reaction
from brightgrey.planning.limits import read_limits
from brightgrey.planning.position_loop import PositionLoop, setpoint_along
from brightgrey.recordings.units.signals import Units
from brightgrey.simulation import Settings, response
from brightgrey.simulation.reference import reference
from support.planning import DT, QUICK, STRUCTURE, TORQUE, T, known_drive, small_run
from support.small_runs import call

LOOP = PositionLoop(30.0, 1.0, 0.05)
GAINS = {"position_gain": 30.0, "speed_gain": 1.0, "reset_time": 0.05}


def integral(x, dt=DT):
    return np.concatenate([[0.0], np.cumsum(0.5 * dt * (x[1:] + x[:-1]))])


@pytest.fixture(scope="module")
def drive():
    return replace(known_drive(), loop=LOOP)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return small_run(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def made(run):
    return plan(run, limits={"torque": 2.5, "travel": 3.0}, controller=GAINS, effort=QUICK)


def test_reaction__drive_other_than_identified__torque_moves_the_reference_and_obeys_the_controller(drive):
    # The motion by the reference solver and the law of the controller for it make up the closed loop. The motion runs
    # free of the controller, so that errors of the torque between samples grow.
    command = command_of(drive, np.where(T < 0.68, TORQUE, 0.0))
    values = {"J1": np.array([0.025, 0.02]), "M_C": np.array([1.2, 0.8]), "f_v": np.array([0.03, 0.02])}
    found = reaction(drive, STRUCTURE, values, command)
    for k in range(2):
        own = {name: float(value[k]) for name, value in values.items()}
        (v,) = reference(STRUCTURE, own, found.torque[:, k], DT, f_tanh=drive.settings.f_tanh)
        assert np.abs(v - found.velocity[0, :, k]).max() < 2e-4 * np.abs(v).max()
        q, (q_ref, v_ref, ahead) = integral(v), command.setpoint
        e = LOOP.position_gain * (q_ref - q) + v_ref - v
        law = ahead + LOOP.speed_gain * (e + integral(e) / LOOP.reset_time)
        assert np.abs(law - found.torque[:, k]).max() < 0.01 * np.abs(law).max()
        assert np.abs(found.torque[:, k] - ahead).max() > 0.1 * np.abs(law).max()  # the controller does something


@pytest.mark.parametrize("structure", ["two_mass+coulomb+viscous+backlash", "two_mass+viscous+current_control+delay"])
def test_around__gap_lag_and_dead_time__as_a_fast_sampled_controller(structure):
    values = {"J1": 0.012, "J2": 0.008, "c1": 75.0, "d1": 0.036, "M_C": 0.1, "f_v": 0.02, "alpha": 0.01}
    values |= {"T_1": 1e-3, "T_d": 2e-3}
    dt, samples = 2.5e-4, 1200
    t = dt * np.arange(samples)
    v_ref = 4.0 * np.sin(2.0 * np.pi * 4.0 * t) ** 2
    setpoint = setpoint_along(integral(v_ref, dt), v_ref, 0.02 * np.gradient(v_ref, dt), dt)
    own = {name: values[name] for name in Structure.parse(structure).parameters}
    system = assemble(Structure.parse(structure), own, 20.0, ("position", "velocity"))
    settings, gains = Settings(20.0, 5.0), PositionLoop(20.0, 0.6, 0.06)
    closed, w = gains.around(system), gains.reference_input(setpoint, dt)
    q, v, z = response(closed, w, dt, np.zeros(len(closed.states)), settings).y
    torque = gains.torque(w, q, v, z)[:, 0]

    q_ref, v_ref, ahead = setpoint
    names = list(system.state_names)
    cascade = Cascade(gains.position_gain, gains.speed_gain, gains.reset_time, (), ())
    controller = CascadeController(
        cascade, Reference(q_ref, v_ref, v_ref, ahead), dt, names.index("q1"), names.index("v1")
    )
    sampled = closed_loop(system, controller, samples, dt, settings)
    # The sampled controller holds its torque, which delays it by half a sample.
    assert np.abs(sampled.u - torque).max() < 0.06 * np.abs(torque).max()
    assert np.abs(sampled.state("q1") - q[:, 0]).max() < 0.01 * np.ptp(q)


def test_command__closed_loop__setpoint_ends_at_rest_and_the_identified_drive_needs_little_more(drive):
    torque = np.where(T < 0.68, TORQUE, 0.0)
    command = command_of(drive, torque)
    assert command.setpoint.velocity[0] == command.setpoint.velocity[-1] == 0.0
    np.testing.assert_allclose(
        np.gradient(command.setpoint.position, DT)[1:-1], command.setpoint.velocity[1:-1], atol=0.1
    )
    demanded = nominal_reaction(drive, command).torque[:, 0]
    assert np.abs(demanded - torque)[T < 0.7].max() < 0.01 * np.abs(torque).max()
    assert command_of(replace(drive, loop=None), torque).setpoint is None


def test_plan__closed_loop__limits_hold_for_the_torque_that_the_controller_demands(made):
    drive, limits = made.drive, made.limits
    draws = drive.draws(500, np.random.default_rng(99))
    seen = envelope(drive, STRUCTURE, draws, made.command, limits)
    assert seen.share_kept() >= 0.985  # 99 % of other draws; three standard deviations of a share of 500 are 1.3 %
    demanded = reaction(drive, STRUCTURE, draws, made.command).torque
    assert np.quantile(np.abs(demanded).max(axis=0), 0.99) <= limits.torque
    assert np.abs(demanded - made.command.torque[:, None]).max() > 0.0
    travel = [np.ptp(reaction(d, STRUCTURE, draws, c).position[0], axis=0).std() for d, c in _both_loops(made)]
    assert travel[1] < 0.5 * travel[0]  # the controller keeps the drive on its way


def _both_loops(made):
    free = replace(made.drive, loop=None)
    return (free, MotionCommand(made.command.torque, None)), (made.drive, made.command)


def test_plan__closed_loop__files_hold_the_setpoint_and_the_gains(made):
    head, *rows = made.csv_text().splitlines()
    assert head == (
        "t [s],setpoint position [rad],setpoint velocity [rad/s],setpoint acceleration [rad/s²],"
        "feed-forward torque [N m]"
    )
    table = np.array([[float(x) for x in row.split(",")] for row in rows])
    assert table[0, 1:3].tolist() == [0.0, 0.0]
    assert table[-1, 2] == 0.0
    data = tomllib.loads(made.toml_text())
    assert data["controller"] == GAINS
    assert any("controller and the feed-forward together demand" in text for text in made.cautions())


def test_plan__closed_without_gains__takes_those_that_suit_the_model(run):
    found = plan(run, loop="closed", effort=QUICK)
    assert found.drive.loop.speed_gain > 0.0
    assert "designed for the model" in found.toml_text()
    assert "set them in the drive" in " ".join(found.cautions())


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"position_gain": 30.0, "speed_gain": 1.0}, "reset_time of the controller is missing; a positive number in s"),
        ({**GAINS, "speed_gain": -1.0}, "speed_gain of the controller is -1.0; a positive number in N m s/rad"),
        ({**GAINS, "gain": 1.0}, "unknown gain of the controller 'gain'"),
        (
            {"position_gain": 1e4, "speed_gain": 1.0, "reset_time": 1e-3},
            "the identified drive is unstable with these gains of the controller",
        ),
    ],
)
def test_plan__wrong_gains__one_line(run, given, message):
    with pytest.raises(SettingsError) as error:
        plan(run, controller=given)
    assert str(error.value).startswith(message)


def test_gains__in_units_of_the_recording__become_si_and_back():
    units = Units("N", "mm")
    loop = PositionLoop.of({"position_gain": 30.0, "speed_gain": 0.2, "reset_time": 0.05}, units)
    assert loop.speed_gain == pytest.approx(200.0)  # N s/m
    assert loop.shown(units)["speed_gain"] == (pytest.approx(0.2), "N s/mm")


def test_limits_file__table_of_gains__is_kept_apart(tmp_path):
    path = tmp_path / "limits.toml"
    path.write_text("torque = 2.5\n[controller]\nposition_gain = 30.0\n", encoding="utf-8")
    assert read_limits(path) == ({"torque": 2.5}, {"position_gain": 30.0})
    path.write_text("controller = 3\n", encoding="utf-8")
    with pytest.raises(SettingsError, match="controller is 3; a table of gains is wanted"):
        read_limits(path)


def test_command__closed_loop_with_a_wrong_gain__one_line(run, tmp_path):
    limits = tmp_path / "limits.toml"
    limits.write_text("[controller]\nposition_gain = 30.0\n", encoding="utf-8")
    done = call("plan", run, "--limits", limits, "--out", tmp_path / "next")
    assert done.code == 2
    assert "speed_gain of the controller is missing" in done.err
