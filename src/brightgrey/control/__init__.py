"""Control with an identified model: linear analysis, control design, Kalman filters, limit cycles and fault detection.

Everything here is in SI. The functions that take a :class:`~brightgrey.Model` and its units come from
:mod:`brightgrey` itself: ``analyse``, ``design`` and ``watch``.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from brightgrey.control.design.cascade import Cascade, CascadeGoal, design_cascade
    from brightgrey.control.design.closed_loop import ClosedLoopRun, Controller, Reference, closed_loop, standstill
    from brightgrey.control.design.controllers import CascadeController, OutputFeedback, StateFeedback, feedforward
    from brightgrey.control.design.lqg import ObserverFeedback, kalman_gain, lqg_compensator
    from brightgrey.control.design.state_feedback import StateFeedbackDesign, design_state_feedback, lqr, place_poles
    from brightgrey.control.faults.detection import FaultCase, FaultDetectionOptions, FaultFinding, detect_faults
    from brightgrey.control.filters.extended_kalman import FilterResult, Noise, extended_kalman_filter
    from brightgrey.control.filters.gaussian_sum import GaussianSumOptions, gaussian_sum_filter
    from brightgrey.control.filters.setup import PreparedRecording, estimate_noise, prepare, shaft_torque
    from brightgrey.control.filters.unscented_kalman import unscented_kalman_filter
    from brightgrey.control.limit_cycles.describing_function import (
        LimitCycle,
        LimitCycleOptions,
        describing_function,
        predict_limit_cycles,
    )
    from brightgrey.control.linear.analysis import Analysis, analyse_system
    from brightgrey.control.linear.margins import Compensator, Margins, frequency_response, stability_margins
    from brightgrey.control.linear.operating_point import contact_mode, trim_point
    from brightgrey.control.linear.twist_coordinates import to_twist_coordinates

__all__ = [
    "Analysis",
    "Cascade",
    "CascadeController",
    "CascadeGoal",
    "ClosedLoopRun",
    "Compensator",
    "Controller",
    "FaultCase",
    "FaultDetectionOptions",
    "FaultFinding",
    "FilterResult",
    "GaussianSumOptions",
    "LimitCycle",
    "LimitCycleOptions",
    "Margins",
    "Noise",
    "ObserverFeedback",
    "OutputFeedback",
    "PreparedRecording",
    "Reference",
    "StateFeedback",
    "StateFeedbackDesign",
    "analyse_system",
    "closed_loop",
    "contact_mode",
    "describing_function",
    "design_cascade",
    "design_state_feedback",
    "detect_faults",
    "estimate_noise",
    "extended_kalman_filter",
    "feedforward",
    "frequency_response",
    "gaussian_sum_filter",
    "kalman_gain",
    "lqg_compensator",
    "lqr",
    "place_poles",
    "predict_limit_cycles",
    "prepare",
    "shaft_torque",
    "stability_margins",
    "standstill",
    "to_twist_coordinates",
    "trim_point",
    "unscented_kalman_filter",
]

_MODULES = {
    "design.cascade": ("Cascade", "CascadeGoal", "design_cascade"),
    "design.closed_loop": ("ClosedLoopRun", "Controller", "Reference", "closed_loop", "standstill"),
    "design.controllers": ("CascadeController", "OutputFeedback", "StateFeedback", "feedforward"),
    "design.lqg": ("ObserverFeedback", "kalman_gain", "lqg_compensator"),
    "design.state_feedback": ("StateFeedbackDesign", "design_state_feedback", "lqr", "place_poles"),
    "faults.detection": ("FaultCase", "FaultDetectionOptions", "FaultFinding", "detect_faults"),
    "filters.extended_kalman": ("FilterResult", "Noise", "extended_kalman_filter"),
    "filters.gaussian_sum": ("GaussianSumOptions", "gaussian_sum_filter"),
    "filters.setup": ("PreparedRecording", "estimate_noise", "prepare", "shaft_torque"),
    "filters.unscented_kalman": ("unscented_kalman_filter",),
    "limit_cycles.describing_function": (
        "LimitCycle",
        "LimitCycleOptions",
        "describing_function",
        "predict_limit_cycles",
    ),
    "linear.analysis": ("Analysis", "analyse_system"),
    "linear.margins": ("Compensator", "Margins", "frequency_response", "stability_margins"),
    "linear.operating_point": ("contact_mode", "trim_point"),
    "linear.twist_coordinates": ("to_twist_coordinates",),
}
_HOME_OF = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import on first use (PEP 562), so that the command line does not wait for what it does not need."""
    if name not in _HOME_OF:
        raise AttributeError(f"module 'brightgrey.control' has no attribute '{name}'")
    value = getattr(importlib.import_module(f"brightgrey.control.{_HOME_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
