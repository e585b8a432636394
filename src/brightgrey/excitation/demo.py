"""The recording that ships with the package: the paper's experiment with the sensor's noise on it."""

from __future__ import annotations

from importlib.resources import files

__all__ = ["demo_recording"]


def demo_recording() -> str:
    """Text of the demo recording: CSV with columns ``t,torque,velocity`` in s, N m and rad/s.

    Simulated by the reference solver for :data:`brightgrey.excitation.PAPER_EXPERIMENT`; velocity carries
    white noise with a standard deviation of 0.1 % of its peak and is rounded to 0.01 rad/s. Made by
    ``tools/make_demo_recording.py``.
    """
    return files("brightgrey.excitation").joinpath("data/demo.csv").read_text(encoding="utf-8")
