"""Command line that repeats an identification."""

from __future__ import annotations

import shlex

from brightgrey.errors import printable
from brightgrey.report.content import Content

__all__ = ["command"]


def command(content: Content) -> str:
    """Command that repeats the result: the one that was given, or one derived from the model."""
    return printable(content.request or _derived_command(content))


def _derived_command(content: Content) -> str:
    """Command from the model: signals, structure, fixed parameters, settings and seed."""
    model = content.model
    s, fixed = model.settings, model.settings.fixed
    words = ["brightgrey", "identify", *(part.recording for part in model.initial_state)]
    words += ["--input", model.input.name]
    for signal in model.outputs:
        words += ["--output", f"{signal.name}:{signal.sensor}"]
    for signal in (model.input, *model.outputs):
        words += ["--unit", f"{signal.name}={signal.unit}"]
    if model.input.gain != 1.0:
        words += ["--input-gain", f"{model.input.gain!r}"]
    for signal in model.outputs:
        words += ["--gear", f"{signal.name}={signal.gain!r}"] if signal.gain != 1.0 else []
    words += [] if model.evidence is not None else ["--structure", str(model.structure)]
    differing = [name for name, part in model.parameters.items() if part.in_recordings]
    words += ["--per-recording", ",".join(differing)] if differing else []
    for name, value in fixed.items():
        words += ["--fix", f"{name}={value!r}"]
    if s.friction_width_ci95 is None and s.friction_width and model.structure.has_dry_friction:
        words += ["--f-tanh", repr(1.0 / s.friction_width)]
    words += ["--hold", s.hold, "--seed", str(model.seed)]
    for trace in content.traces:
        words += ["--test-recording", trace.name] if trace.test else []
    return shlex.join(words)
