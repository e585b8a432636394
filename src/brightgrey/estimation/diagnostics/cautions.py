"""What a recording cannot tell of effects, by their declarations and by how it was taken (no effect is named here)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from brightgrey.effects import Circumstances, Scales
from brightgrey.estimation.diagnostics.finding import Finding
from brightgrey.estimation.problem.scales import speed_of
from brightgrey.estimation.uncertainty.estimates import Estimate
from brightgrey.kit import Structure
from brightgrey.recordings import Recording
from brightgrey.recordings.units.parser import parse_unit
from brightgrey.simulation import Settings

__all__ = ["cautions", "reverses"]

_TURNED = 0.02  # of the largest speed: what counts as motion the other way
_HALF = (0.3, 0.7)  # of a sampling interval: what may be half a sample of dead time
_TORQUES = ("N m", "N")


def cautions(
    structure: Structure,
    estimates: Mapping[str, Estimate],
    recordings: Sequence[Recording],
    scales: Scales,
    settings: Settings,
) -> tuple[Finding, ...]:
    """Findings that hold beside any outcome.

    Parameters
    ----------
    structure : Structure
    estimates : mapping of str to Estimate
    recordings : sequence of Recording
    scales : Scales
        Of the recordings.
    settings : Settings
    """
    return (
        *_lags(structure, estimates, recordings),
        *_declared(structure, estimates, scales, settings, any(reverses(r) for r in recordings)),
        *_relative(structure, estimates, recordings[0]),
    )


def reverses(recording: Recording) -> bool:
    """Whether the drive moves both ways."""
    speed = speed_of(recording)
    turned = _TURNED * float(np.abs(speed).max())
    return bool(speed.max() > turned and speed.min() < -turned)


def _declared(
    structure: Structure, estimates: Mapping[str, Estimate], scales: Scales, settings: Settings, both: bool
) -> list[Finding]:
    """Cautions that effects declare."""
    found = []
    for placed in structure.placed:
        beside = tuple(
            other.effect.law
            for other in structure.placed
            if other != placed
            and other.effect.law is not None
            and (other.effect.where, other.place) == (placed.effect.where, placed.place)
        )
        values = {p.symbol: estimates[placed.parameter(p.symbol)].value for p in placed.effect.parameters}
        circumstances = Circumstances(values, scales, settings.f_tanh, beside, both)
        for caution in placed.effect.cautions:
            if caution.applies(circumstances):
                names = tuple(placed.parameter(symbol) for symbol in caution.symbols)
                found.append(Finding(caution.kind, f"{', '.join(names)}: {caution.text}", names))
    return found


def _lags(structure: Structure, estimates: Mapping[str, Estimate], recordings: Sequence[Recording]) -> list[Finding]:
    """Times by which the input comes late, against the sampling interval."""
    names = tuple(name for name, p in structure.parameters.items() if p.lag)
    if not names:
        return []
    dt = min(r.dt for r in recordings)
    values = [estimates[name].value for name in names]
    total, sum_ = " + ".join(names), sum(values)
    below = f"is below one sampling interval ({dt:.3g} s): this is sampling, no evidence"
    found = [
        Finding("sampling", f"{name} = {value:.3g} s {below}", (name,))
        for name, value in zip(names, values, strict=True)
        if value < dt
    ]
    if len(names) > 1 and min(values) < 2.0 * dt:
        text = f"so near the sampling interval only {total} = {sum_:.3g} s is shown, not {' and '.join(names)} alone"
        found.append(Finding("sampling", text, names))
    kinds = {signal.kind for r in recordings for signal in r.outputs}
    causes = [
        *(["an input that was held between samples (zoh)"] if any(r.hold == "linear" for r in recordings) else []),
        *(["a velocity made by differencing a position (velocity-differenced)"] if "velocity" in kinds else []),
    ]
    if causes and _HALF[0] * dt < sum_ < _HALF[1] * dt:
        text = f"{total} is about half a sample: {' or '.join(causes)} looks just so"
        found.append(Finding("sampling", text, names))
    return found


def _relative(structure: Structure, estimates: Mapping[str, Estimate], recording: Recording) -> list[Finding]:
    """An input that is no torque or force scales everything that is measured by it."""
    unit = parse_unit(recording.input.unit)
    if recording.input.unit_given and unit.dimension in [parse_unit(text).dimension for text in _TORQUES]:
        return []
    names = tuple(n for n, p in structure.parameters.items() if p.dimension.input and n in estimates)
    if not names:
        return []
    why = f"is in {recording.input.unit}" if recording.input.unit_given else "has no unit"
    text = f"the input {why}, and its gain to torque or force is not known: of {', '.join(names)} only ratios hold"
    return [Finding("scale unknown", text, names)]
