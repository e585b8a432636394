"""Differences for control between structures that a recording cannot tell apart, in its units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.control.linear.model_differences import FrequencyBand, ModelFigures, excited_band, model_figures
from brightgrey.control.policy import ANALYSIS
from brightgrey.effects import TORQUE
from brightgrey.errors import SettingsError
from brightgrey.kit import StateSpace, Structure, assemble
from brightgrey.numerics.number_format import significant
from brightgrey.recordings import Recording
from brightgrey.search.evidence import Evidence
from brightgrey.search.fitting.refined_fit import Refined
from brightgrey.search.lattice import has, one_larger
from brightgrey.simulation import Settings

__all__ = ["ControlDifference", "compare_for_control"]

SHOWN_POLES = 6
ROUNDING_ERROR = 1e-9  # relative: what is smaller is shown as 0


@dataclass(frozen=True)
class ControlDifference:
    """Properties for control of one of several equivalent structures.

    Attributes
    ----------
    structure : Structure
    minimal : bool
        True for a minimal structure, False for one with an optional effect more.
    rows : tuple of (str, str)
        Names and values as text with units, the same names for all structures.
    figures : ModelFigures
        The same in SI.
    """

    structure: Structure
    minimal: bool
    rows: tuple[tuple[str, str], ...]
    figures: ModelFigures


def compare_for_control(
    evidence: Evidence, recordings: Sequence[Recording], settings: Settings
) -> tuple[ControlDifference, ...]:
    """Compare the minimal structures, and those with one optional effect more, if they were refitted.

    The first structure is compared with the others. A structure without a steady motion is left out, for example one
    whose gap would have to carry a load. A single structure gives an empty result.
    """
    tied = _tied_structures(evidence)
    outputs = [s.physical for s in recordings[0].outputs]
    band = excited_band([r.u for r in recordings], min(r.dt for r in recordings))
    comparable: list[tuple[Refined, StateSpace]] = []
    for refined in tied:
        own = {name: refined.values[name] for name in refined.structure.parameters}
        system = assemble(refined.structure, own, settings.f_tanh, outputs)
        try:
            model_figures([system], ANALYSIS.part_of_speed * settings.speed_scale, settings.f_tanh, band)
        except SettingsError:
            continue
        comparable.append((refined, system))
    if len(comparable) < 2:
        return ()
    found = model_figures(
        [system for _, system in comparable], ANALYSIS.part_of_speed * settings.speed_scale, settings.f_tanh, band
    )
    minimal = {j.structure for j in evidence.minimal}
    return tuple(
        ControlDifference(
            refined.structure, refined.structure in minimal, _table_rows(n, band, recordings[0], first=k == 0), n
        )
        for k, ((refined, _), n) in enumerate(zip(comparable, found, strict=True))
    )


def _tied_structures(evidence: Evidence) -> list[Refined]:
    """The first structure, the minimal ones, then those with one optional effect more, as far as refitted."""
    leading = {j.structure: j for j in (evidence.first, *evidence.minimal)}
    more = {
        e: evidence.refined[e]
        for s in (j.structure for j in evidence.minimal)
        for e in one_larger(s, evidence.refined)
        if e not in leading and any(has(e, o) and not has(s, o) for o in evidence.optional)
    }
    return [*leading.values(), *(more[s] for s in sorted(more, key=lambda s: evidence.criterion[s]))]


def _table_rows(
    n: ModelFigures, band: FrequencyBand, recording: Recording, *, first: bool
) -> tuple[tuple[str, str], ...]:
    unit, factor = recording.units.of(TORQUE)
    largest = float(np.abs(recording.u).max())
    friction, constant = (
        factor * _no_rounding_error(value, largest) for value in (n.standstill_friction, n.constant_input)
    )
    within = f"{band.low:.2g} to {band.high:.3g} Hz"
    ratio = "0 dB (reference)" if first else f"{round(n.gain_difference, 2) + 0.0:+.2f} dB at {n.frequency:.3g} Hz"
    resonances = ", ".join(
        f"{s.frequency:.3g} Hz (damping {_no_rounding_error(s.damping, 1.0):.2g})" for s in n.resonances
    )
    return (
        (f"gain difference, {within}", ratio),
        (f"phase difference, {within}", "0°" if first else f"{n.phase_difference:.1f}°"),
        ("resonances", resonances or "none"),
        ("poles in 1/s", _pole_text(n)),
        ("dead time", f"{1e3 * n.dead_time:.3g} ms"),
        ("friction at standstill", f"{friction:.3g} {unit}"),
        ("constant part of the input", f"{constant:.3g} {unit}"),
    )


def _pole_text(n: ModelFigures) -> str:
    upper = [p for p in n.poles if p.imag >= 0.0]
    parts = []
    for p in upper[:SHOWN_POLES]:
        real, imag = (_no_rounding_error(part, abs(p)) for part in (p.real, p.imag))
        parts.append(f"{significant(real, 3)} ± {significant(imag, 3)}i" if imag else significant(real, 3))
    return ", ".join(parts) or "none"


def _no_rounding_error(value: float, size: float) -> float:
    """`value`, or 0 where it is the rounding error of a quantity of that size."""
    return value if abs(value) > ROUNDING_ERROR * size else 0.0
