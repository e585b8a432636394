"""Columns whose clock is off, and a recording.toml with what mends them."""

import tomllib

import numpy as np
import pytest

from brightgrey import SettingsError, recording_from
from brightgrey.recordings.recording_toml import recording_toml

T = 1e-3 * np.arange(400)
COLUMNS = {"t": T, "u": np.sin(20 * T), "q": np.sin(30 * (T - 3.3e-3)), "v": 30 * np.cos(30 * T)}


def test_shift__late_column__is_moved_to_the_clock_of_the_others():
    made = recording_from(
        COLUMNS, input="u", outputs=["v:velocity", "q:position"], shift={"q": -3.3e-3}, units={"u": "N m", "v": "rad/s"}
    )
    assert made.y[1] == pytest.approx(np.sin(30 * made.t), abs=2e-4)
    assert any("'q' is taken 0.0033 s earlier" in note for note in made.notes)


def test_shift__of_no_used_column__is_noted():
    made = recording_from(COLUMNS, input="u", outputs="v:velocity", shift={"q": 1.0})
    assert "the shift of 'q' is not used" in made.notes


def test_shift__not_finite__is_refused():
    with pytest.raises(SettingsError, match="shift q nan"):
        recording_from(COLUMNS, input="u", outputs="q:position", shift={"q": float("nan")})


def test_recording_toml__remedies__are_added_to_the_options():
    options = {"input": "u", "output": ["q:position@2", "v:velocity"], "gear": ["v=2"], "shift": ["q=0.001"]}
    remedies = {
        "gear": ["v=0.5", "q=3"],
        "shift": ["q=-0.003"],
        "output": ["v:velocity-differenced"],
        "input_gain": -1.0,
        "decimate": 4,
    }
    found = tomllib.loads(recording_toml(['a "b".csv'], options, remedies))
    assert found == {
        "recording": ['a "b".csv'],
        "input": "u",
        "output": ["q:position@2", "v:velocity-differenced"],
        "gear": ["v=1", "q=3"],
        "shift": ["q=-0.002"],
        "input_gain": -1.0,
        "decimate": 4,
    }
