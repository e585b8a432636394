"""What differs for control between structures that a recording cannot tell apart, in its units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.control.linear.model_differences import FrequencyBand, ModelFigures, excited_band, model_figures
from brightgrey.effects import TORQUE
from brightgrey.errors import SettingsError
from brightgrey.kit import StateSpace, Structure, assemble
from brightgrey.recordings import Recording
from brightgrey.search.comparison import Judged
from brightgrey.search.evidence import Evidence, has
from brightgrey.search.lattice import one_larger
from brightgrey.simulation import Settings

__all__ = ["ControlDifference", "compare_for_control"]

_HALF = 0.5  # of the largest speed: where models are linearised
_SHOWN = 6  # poles
_NOTHING = 1e-9  # of the largest input: rounding


@dataclass(frozen=True)
class ControlDifference:
    """One of several structures that are tied, and what it says to a control engineer.

    Attributes
    ----------
    structure : Structure
    minimal : bool
        Else it is a minimal one with an optional effect.
    rows : tuple of (str, str)
        Names and values as text with units, the same names for all structures.
    numbers : ModelFigures
        The same in SI.
    """

    structure: Structure
    minimal: bool
    rows: tuple[tuple[str, str], ...]
    figures: ModelFigures


def compare_for_control(
    evidence: Evidence, recordings: Sequence[Recording], settings: Settings
) -> tuple[ControlDifference, ...]:
    """Compare the minimal structures and those of their extensions by an optional effect that were refitted.

    The first is the best minimal structure, which the others are compared with. One structure alone gives none, and
    one without a steady motion (a gap that would have to carry a load) is left out.
    """
    tied = _tied_structures(evidence)
    kinds = [s.kind for s in recordings[0].outputs]
    outputs = ["velocity" if kind == "velocity-differenced" else kind for kind in kinds]
    over = excited_band([r.u for r in recordings], min(r.dt for r in recordings))
    made: list[tuple[Judged, StateSpace]] = []
    for judged in tied:
        own = {name: judged.values[name] for name in judged.structure.parameters}
        system = assemble(judged.structure, own, settings.f_tanh, outputs)
        try:
            model_figures([system], _HALF * settings.speed_scale, settings.f_tanh, over)
        except SettingsError:
            continue
        made.append((judged, system))
    if len(made) < 2:
        return ()
    found = model_figures([system for _, system in made], _HALF * settings.speed_scale, settings.f_tanh, over)
    least = {j.structure for j in evidence.minimal}
    return tuple(
        ControlDifference(
            judged.structure, judged.structure in least, _table_rows(n, over, recordings[0], first=k == 0), n
        )
        for k, ((judged, _), n) in enumerate(zip(made, found, strict=True))
    )


def _tied_structures(evidence: Evidence) -> list[Judged]:
    """Minimal structures, then what they become with one optional effect, as far as refitted."""
    minimal = [j.structure for j in evidence.minimal]
    more = {
        e: evidence.judged[e]
        for s in minimal
        for e in one_larger(s, evidence.judged)
        if e not in minimal and any(has(e, o) and not has(s, o) for o in evidence.optional)
    }
    return [*evidence.minimal, *(more[s] for s in sorted(more, key=lambda s: evidence.criterion[s]))]


def _table_rows(
    n: ModelFigures, over: FrequencyBand, recording: Recording, *, first: bool
) -> tuple[tuple[str, str], ...]:
    unit, factor = recording.units.of(TORQUE)
    least = _NOTHING * float(np.abs(recording.u).max())
    friction, constant = (
        factor * value if abs(value) > least else 0.0 for value in (n.standstill_friction, n.constant_input)
    )
    within = f"{over.low:.2g} to {over.high:.3g} Hz"
    ratio = "0 dB (compared with)" if first else f"{round(n.gain_difference, 2) + 0.0:+.2f} dB at {n.frequency:.3g} Hz"
    swings = ", ".join(f"{s.frequency:.3g} Hz (damping {s.damping:.2g})" for s in n.resonances)
    return (
        (f"gain apart, {within}", ratio),
        (f"phase apart, {within}", "0°" if first else f"{n.phase_difference:.1f}°"),
        ("resonances", swings or "none"),
        ("poles in 1/s", _pole_text(n)),
        ("dead time", f"{1e3 * n.dead_time:.3g} ms"),
        ("friction at standstill", f"{friction:.3g} {unit}"),
        ("constant part of the input", f"{constant:.3g} {unit}"),
    )


def _pole_text(n: ModelFigures) -> str:
    upper = [p for p in n.poles if p.imag >= 0.0]
    parts = [f"{p.real:.3g} ± {p.imag:.3g}i" if p.imag > 1e-9 * abs(p) else f"{p.real:.3g}" for p in upper[:_SHOWN]]
    return ", ".join(parts).replace("-0,", "0,") or "none"
