"""Texts of a drive as programs write them, and what has to be read from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from brightgrey import inspect
from brightgrey.recordings import Recording, read_recording

N = 60
T = np.arange(N) * 2e-3
U = np.round(np.sin(np.arange(N)), 4)
V = np.round(800.0 * np.sin(0.3 * np.arange(N)), 2) + 400.0


def write(
    folder: Path, head: Sequence[str], row: Callable[[float, float, float], str], encoding: str = "utf-8"
) -> Path:
    path = folder / "run.csv"
    lines = [*head, *(row(*sample) for sample in zip(T.tolist(), U.tolist(), V.tolist(), strict=True))]
    path.write_bytes(("\n".join(lines) + "\n").encode(encoding))
    return path


def same(path: Path, **options: object) -> Recording:
    """Read with the options that `inspect` suggests, and compare with what was written; the speed is in rpm."""
    found = inspect(path)
    recording = read_recording(path, **{**found.options, **options})
    np.testing.assert_allclose(recording.u, U, rtol=1e-12)
    np.testing.assert_allclose(recording.y[0], V * np.pi / 30, rtol=1e-12)
    assert recording.dt == pytest.approx(2e-3, rel=1e-6)
    return recording


HEADER = "time [s];torque [Nm];speed [rpm]"


def comma(number: float, form: str = "g") -> str:
    return f"{number:{form}}".replace(".", ",")
