"""Files in random dialects come back number by number, and rubbish is refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from brightgrey.errors import BrightgreyError
from brightgrey.recordings import read_recording

FIELD = st.floats(-1e6, 1e6).map(lambda x: float(f"{x:.8g}") if abs(x) > 1e-9 else 0.0)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    data=st.data(),
    delimiter=st.sampled_from([",", ";", "\t", " ", "|"]),
    decimal=st.sampled_from([".", ","]),
    header=st.booleans(),
    trailing=st.booleans(),
    quoted=st.booleans(),
    width=st.integers(2, 5),
    end=st.sampled_from(["\n", "\r\n"]),
    form=st.sampled_from(["{:.8g}", "{:.8e}", "{:.12f}"]),
)
def test_find_dialect__any_written_dialect__is_found(
    tmp_path: Path,
    data: st.DataObject,
    delimiter: str,
    decimal: str,
    header: bool,
    trailing: bool,
    quoted: bool,
    width: int,
    end: str,
    form: str,
) -> None:
    if delimiter == decimal:
        delimiter = ";"
    values = np.array(data.draw(st.lists(st.lists(FIELD, min_size=width, max_size=width), min_size=20, max_size=30)))
    names = [f"c{i}" for i in range(width)]
    lines = [[form.format(x).replace(".", decimal) for x in row] for row in values.tolist()]
    written = np.array([[float(x.replace(",", ".")) for x in row] for row in lines])
    if header:
        lines = [names, *lines]
    if quoted:
        lines = [[f'"{field}"' for field in line] for line in lines]
    tail = delimiter if trailing and delimiter != " " else ""
    path = tmp_path / "run.csv"
    path.write_bytes((end.join(delimiter.join(line) + tail for line in lines) + end).encode())
    columns = names if header else [str(i + 1) for i in range(width)]
    try:
        recording = read_recording(path, input=columns[0], outputs=[(c, "position") for c in columns[1:]], dt=1.0)
    except BrightgreyError as error:  # pragma: no cover
        raise AssertionError(f"{error}\n{path.read_text()}") from error
    np.testing.assert_array_equal(recording.u, written[:, 0])
    np.testing.assert_array_equal(recording.y, written[:, 1:].T)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    content=st.one_of(
        st.binary(max_size=300), st.text(alphabet='0123456789.,;-e \t\n"ab[]#', max_size=400).map(str.encode)
    )
)
def test_read_recording__random_bytes__are_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes(content)
    with pytest.raises(BrightgreyError) as error:
        read_recording(path, input="1", outputs="2:velocity", dt=1.0)
    assert "\n" not in str(error.value)
