"""The frozen recording, its resolution, windows and decimation."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from brightgrey.errors import BrightgreyError
from brightgrey.recordings import Recording, cut_window, decimate, recording_from
from brightgrey.recordings.sample_values import resolution
from brightgrey.recordings.window import coarse_input
from support.recordings import make_recording

N = 1001
DT = 1e-3


def make(u: np.ndarray, *rows: np.ndarray, kind: str = "velocity", hold: str = "linear", dt: float = DT) -> Recording:
    rows = rows or (np.cumsum(u) * dt,)
    return make_recording(u, np.array(rows), dt=dt, kind=[kind] * len(rows), hold=hold)


U = np.random.default_rng(3).normal(size=N)


def test_recording__arrays__are_frozen_copies() -> None:
    u = U.copy()
    recording = make(u)
    u[0] = 9.0
    assert recording.u[0] == U[0]
    for array in (recording.t, recording.u, recording.y, recording.resolution):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        recording.hold = "zoh"  # type: ignore[misc]
    assert recording.y.shape == (1, N)
    assert (recording.samples, recording.dt) == (N, DT)


@pytest.mark.parametrize(
    "change",
    [
        {"u": U[:-1]},
        {"y": np.zeros((2, N))},
        {"t": np.zeros(N)},
        {"t": np.sqrt(np.arange(N))},
        {"u": np.where(np.arange(N) == 5, np.nan, U)},
        {"hold": "cubic"},
        {"t": np.arange(3.0), "u": U[:3], "y": U[None, :3]},
        {"outputs": ()},
    ],
)
def test_recording__inconsistent_fields__are_refused(change: dict[str, object]) -> None:
    with pytest.raises(BrightgreyError):
        dataclasses.replace(make(U), **change)


@settings(max_examples=100, deadline=None)
@given(
    step=st.floats(1e-9, 1e3),
    offset=st.floats(-1e3, 1e3),
    counts=st.lists(st.integers(-3000, 3000), min_size=20, max_size=60).filter(lambda c: len(set(c)) > 1),
)
def test_resolution__lattice__is_its_step(step: float, offset: float, counts: list[int]) -> None:
    values = step * (offset + np.array(counts))
    differences = np.diff(np.unique(counts))
    # Steps are only known as far as they occur: the smallest one, if the others are its multiples.
    if (differences % differences.min() == 0).all():
        assert resolution(values) == pytest.approx(step * differences.min(), rel=1e-6)


def test_resolution__no_lattice__is_the_spacing_of_the_numbers() -> None:
    values = np.random.default_rng(0).normal(size=2000)
    assert resolution(values) == np.spacing(np.abs(values).max())
    single = values.astype(np.float32)
    assert resolution(single.astype(np.float64)) == np.spacing(np.abs(single).max())
    assert resolution(np.full(20, 3.0)) == np.spacing(np.float32(3.0))
    assert resolution(np.zeros(20)) > 0


def test_resolution__fixed_number_of_significant_digits__is_that_of_the_usual_values() -> None:
    values = np.array([float(f"{v:.5g}") for v in 60.0 * np.sin(np.linspace(0.0, 30.0, 4000))])
    assert resolution(values) == pytest.approx(1e-3)
    decimals = np.round(60.0 * np.sin(np.linspace(0.0, 30.0, 4000)), 2)
    assert resolution(decimals) == pytest.approx(1e-2)
    rests = np.round(
        100.0 * np.sin(np.concatenate([np.linspace(0.0, np.pi / 2.0, 1000), np.full(1000, np.pi / 2.0)])), 4
    )
    assert resolution(rests) == pytest.approx(1e-4)


def test_resolution__differenced_encoder__is_one_count_per_interval() -> None:
    position = np.floor(np.cumsum(np.random.default_rng(1).uniform(0, 7, 500))) * 4.6592e-6
    assert resolution(np.diff(position) / 1e-3) == pytest.approx(4.6592e-3, rel=1e-9)


def test_cut_window__both_ends__are_included() -> None:
    part = cut_window(make(U), 0.1, 0.3)
    assert (part.samples, part.t[0], part.dt) == (201, 0.1, DT)
    np.testing.assert_array_equal(part.u, U[100:301])
    assert cut_window(make(U), None, 0.3).samples == 301
    assert cut_window(make(U), 0.3).samples == N - 300
    with pytest.raises(BrightgreyError, match=r"goes from 0 to 1 s"):
        cut_window(make(U), 2.0)


@pytest.mark.parametrize("n", [2, 3, 7, 10])
@pytest.mark.parametrize("hold", ["linear", "zoh"])
def test_decimate__n__keeps_every_nth_sample(n: int, hold: str) -> None:
    full = make(U, hold=hold)
    part = decimate(full, n)
    np.testing.assert_array_equal(part.t, full.t[::n])
    np.testing.assert_array_equal(part.y, full.y[:, ::n])
    assert part.u.shape == part.t.shape
    assert part.dt == pytest.approx(n * DT, rel=1e-12)
    assert decimate(full, 1) is full
    with pytest.raises(BrightgreyError, match="too few"):
        decimate(full, 100)


@pytest.mark.parametrize("n", [2, 5])
def test_coarse_input__straight_line__is_unchanged(n: int) -> None:
    line = 2.0 - 3.0 * np.arange(101)
    np.testing.assert_allclose(coarse_input(line, n, "linear"), line[::n], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(coarse_input(np.ones(101), n, "zoh"), 1.0, rtol=1e-15)


@pytest.mark.parametrize("n", [2, 5, 10])
def test_coarse_input__any_input__keeps_its_integral(n: int) -> None:
    u = U[:1001]
    coarse = coarse_input(u, n, "linear")
    assert np.trapezoid(coarse, dx=n) == pytest.approx(np.trapezoid(u), rel=1e-9)
    held = coarse_input(u, n, "zoh")
    assert n * held[:-1].sum() == pytest.approx(u[: (held.size - 1) * n].sum(), rel=1e-9)


def response(u: np.ndarray, dt: float, hold: str) -> np.ndarray:
    """Velocity of a two-mass drive with a resonance at 24 Hz, exact for the input as it is held."""
    w = 2 * np.pi * 20
    a = np.array([[-2, -w * w / 2, 0], [1, 0, -1], [0, w * w / 2, -1.0]])
    block = np.zeros((5, 5))
    block[:3, :3], block[0, 3], block[3, 4] = a * dt, dt, 1
    e = scipy.linalg.expm(block)
    step, level, ramp = e[:3, :3], e[:3, 3], e[:3, 4] * (hold == "linear")
    x, y = np.zeros(3), [0.0]
    for now, then in pairwise(u):
        x = step @ x + level * now + ramp * (then - now)
        y.append(x[0])
    return np.array(y)


@pytest.mark.parametrize("hold", ["linear", "zoh"])
@pytest.mark.parametrize("name", ["square", "noisy", "chirp"])
def test_decimate__two_mass_drive__responds_as_to_the_full_input(hold: str, name: str) -> None:
    t = DT * np.arange(N)
    u = {
        "square": np.sign(np.sin(2 * np.pi * 1.3 * t + 0.1)),
        "noisy": np.sin(2 * np.pi * 2 * t) + 0.1 * U,
        "chirp": np.sin(2 * np.pi * (1 * t + 6 * t**2)),
    }[name]
    full = response(u, DT, hold)
    for n in (2, 5):
        kept = full[::n]

        def error(coarse: np.ndarray, n: int = n, kept: np.ndarray = kept) -> float:
            return float(np.sqrt(np.mean((response(coarse, n * DT, hold) - kept) ** 2)) / kept.std())

        ours, picked = error(coarse_input(u, n, hold)), error(u[::n])
        # Better than picking every n-th value by far, and below 1 % of the motion.
        assert ours < 0.5 * picked
        assert ours < 0.01


def test_decimate__differenced_velocity__is_differenced_over_the_new_interval() -> None:
    position = np.cumsum(np.rint(np.random.default_rng(2).normal(3, 2, N))) * 1e-3
    velocity = np.diff(position, prepend=0.0) / DT
    full = make(U, velocity, kind="velocity-differenced")
    part = decimate(full, 5)
    np.testing.assert_allclose(part.y[0, 1:], np.diff(position[::5]) / (5 * DT), rtol=1e-9)
    assert part.resolution[0] == pytest.approx(full.resolution[0] / 5)


@pytest.mark.parametrize(("gain", "dt"), [(1e-300, DT), (1e200, DT), (1.0, 1e300), (1.0, 1e-300)])
def test_recording__sizes_that_no_computer_can_square__are_refused(gain: float, dt: float) -> None:
    with pytest.raises(BrightgreyError, match=r"'u' reaches .* no drive does|steps of .* are absurd"):
        make(gain * U, U, dt=dt)


def read_speed(speed: np.ndarray) -> Recording:
    return recording_from(
        {"t": DT * np.arange(N), "u": U, "w": speed}, input="u", outputs="w:speed", units={"w": "rad/s"}
    )


def test_recording_from__speed_without_sign__is_not_negative_but_for_noise() -> None:
    noisy = np.abs(np.cumsum(U)) + 0.01 * np.abs(np.cumsum(U)).max() * U
    assert read_speed(noisy).outputs[0].kind == "speed"
    with pytest.raises(
        BrightgreyError, match=r"50 % of its samples are negative, down to -1 rad/s; name it w:velocity"
    ):
        read_speed(np.where(np.arange(N) % 2, 1.0, -1.0))


def test_recording__part_in_which_a_speed_without_sign_rests__may_be_negative_by_noise() -> None:
    whole = read_speed(np.where(np.arange(N) < 300, 0.0, 10.0) + 0.1 * U)
    rest = dataclasses.replace(whole, t=whole.t[:300], u=whole.u[:300], y=whole.y[:, :300])
    assert rest.y.min() < -0.1 * np.abs(rest.y).max()
