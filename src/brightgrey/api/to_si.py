"""Check of the user's values, and their conversion from the recording's units to SI."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

from brightgrey.effects import PER_SPEED, Parameter
from brightgrey.errors import RecordingError, SettingsError, one_of
from brightgrey.estimation import scales, settings_for
from brightgrey.estimation.problem.nuisance import friction_width_nuisance
from brightgrey.kit import Structure, function_set
from brightgrey.model.model import Model
from brightgrey.recordings import Recording, Signal
from brightgrey.recordings.units.parser import parse_unit
from brightgrey.recordings.units.signals import Units
from brightgrey.search import IdentificationTask

__all__ = ["Range", "check_alike", "check_signals_of_model", "identification_task", "listed", "start_si"]

Range = tuple[float, float]


def listed(signals: Sequence[Signal]) -> str:
    """Kinds and units of the signals as text."""
    return ", ".join(f"{signal.sensor} in {signal.unit}" for signal in signals)


def check_alike(several: Sequence[Recording], test: Recording | None) -> None:
    """Refuse recordings of different signals or units: joint fits need the same everywhere."""
    if not several:
        raise RecordingError("no recording came; at least one is needed")
    first = (several[0].input, *several[0].outputs)
    for other in (*several[1:], *(() if test is None else (test,))):
        came = (other.input, *other.outputs)
        if [(s.sensor, s.unit) for s in came] != [(s.sensor, s.unit) for s in first]:
            raise RecordingError(
                f"{other.name}: signals are {listed(came)}; those of {several[0].name} are {listed(first)}"
            )


def check_signals_of_model(model: Model, recording: Recording) -> None:
    """Refuse a recording whose signals differ in kind or dimension from those that a model was identified from."""
    trained, came = (model.input, *model.outputs), (recording.input, *recording.outputs)
    if [_kind_and_dimension(s) for s in trained] != [_kind_and_dimension(s) for s in came]:
        raise RecordingError(
            f"{recording.name}: signals are {listed(came)}; the model was identified from {listed(trained)}"
        )


def _kind_and_dimension(signal: Signal) -> tuple[object, ...]:
    return signal.sensor, parse_unit(signal.unit).dimension


def identification_task(
    recordings: Sequence[Recording],
    structure: Structure | None,
    bounds: Mapping[str, Range],
    fixed: Mapping[str, float],
    f_tanh: float | None,
    per_recording: Collection[str] = (),
) -> IdentificationTask:
    """Make the task of an identification, in SI.

    Parameters
    ----------
    recordings : sequence of Recording
        Of one drive, with the same outputs.
    structure : Structure or None
        Structure whose parameters may be named; those of the whole function set if it is None.
    bounds, fixed : mapping
        Ranges and values by parameter, in the recording's units.
    f_tanh : float or None
        In the recording's units; its inverse is estimated with the parameters if it is None.
    per_recording : collection of str
        Parameters that may differ between the recordings.

    Raises
    ------
    SettingsError
        For an unknown parameter, one that is fixed and bounded or may differ as well, or an impossible value.
    """
    for name in sorted(bounds.keys() & fixed.keys()):
        raise SettingsError(f"{name} is both bounded and fixed; do one of them")
    kit = function_set()
    allowed = kit.parameters if structure is None else kit.check(structure).parameters
    units, known = recordings[0].units, scales(recordings)
    return IdentificationTask(
        recordings=tuple(recordings),
        scales=known,
        settings=settings_for(recordings, known, None if f_tanh is None else _f_tanh_si(f_tanh, units)),
        bounds=_bounds_si(allowed, bounds, units),
        fixed=_fixed_si(allowed, fixed, units),
        friction_width=friction_width_nuisance(known.speed) if f_tanh is None else None,
        drift=True,
        per_recording=_may_differ(allowed, per_recording, fixed, recordings),
    )


def _may_differ(
    allowed: Mapping[str, Parameter],
    names: Collection[str],
    fixed: Mapping[str, float],
    recordings: Sequence[Recording],
) -> tuple[str, ...]:
    """Parameters that may differ between recordings; refuses unknown and fixed ones, and a single recording."""
    for name in names:
        one_of("parameter", name, allowed)
        if name in fixed:
            raise SettingsError(f"{name} is fixed and may differ between recordings; do one of them")
    if names and len(recordings) < 2:
        raise SettingsError(f"{', '.join(names)} may differ between recordings, but one recording came; give several")
    return tuple(sorted(set(names)))


def _factor(allowed: Mapping[str, Parameter], name: str, units: Units) -> float:
    """Shown value over SI value of a parameter; refuses unknown names."""
    return units.of(allowed[one_of("parameter", name, allowed)].dimension)[1]


def _bounds_si(allowed: Mapping[str, Parameter], bounds: Mapping[str, Range], units: Units) -> dict[str, Range]:
    """Bounds in SI; refuses unknown parameters, low > high, and what a parameter can never be."""
    out = {}
    for name, (low, high) in bounds.items():
        factor = _factor(allowed, name, units)
        if not (math.isfinite(low) and math.isfinite(high)):
            raise SettingsError(f"bound of {name}: {low:g} to {high:g} is not finite")
        if low > high:
            raise SettingsError(f"bound of {name}: low {low:g} is above high {high:g}")
        if low == high:
            raise SettingsError(f"bound of {name}: low and high are both {low:g}; fix the parameter instead")
        if allowed[name].scale == "log" and low <= 0.0:
            raise SettingsError(f"bound of {name}: low is {low:g}, but {name} is always positive")
        out[name] = (low / factor, high / factor)
    return out


def _fixed_si(allowed: Mapping[str, Parameter], fixed: Mapping[str, float], units: Units) -> dict[str, float]:
    """Give fixed values in SI; refuses unknown parameters and what a parameter can never be."""
    out = {}
    for name, value in fixed.items():
        factor = _factor(allowed, name, units)
        if not math.isfinite(value):
            raise SettingsError(f"{name} cannot be fixed at {value:g}")
        if allowed[name].scale == "log" and value <= 0.0:
            raise SettingsError(f"{name} cannot be fixed at {value:g}: it is always positive")
        out[name] = value / factor
    return out


def _f_tanh_si(f_tanh: float, units: Units) -> float:
    """Gain of the smoothed sign in s/rad (s/m); refuses what is not positive."""
    text, factor = units.of(PER_SPEED)
    if not 0.0 < f_tanh < math.inf:
        raise SettingsError(f"f_tanh is {f_tanh:g}; expected a positive number in {text}")
    return f_tanh / factor


def start_si(
    structure: Structure, start: Model | None, units: Units, constants: Mapping[str, float]
) -> dict[str, float] | None:
    """Values of the start model for the parameters that both structures have; refuses a model of another kind."""
    if start is None:
        return None
    if _dimensions(start.units) != _dimensions(units):
        raise SettingsError(
            f"start model: its units are {start.units.input} and {start.units.motion}, "
            f"the recording's {units.input} and {units.motion}"
        )
    values = start.values_si()
    common = {n: values[n] for n in structure.parameters if n in values and n not in constants}
    if not common:
        raise SettingsError(f"start model '{start.structure}' has no free parameter in common with '{structure}'")
    return common


def _dimensions(units: Units) -> tuple[object, object]:
    return parse_unit(units.input).dimension, parse_unit(units.motion).dimension
