"""The request that a result answers, as a command that can be given again."""

from __future__ import annotations

import shlex

from brightgrey.model.model import Model
from brightgrey.report.content import Content

__all__ = ["command"]


def command(content: Content) -> str:
    """Command that gives the result again: the one that was given, or one made from the model."""
    return content.request or _made(content)


def _made(content: Content) -> str:
    """From the model: signals, structure, what was fixed, settings and seed."""
    model = content.model
    s, fixed = model.settings, model.settings.fixed
    words = ["brightgrey", "identify", *(part.recording for part in model.initial_state)]
    words += ["--input", model.input.name]
    for signal in model.outputs:
        words += ["--output", f"{signal.name}:{signal.kind}"]
    for signal in (model.input, *model.outputs):
        words += ["--unit", f"{signal.name}={signal.unit}"]
    if model.input.gain != 1.0:
        words += ["--input-gain", f"{model.input.gain!r}"]
    words += [] if _searched(model) else ["--structure", str(model.structure)]
    for name, value in fixed.items():
        words += ["--fix", f"{name}={value!r}"]
    words += ["--f-tanh", repr(s.f_tanh), "--hold", s.hold, "--seed", str(model.seed)]
    for trace in content.traces:
        words += ["--test-recording", trace.name] if trace.test else []
    return shlex.join(words)


def _searched(model: Model) -> bool:
    return model.evidence is not None
