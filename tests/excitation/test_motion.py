import numpy as np
import pytest

from brightgrey.errors import SettingsError
from brightgrey.excitation import MotionLimits, driving_torque, moves, reversing

LIMITS = MotionLimits(speed=3.0, acceleration=40.0, jerk=900.0)
DT = 1e-4


@pytest.fixture(scope="module")
def motion():
    return reversing(1.2, LIMITS, dt=DT, samples=14_000, before=0.05, between=0.1)


def test_reversing__long_move__reaches_and_keeps_its_limits(motion):
    jerk = np.diff(motion.acceleration) / DT
    assert np.max(np.abs(motion.velocity)) == pytest.approx(3.0, rel=1e-9)
    assert np.max(np.abs(motion.acceleration)) == pytest.approx(40.0, rel=1e-9)
    assert np.max(np.abs(jerk)) == pytest.approx(900.0, rel=1e-6)


def test_reversing__position_velocity_acceleration__are_derivatives(motion):
    # The trapezoidal rule is exact for acceleration but where the jerk steps: off by jerk dt²/4 there at
    # most. For position it is off by acceleration dt²/8 at most.
    middle = 0.5 * (motion.acceleration[1:] + motion.acceleration[:-1]) * DT
    np.testing.assert_allclose(np.diff(motion.velocity), middle, atol=900.0 * DT**2 / 4)
    middle = 0.5 * (motion.velocity[1:] + motion.velocity[:-1]) * DT
    np.testing.assert_allclose(np.diff(motion.position), middle, atol=40.0 * DT**2 / 8)


def test_reversing__whole_motion__goes_forth_and_back_and_rests(motion):
    assert np.max(motion.position) == pytest.approx(1.2, abs=1e-12)
    assert motion.position[-1] == pytest.approx(0.0, abs=1e-12)
    resting = (motion.velocity == 0.0) & (motion.acceleration == 0.0)
    assert np.all(resting[motion.t < 0.05])
    assert resting[-1]
    between = motion.t[resting & np.isclose(motion.position, 1.2)]
    assert np.ptp(between) == pytest.approx(0.1, abs=2 * DT)
    # Back is forth turned round.
    np.testing.assert_allclose(np.min(motion.velocity), -np.max(motion.velocity))


def test_moves__too_short_for_full_speed__keep_the_limits():
    short = moves((0.01, 0.02), LIMITS, dt=DT, samples=4000, before=0.0, between=0.05)
    assert np.max(short.velocity) < 3.0
    assert np.max(np.abs(np.diff(short.acceleration))) <= 900.0 * DT * (1 + 1e-9)
    assert short.position[-1] == pytest.approx(0.02, abs=1e-12)


def test_driving_torque__motion__is_inertia_times_acceleration(motion):
    np.testing.assert_array_equal(driving_torque(motion, 0.5), 0.5 * motion.acceleration)


def test_moves__no_targets__rest():
    still = moves((), LIMITS, dt=DT, samples=5, before=0.0, between=0.0)
    assert not np.any(still.position)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"samples": 3000}, "the moves end at"),
        ({"dt": 0.0}, "dt = 0"),
        ({"before": -1.0}, "rests"),
    ],
)
def test_reversing__wrong_argument__is_refused_by_name(change, message):
    request = {"dt": DT, "samples": 14_000, "before": 0.05, "between": 0.1} | change
    with pytest.raises(SettingsError, match=message):
        reversing(1.2, LIMITS, **request)


def test_motion_limits__not_positive__are_refused():
    with pytest.raises(SettingsError, match="limit of jerk = 0"):
        MotionLimits(1.0, 1.0, 0.0)
