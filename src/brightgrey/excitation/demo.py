"""The demo recording that ships with the package: the paper's experiment with sensor noise."""

from __future__ import annotations

from importlib.resources import files

__all__ = ["demo_recording"]


def demo_recording() -> str:
    """Return the text of the demo recording: CSV with columns ``t,torque,velocity`` in s, N m and rad/s.

    The reference solver has simulated :data:`brightgrey.excitation.PAPER_EXPERIMENT`. The velocity has white noise
    with a standard deviation of 0.1 % of its peak and is rounded to 0.01 rad/s. ``tools/make_demo_recording.py``
    makes the file.
    """
    return files("brightgrey.excitation").joinpath("data/demo.csv").read_text(encoding="utf-8")
