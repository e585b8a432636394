"""The drive as a plan knows it: draws of its parameters, and the torque that holds it at standstill."""

from dataclasses import replace

import numpy as np
import pytest

from brightgrey.planning.design import setting_of, torque_of
from brightgrey.planning.drive import RigidDrive
from brightgrey.planning.families import families
from brightgrey.planning.limits import MachineLimits
from support.planning import VALUES, known, known_drive


def with_known(drive, **changed):
    return replace(drive, known=replace(drive.known, model=replace(drive.known.model, **changed)))


def test_draws__parameters_that_the_recordings_know__scatter_by_the_covariance():
    drive = with_known(known_drive(), information=known(information=400.0).information)
    draws = drive.draws(4000, np.random.default_rng(0))
    for name, value in VALUES.items():
        assert np.log(draws[name] / value).std() == pytest.approx(0.05, rel=0.1)  # 1 / sqrt(400), in logarithms


def test_draws__parameter_that_the_recordings_hardly_know__grows_as_its_effect_and_not_exponentially():
    information = ((400.0, 0.0, 0.0), (0.0, 400.0, 0.0), (0.0, 0.0, 0.05))  # of the logarithms of J1, M_C and f_v
    drive = with_known(known_drive(), information=information, values={**VALUES, "f_v": 0.001})
    drive = replace(drive, known=replace(drive.known, bounds={**drive.known.bounds, "f_v": (1e-9, 1e9)}))
    draws = drive.draws(4000, np.random.default_rng(0))
    std = 0.05**-0.5
    assert np.quantile(draws["f_v"], 0.99) == pytest.approx(0.001 * (1.0 + 2.33 * std), rel=0.1)
    assert np.log(draws["J1"] / VALUES["J1"]).std() == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize(
    ("coulomb", "load", "hold"), [(0.2, 1.0, 1.0), (1.0, 0.2, 0.0), (1.0, -0.8, -0.8), (1.0, 0.0, 0.0)]
)
def test_rigid_drive__constant_load__is_held_where_friction_does_not(coulomb, load, hold):
    speeds = np.linspace(-10.0, 10.0, 401)
    rigid = RigidDrive(0.02, speeds, load + coulomb * np.sign(speeds))
    assert rigid.hold == pytest.approx(hold)
    assert rigid.breakaway == pytest.approx(coulomb + abs(load - hold))
    still = rigid.torque(np.zeros(3), np.zeros(3), 0.5)
    np.testing.assert_allclose(still, hold)


def test_torque_of__load_that_falls__begins_and_ends_with_the_torque_that_holds_it():
    drive = known_drive()
    structure = "one_mass+coulomb+viscous+gravity"
    values = {"J1": 0.02, "M_C": 0.1, "f_v": 0.02, "M_G": 0.7}  # the load drives forward
    names = tuple(values)
    information = tuple(tuple(1e3 if i == k else 0.0 for k in range(4)) for i in range(4))
    drive = with_known(drive, structure=structure, values=values, names=names, information=information)
    limits = MachineLimits.of(drive.known.reached, {}, drive.model.units)
    setting = setting_of(drive, limits, 0.8)
    for family in families():
        torque = torque_of(drive, family, np.full(family.numbers, 0.4), setting)
        assert torque[[0, -1]] == pytest.approx(-0.7, abs=0.03), family.name
