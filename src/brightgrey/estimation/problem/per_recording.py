"""Parameters that may differ between recordings of one drive: friction when it is cold and warm, a changed load.

The value that a structure has is the mean over the recordings, of logarithms where the parameter is always positive.
Each recording but the last deviates from it by a nuisance. The deviation of the last one makes their sum zero.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.problem.nuisance import Nuisance
from brightgrey.estimation.problem.scales import scales
from brightgrey.kit import Structure
from brightgrey.recordings import Recording

__all__ = ["deviation_name", "deviation_shares", "deviations_of", "is_of_another_recording", "values_in_recording"]

_MARK = "#"  # begins the tag of a recording


@dataclass(frozen=True)
class DeviationOptions:
    """Range of the deviations."""

    largest_factor: float = 10.0  #: Of a positive parameter in one recording, over its mean.


DEVIATION_DEFAULTS = DeviationOptions()


def deviation_name(parameter: str, tag: str) -> str:
    """Name of the deviation of a parameter in the recording with a tag."""
    return f"{parameter}{tag}"


def deviations_of(
    structure: Structure,
    recordings: Sequence[Recording],
    tags: Sequence[str],
    names: Collection[str],
    options: DeviationOptions = DEVIATION_DEFAULTS,
) -> tuple[Nuisance, ...]:
    """Deviations of those parameters of a structure that are named; none with one recording.

    That of a positive parameter is a difference of logarithms, any other is in SI.
    """
    wanted = {name: q for name, q in structure.parameters.items() if name in names}
    if not wanted or len(tags) < 2:
        return ()
    known, found = scales(recordings), []
    for name, parameter in wanted.items():
        low, high = parameter.bounds(known)
        most = float(np.log(options.largest_factor)) if parameter.scale == "log" else 0.5 * (high - low)
        found += [Nuisance(deviation_name(name, tag), -most, most, 0.0, sampled=False) for tag in tags[:-1]]
    return tuple(found)


def values_in_recording(structure: Structure, values: Mapping[str, Array], tag: str) -> Mapping[str, Array]:
    """Parameters in the recording with a tag: `values` themselves where nothing differs between recordings."""
    if not tag or not any(_MARK in name for name in values):
        return values
    own = dict(values)
    for name, parameter in structure.parameters.items():
        shares = deviation_shares(name, tag, values)
        if shares:
            deviation = sum(share * values[other] for other, share in shares.items())
            own[name] = values[name] * np.exp(deviation) if parameter.scale == "log" else values[name] + deviation
    return own


def deviation_shares(parameter: str, tag: str, names: Collection[str]) -> dict[str, float]:
    """Deviations whose sum, each with its factor, is that of a parameter in the recording with a tag."""
    own = deviation_name(parameter, tag)
    if own in names:
        return {own: 1.0}
    return {name: -1.0 for name in names if name.startswith(f"{parameter}{_MARK}")}


def is_of_another_recording(name: str, tag: str, names: Collection[str]) -> bool:
    """True for a nuisance, one of `names`, that does not change the motion in the recording with a tag."""
    parameter, mark, _ = name.partition(_MARK)
    return bool(mark) and not name.endswith(tag) and name not in deviation_shares(parameter, tag, names)
