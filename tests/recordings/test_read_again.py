"""Recordings know where they come from, and can be read as they were."""

import json
from dataclasses import replace

import numpy as np
import pytest

from brightgrey import RecordingError, read_recording, recording_from
from brightgrey.recordings.read import read_again

OPTIONS = {
    "input": "torque",
    "outputs": [("speed", "velocity")],
    "units": {"speed": "rpm"},
    "window": (0.01, None),
    "decimate": 2,
}


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "axis.csv"
    rows = [f"{0.001 * k:.3f},{np.sin(k):.6f},{10.0 * np.cos(0.1 * k):.6f}\n" for k in range(200)]
    path.write_text("t [s],torque [N m],speed\n" + "".join(rows))
    return path


def test_read_again__same_file__same_recording(file):
    first = read_recording(file, **OPTIONS)
    plain = json.loads(json.dumps(dict(first.source.options)))  # as run.json keeps it
    again = read_again(replace(first.source, options=plain))
    assert again.fingerprint == first.fingerprint
    assert again.source == first.source


def test_read_again__file_has_moved__is_read_from_there(file, tmp_path):
    first = read_recording(file, **OPTIONS)
    moved = file.rename(tmp_path / "moved.csv")
    assert np.array_equal(read_again(first.source, moved).y, first.y)


def test_read_again__other_content__says_so(file):
    first = read_recording(file, **OPTIONS)
    file.write_text(file.read_text().replace("0.050,", "0.050000,"))
    with pytest.raises(RecordingError, match=r"axis\.csv: the file is not the one that was identified"):
        read_again(first.source)


def test_source__arrays_in_memory__none():
    made = recording_from(
        {"u": np.arange(50.0), "v": np.sin(np.arange(50.0))}, input="u", outputs="v:velocity", dt=1e-3
    )
    assert made.source is None
