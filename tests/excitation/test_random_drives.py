import numpy as np
import pytest

from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.excitation.random_drives import DRIVE_RANGES, modes, random_values
from brightgrey.kit import PAPER

EVERYTHING = PAPER.parse("four_mass+coulomb+viscous+stribeck+gravity+backlash+current_control+delay")


@pytest.fixture(scope="module")
def draws():
    rng = np.random.default_rng(3)
    return [random_values(EVERYTHING.parameters, rng) for _ in range(200)]


def test_random_values__every_structure__has_its_parameters_in_order():
    rng = np.random.default_rng(0)
    for structure in PAPER.structures():
        assert list(random_values(structure.parameters, rng)) == list(structure.parameters)


def test_random_values__many_draws__are_in_the_ranges_and_fill_them(draws):
    peak = np.max(np.abs(E.torque()))
    column = {name: np.array([d[name] for d in draws]) for name in EVERYTHING.parameters}
    for name, (low, high) in {
        "omega_S": np.multiply(DRIVE_RANGES.stribeck_speed, E.speed),
        "T_1": DRIVE_RANGES.current_loop,
        "T_d": DRIVE_RANGES.dead_time,
    }.items():
        assert low <= column[name].min() < 1.2 * low
        assert high / 1.2 < column[name].max() <= high
    friction = column["M_C"] + column["M_S"] + column["f_v"] * E.speed
    assert friction.max() <= DRIVE_RANGES.max_total_friction * peak * (1 + 1e-12)
    assert np.all((np.abs(column["M_G"]) >= 0.01 * peak) & (np.abs(column["M_G"]) <= 0.2 * peak))
    assert 0.35 < np.mean(column["M_G"] > 0.0) < 0.65  # 4.2 standard deviations of 200 coin tosses
    small = column["alpha"] <= DRIVE_RANGES.small_gap[1]
    assert 0.35 < np.mean(small) < 0.65
    large = 2.0 * column["alpha"][~small] / E.distance
    assert np.all((large >= DRIVE_RANGES.large_gap[0]) & (large <= DRIVE_RANGES.large_gap[1]))


def test_random_values__resonances_and_damping_ratios__are_in_their_ranges(draws):
    for d in draws:
        J = np.array([d[f"J{i}"] for i in range(1, 5)])
        assert J.max() / J.min() <= DRIVE_RANGES.inertia_ratio
        c, dampers = (np.array([d[f"{s}{k}"] for k in range(1, 4)]) for s in "cd")
        frequency, ratio = modes(J, c, dampers)
        assert np.all((frequency >= 5.0) & (frequency <= 200.0))
        assert np.all((ratio >= 0.01) & (ratio <= 0.3))


def test_modes__two_masses__equal_the_textbook_formulas():
    J1, J2, c, d = 0.3, 0.1, 50.0, 0.2
    both = 1 / J1 + 1 / J2
    frequency, ratio = modes(np.array([J1, J2]), np.array([c]), np.array([d]))
    assert frequency[0] == pytest.approx(np.sqrt(c * both) / (2 * np.pi), rel=1e-12)
    assert ratio[0] == pytest.approx(0.5 * d * np.sqrt(both / c), rel=1e-12)
    assert np.all(np.isnan(modes(np.array([J1, J2]), np.array([c]), np.array([d * 100]))[0]))


def test_random_values__same_seed__gives_the_same_drive():
    one, two = (random_values(EVERYTHING.parameters, np.random.default_rng(5)) for _ in range(2))
    assert one == two


def test_random_values__unknown_parameter__is_refused():
    with pytest.raises(KeyError):
        random_values(["J1", "M_X"], np.random.default_rng(0))
