"""Options of the command line in the words of the app: what a check or an advice asks for is found on its pages."""

from __future__ import annotations

import re
from collections.abc import Mapping

__all__ = ["in_app_words"]

OPTION_PLACES: Mapping[str, str] = {
    "input": "the role “input”",
    "output": "the role “output”",
    "unit": "the column “Unit”",
    "window": "“Use the time from … to”",
    "decimate": "“Use every Nth sample”",
    "hold": "“Input between samples”",
    "shift": "“Time shift in s”",
    "gear": "“Factor of an output”",
    "input-gain": "“Factor of the input”",
    "torque-constant": "“Torque constant”",
    "rated": "“What 100 % are”",
    "counts": "“Increments per turn”",
    "dt": "“Sampling interval in s”",
    "time": "“Column of the time”",
    "bound": "“Known values”",
    "fix": "“Known values”",
    "require": "“certainly there”",
    "exclude": "“certainly not there”",
    "per-recording": "“Values that may differ between the recordings”",
}
"""Where an option of ``brightgrey identify`` is found in the app."""


def in_app_words(text: str) -> str:
    """Text in which options of the command line are the fields of the app that do the same."""
    unquoted = re.sub(r"(?:'|&#39;)(--[^'&]+)(?:'|&#39;)", r"\1", text)
    return re.sub(r"--([a-z]+(?:-[a-z]+)*)", lambda m: OPTION_PLACES.get(m[1], m[0]), unquoted)
