"""Excitation: motions, the torque signals that lead to them, and the paper's experiment."""

from brightgrey.excitation.demo import demo_recording
from brightgrey.excitation.experiment import PAPER_EXPERIMENT, Experiment, driving_torque
from brightgrey.excitation.motion import Motion, MotionLimits, moves, reversing

__all__ = [
    "PAPER_EXPERIMENT",
    "Experiment",
    "Motion",
    "MotionLimits",
    "demo_recording",
    "driving_torque",
    "moves",
    "reversing",
]
