"""Time stamps: uniform, repaired with a note, or refused with the row."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brightgrey.errors import RecordingError, SettingsError
from brightgrey.recordings import Recording, read_stretches, recording_from
from brightgrey.recordings.read import read_again

N = 400
RNG = np.random.default_rng(0)
U = RNG.normal(size=N)
V = np.cumsum(U)


def record(t: np.ndarray, u: np.ndarray = U, v: np.ndarray = V, **options: object) -> Recording:
    columns = {"t": t, "u": u, "v": v}
    return recording_from(columns, input="u", outputs="v:velocity", **options)  # type: ignore[arg-type]


@settings(max_examples=50, deadline=None)
@given(
    start=st.floats(-10, 1e4),
    dt=st.sampled_from([1e-5, 2.5e-4, 1e-3, 4e-3, 0.1, 1.0]),
    jitter=st.floats(0, 0.045),
    seed=st.integers(0, 100),
)
def test_time__jitter_below_a_tenth__is_read_as_uniform(start: float, dt: float, jitter: float, seed: int) -> None:
    shift = jitter * dt * np.random.default_rng(seed).uniform(-1, 1, N)
    recording = record(start + dt * np.arange(N) + shift)
    assert recording.samples == N
    # Both ends are off by the jitter at most, and 1 % more for a round number.
    assert recording.dt == pytest.approx(dt, rel=(2 * jitter + 0.02) / (N - 1))
    np.testing.assert_array_equal(recording.u, U)
    noted = any("jitter" in note for note in recording.notes)
    assert noted == (np.abs(np.diff(recording.t[0] + dt * np.arange(N) + shift) / recording.dt - 1).max() > 0.01)


def test_time__single_precision__gives_no_note() -> None:
    recording = record((0.004 * np.arange(N)).astype(np.float32).astype(np.float64))
    assert recording.dt == 0.004
    assert not any("jitter" in note for note in recording.notes)


def test_time__start_other_than_zero__is_kept() -> None:
    recording = record(5.0 + 0.001 * np.arange(N))
    assert recording.t[0] == 5.0
    assert recording.dt == 0.001


@pytest.mark.parametrize("digits", [3, 4])
@pytest.mark.parametrize("dt", [0.00125, 0.0005, 0.0017])
def test_time__rounded_stamps__give_the_true_interval(dt: float, digits: int) -> None:
    t = np.round(dt * np.arange(N), digits)
    recording = record(t)
    assert recording.samples == N
    assert recording.dt == pytest.approx(dt, rel=0.5 * 10.0**-digits / dt / (N - 1))
    if not np.allclose(np.diff(t), dt, rtol=0.1):
        assert any("time is rounded to" in note for note in recording.notes)


def test_time__lost_samples__are_interpolated_with_a_note() -> None:
    t = 0.001 * np.arange(N)
    kept = np.delete(np.arange(N), [100, 250])
    recording = record(t[kept], U[kept], V[kept])
    assert recording.samples == N
    np.testing.assert_allclose(recording.t, t, atol=1e-12)
    np.testing.assert_array_equal(recording.u[kept], U[kept])
    assert recording.u[100] == pytest.approx((U[99] + U[101]) / 2)
    assert "a sample is missing before rows 101, 250: interpolated" in recording.notes


def test_time__row_written_twice__is_left_out_with_a_note() -> None:
    t = 0.001 * np.arange(N)
    twice = np.insert(np.arange(N), 100, 99)
    recording = record(t[twice], U[twice], V[twice])
    np.testing.assert_array_equal(recording.u, U)
    assert any("row 101 repeated the one before" in note for note in recording.notes)


REFUSED = {
    "backwards": (
        lambda t: np.r_[t[:200], t[:200]],
        r"row 201, column 't': time runs backwards: 0 s after 0\.199 s",
    ),
    "repeated": (
        lambda t: np.where(np.arange(N) == 100, t[99], t),
        r"row 101, column 't': time 0\.099 s is repeated",
    ),
    "standstill": (lambda t: 0 * t, "column 't': time stands still"),
    "other values": (
        lambda t: np.delete(np.insert(t, 100, t[99]), -1),
        r"row 101, column 't': time 0\.099 s is repeated with other values; leave one of the rows out",
    ),
    "two holes": (
        lambda t: t + 0.005 * (t > 0.15) + 0.01 * (t > 0.3),
        r"row 152, column 't': 2 holes in the time, the longest of 0\.011 s; .*0:0\.15, 0\.156:0\.305, 0\.316:0\.414,",
    ),
    "many lost": (
        lambda t: t + 0.001 * np.cumsum(np.random.default_rng(2).random(N) < 0.05),
        "row .*: [0-9]+ samples are missing, the first one before",
    ),
    "random": (
        lambda t: np.sort(np.random.default_rng(1).uniform(0, 0.4, N)),
        "steps may differ by 50 % at most",
    ),
}


@pytest.mark.parametrize(("bend", "message"), REFUSED.values(), ids=REFUSED)
def test_time__not_uniform__is_refused_with_the_row(bend, message: str) -> None:
    with pytest.raises(RecordingError, match=message) as error:
        record(bend(0.001 * np.arange(N)))
    assert "\n" not in str(error.value)


def test_time__hole__leaves_the_longest_stretch() -> None:
    t = 0.001 * np.arange(N)
    recording = record(t + 0.005 * (t > 0.15))
    np.testing.assert_allclose(recording.t, 0.156 + 0.001 * np.arange(249), atol=1e-9)
    np.testing.assert_array_equal(recording.u, U[151:])
    (note,) = [note for note in recording.notes if "hole" in note]
    assert "only the stretch from 0.156 to 0.404 s is read, 151 samples are left out" in note
    assert "windows 0:0.15, 0.156:0.404" in note
    first = record(t + 0.005 * (t > 0.15), window=(0.0, 0.15))
    np.testing.assert_array_equal(first.u, U[:151])


def test_time__one_uneven_step__is_read_as_uniform_with_a_note() -> None:
    t = 0.001 * np.arange(N)
    recording = record(t + 0.0004 * (t > 0.15))
    np.testing.assert_array_equal(recording.u, U)
    assert any("jitter by up to 40 %" in note for note in recording.notes)


def test_time__steps_of_ten_and_twelve__are_interpolated_at_a_known_cost() -> None:
    t = np.cumsum(np.where(np.arange(N) % 3 == 2, 0.012, 0.010))
    u = np.sin(2 * np.pi * 2.0 * t)
    recording = record(t, u, 3 * u)
    assert recording.dt == pytest.approx(0.0107)
    error = recording.u - np.sin(2 * np.pi * 2.0 * recording.t)
    (note,) = [note for note in recording.notes if "the interpolation costs" in note]
    cost = float(note.split("'u' ")[1].split(" %")[0]) / 100
    assert cost / 3 < np.std(error) / np.std(u) < 3 * cost
    assert any("time steps from 0.01 to 0.012 s" in note for note in recording.notes)


def test_time__regular_gaps__are_a_rounded_time() -> None:
    """One stamp in twenty left out is just what rounding an interval of 1.05 ms to 1 ms gives."""
    recording = record(np.round(0.00105 * np.arange(N), 3))
    assert recording.samples == N
    assert recording.dt == pytest.approx(0.00105, rel=1e-3)
    assert any("rounded to 0.001 s" in note for note in recording.notes)


def test_window__fault_outside__does_not_matter() -> None:
    t = 0.001 * np.arange(N) + 0.005 * (np.arange(N) > 200)
    recording = record(t, window=(None, 0.15))
    assert recording.samples == 151
    with pytest.raises(RecordingError, match=r"0 samples are too few.*goes from 0 to 0\.404 s"):
        record(t, window=(1.0, 2.0))


@pytest.mark.parametrize(
    ("name", "unit", "scale"),
    [
        ("t", "ms", 1e3),
        ("Time_ms", None, 1e3),
        ("time_us", None, 1e6),
        ("time_s", None, 1.0),
        ("TIME", None, 1.0),
    ],
)
def test_time__unit_given_or_in_the_name__is_converted(name: str, unit: str | None, scale: float) -> None:
    columns = {name: scale * 0.001 * np.arange(N), "u": U, "v": V}
    units = {} if unit is None else {name: unit}
    recording = recording_from(columns, input="u", outputs="v:velocity", units=units)
    assert recording.dt == 0.001
    assert any("its name says so" in note for note in recording.notes) == (name in ("Time_ms", "time_us"))


def test_interval__given__replaces_the_time() -> None:
    recording = record(np.zeros(N), dt=0.002)
    np.testing.assert_allclose(recording.t, 0.002 * np.arange(N), rtol=1e-12)
    assert any("the time in column 't' is not used" in note for note in recording.notes)
    with pytest.raises(SettingsError, match="both the time's column 't' and a sampling interval"):
        record(np.zeros(N), dt=0.002, time="t")
    for dt in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(SettingsError, match="not a positive number"):
            record(np.zeros(N), dt=dt)


def test_time__missing_stamp__is_interpolated_if_single() -> None:
    t = 0.001 * np.arange(N)
    t[50] = np.nan
    recording = record(t)
    assert recording.samples == N
    assert any("time is missing in row 51: interpolated" in note for note in recording.notes)
    t[51] = np.nan
    with pytest.raises(RecordingError, match="row 51, column 't': no value"):
        record(t)


def test_read_stretches__holes__are_recordings_of_their_own(tmp_path) -> None:
    t = 0.001 * np.arange(N)
    t += 0.005 * (t > 0.15) + 0.01 * (t > 0.3) + 0.02 * (t > 0.396)  # the last three samples stand alone
    path = tmp_path / "run.csv"
    rows = [f"{a:.4f},{b:.17g},{c:.17g}" for a, b, c in zip(t, U, V, strict=True)]
    path.write_text("\n".join(["t,u,v", *rows]))
    parts = read_stretches(path, input="u", outputs="v")
    assert [part.samples for part in parts] == [151, 150, 96]
    np.testing.assert_array_equal(np.concatenate([part.u for part in parts]), U[:397])
    assert parts[1].name == "run.csv 0.156:0.305"
    assert (
        "stretch 2 of 3, from 0.156 to 0.305 s, with its own initial state; 3 holes in the time" in parts[1].notes[-1]
    )
    assert "3 samples in shorter stretches are left out" in parts[1].notes[-1]
    again = read_again(parts[1].source)
    np.testing.assert_array_equal(again.y, parts[1].y)
    (whole,) = read_stretches(path, input="u", outputs="v", dt=0.001)
    assert whole.samples == N
    (later,) = read_stretches(path, input="u", outputs="v", window=(0.31, None))
    assert later.samples == 96


def test_read_stretches__file_without_holes__is_opened_once(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.csv"
    path.write_text("\n".join(["t,u,v", *(f"{0.001 * k:.4f},{U[k]},{V[k]}" for k in range(N))]))
    opened = []
    monkeypatch.setattr(Path, "read_bytes", lambda self, read=Path.read_bytes: (opened.append(self), read(self))[1])
    (whole,) = read_stretches(path, input="u", outputs="v")
    assert whole.source is not None
    assert opened == [path]
