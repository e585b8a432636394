"""Cautions: limits of what a recording says about effects, by their declarations and by its sampling.

No effect is named here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from brightgrey.effects import Circumstances, Scales
from brightgrey.estimation.diagnostics.finding import Finding
from brightgrey.estimation.diagnostics.options import DIAGNOSTIC_DEFAULTS, DiagnosticOptions
from brightgrey.estimation.problem.scales import speed_of
from brightgrey.estimation.uncertainty.estimates import Estimate
from brightgrey.kit import Placed, Structure
from brightgrey.recordings import Recording
from brightgrey.recordings.units.parser import parse_unit
from brightgrey.simulation import Settings

__all__ = ["cautions", "reverses"]

_TORQUE_UNITS = ("N m", "N")


def cautions(
    structure: Structure,
    estimates: Mapping[str, Estimate],
    recordings: Sequence[Recording],
    scales: Scales,
    settings: Settings,
    options: DiagnosticOptions = DIAGNOSTIC_DEFAULTS,
) -> tuple[Finding, ...]:
    """Findings that hold beside any outcome.

    Parameters
    ----------
    structure : Structure
    estimates : mapping of str to Estimate
    recordings : sequence of Recording
    scales : Scales
        Scales of the recordings.
    settings : Settings
    options : DiagnosticOptions
    """
    both_directions = any(reverses(r, options) for r in recordings)
    return (
        *_lag_cautions(structure, estimates, recordings, options),
        *_declared_cautions(structure, estimates, scales, settings, both_directions),
        *_scale_cautions(structure, estimates, recordings[0]),
    )


def reverses(recording: Recording, options: DiagnosticOptions = DIAGNOSTIC_DEFAULTS) -> bool:
    """True if the drive moves in both directions."""
    speed = speed_of(recording)
    limit = options.reversal_speed * float(np.abs(speed).max())
    return bool(speed.max() > limit and speed.min() < -limit)


def _declared_cautions(
    structure: Structure, estimates: Mapping[str, Estimate], scales: Scales, settings: Settings, both: bool
) -> list[Finding]:
    """Cautions that the effects of the structure declare."""
    found = []
    for placed in structure.placed:
        beside = tuple(
            other.effect.law
            for other in structure.placed
            if other != placed
            and other.effect.law is not None
            and (other.effect.where, other.place) == (placed.effect.where, placed.place)
        )
        owners = (placed, *(Placed(name, placed.place) for name in placed.effect.requires))
        values = {p.symbol: estimates[o.parameter(p.symbol)].value for o in owners for p in o.effect.parameters}
        circumstances = Circumstances(values, scales, settings.f_tanh, beside, both)
        for caution in placed.effect.cautions:
            if caution.applies(circumstances):
                names = tuple(placed.parameter(symbol) for symbol in caution.symbols)
                found.append(Finding(caution.kind, f"{', '.join(names)}: {caution.text}", names))
    return found


def _lag_cautions(
    structure: Structure,
    estimates: Mapping[str, Estimate],
    recordings: Sequence[Recording],
    options: DiagnosticOptions,
) -> list[Finding]:
    """Cautions on lags and dead times that are near the sampling interval."""
    names = tuple(name for name, p in structure.parameters.items() if p.lag)
    if not names:
        return []
    dt = min(r.dt for r in recordings)
    values = [estimates[name].value for name in names]
    names_of_sum, total = " + ".join(names), sum(values)
    below = f"is below one sampling interval ({dt:.3g} s): sampling explains it, so it is no evidence of a lag"
    found = [
        Finding("sampling", f"{name} = {value:.3g} s {below}", (name,))
        for name, value in zip(names, values, strict=True)
        if value < dt
    ]
    if len(names) > 1 and min(values) < 2.0 * dt:
        parts = " and ".join(names)
        text = f"so near the sampling interval only {names_of_sum} = {total:.3g} s is identified, not each of {parts}"
        found.append(Finding("sampling", text, names))
    kinds = {signal.kind for r in recordings for signal in r.outputs}
    causes = [
        *(
            ["an input that is held between samples (--hold zoh)"]
            if any(r.hold == "linear" for r in recordings)
            else []
        ),
        *(["a velocity from differences of positions (velocity-differenced)"] if "velocity" in kinds else []),
    ]
    low, high = options.half_sample
    if causes and low * dt < total < high * dt:
        text = f"{names_of_sum} is about half a sample: {' or '.join(causes)} would look the same"
        found.append(Finding("sampling", text, names))
    return found


def _scale_cautions(structure: Structure, estimates: Mapping[str, Estimate], recording: Recording) -> list[Finding]:
    """Caution if the input is no torque or force: its unknown gain scales inertias, stiffnesses and torques."""
    unit = parse_unit(recording.input.unit)
    if recording.input.unit_given and unit.dimension in [parse_unit(text).dimension for text in _TORQUE_UNITS]:
        return []
    names = tuple(n for n, p in structure.parameters.items() if p.dimension.input and n in estimates)
    if not names:
        return []
    why = f"is in {recording.input.unit}" if recording.input.unit_given else "has no unit"
    text = f"the input {why} and its gain to torque or force is unknown: of {', '.join(names)} only ratios are known"
    return [Finding("scale unknown", text, names)]
