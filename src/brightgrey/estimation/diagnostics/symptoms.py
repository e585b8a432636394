"""Symptoms: what an engineer would be told of a fit that is not right yet, and what to try."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import DAMPING, Effect, Scales, registry
from brightgrey.estimation.diagnostics.outcome import FitContext
from brightgrey.estimation.diagnostics.residual_regressors import (
    DRIFT,
    RESONANCE,
    TIME_SHIFT,
    candidate_regressors,
    motions,
)
from brightgrey.estimation.diagnostics.residual_tests import Candidate, Detected, detect_regressors
from brightgrey.estimation.diagnostics.spectral_peaks import peak
from brightgrey.estimation.diagnostics.torque_patterns import TORQUE_PATTERNS, SimulatedMotion, TorquePattern
from brightgrey.kit import Structure
from brightgrey.recordings import Recording

__all__ = ["Symptom", "symptoms"]

_LEVEL = 0.01  # chance of a symptom by residuals that follow nothing, and the same of a peak
_LATE = 2.0  # sampling intervals from which a lag is large
_HALF = (0.3, 0.7)  # of a sampling interval: what may be half a sample


@dataclass(frozen=True)
class Symptom:
    """One symptom.

    Attributes
    ----------
    title : str
        A few words.
    seen : str
        What the recording shows; one sentence without its full stop.
    advice : str
        What to try; one sentence without its full stop.
    """

    title: str
    seen: str
    advice: str


def symptoms(ended: FitContext, scales: Scales) -> tuple[Symptom, ...]:
    """Symptoms of a fit: of its parameters, then of its residual.

    Parameters
    ----------
    ended : FitContext
        Its residual is that of its best values.
    scales : Scales
        Of the recordings.

    Notes
    -----
    A residual that follows nothing gives a symptom in about 1 % of all fits, and a peak in about as many
    (`bench/symptoms.py`).
    """
    values = dict(zip(ended.search.names, ended.best.values.tolist(), strict=True)) | dict(ended.search.fixed)
    structure = ended.problem.structure
    found = [*_another_mass(structure, values, ended, scales), *_faded(structure, values, ended, scales)]
    residual = ended.best.residual
    if not np.isfinite(ended.best.cost) or not residual.any():
        return tuple(found)
    named = {name: np.array([value]) for name, value in values.items()}
    return (*found, *_peaks(ended, named), *_followed(ended, named, scales))


# --- parameters ---


def _another_mass(
    structure: Structure, values: Mapping[str, float], ended: FitContext, scales: Scales
) -> list[Symptom]:
    """Damping at its bound together with a large delay."""
    at = ended.estimates.by_name
    dampings = [
        p.parameter(q.symbol)
        for p in structure.placed
        for q in p.effect.parameters
        if p.effect.masses and q.dimension == DAMPING
    ]
    late = [name for name, q in structure.parameters.items() if q.lag and values[name] > _LATE * scales.interval]
    limited = [name for name in dampings if name in at and at[name].at_bound]
    if not limited or not late:
        return []
    sides = ", ".join(f"{name} is at its {at[name].at_bound} bound" for name in limited)
    lags = " and ".join(f"{name} = {values[name]:.3g} s" for name in late)
    return [Symptom("Another mass suspected", f"{sides}, and {lags} is large", _more_masses(structure))]


def _more_masses(structure: Structure) -> str:
    more = next((e.name for e in registry().values() if e.masses == structure.masses + 1), None)
    return f"try {more}: one more mass swings and lags" if more else "no effect has more masses than this one"


def _faded(structure: Structure, values: Mapping[str, float], ended: FitContext, scales: Scales) -> list[Symptom]:
    """Effects whose size ran to its bound below anything that matters."""
    found = []
    for placed in structure.placed:
        if placed.effect.masses:
            continue
        gone = [
            name
            for name, size in placed.relevant_size(scales, values).items()
            if name in ended.estimates.by_name
            and ended.estimates.by_name[name].at_bound == "low"
            and 0.0 <= values[name] < size
        ]
        if gone:
            text = f"{', '.join(gone)} ran to the low bound, below any size that matters"
            found.append(Symptom(f"{placed.effect.title} has faded away", text, f"leave {placed} out"))
    return found


# --- residuals ---


def _peaks(ended: FitContext, named: Mapping[str, Array]) -> list[Symptom]:
    """The highest peak of every output of every recording that has one; of several within 10 % only the highest."""
    found, begin = [], 0
    problem, f_tanh = ended.problem, ended.settings.f_tanh
    moved = motions(problem, named, ended.settings)
    count = sum(len(r.outputs) for r in problem.recordings)
    for r, motion in zip(problem.recordings, moved, strict=True):
        for signal in r.outputs:
            e = ended.best.residual[begin : begin + r.samples]
            begin += r.samples
            hit = peak(e, r.u, _sides(motion, f_tanh), r.dt, _LEVEL / count)
            if hit is not None:
                found.append((hit, signal.name))
    found.sort(key=lambda pair: -pair[0].ratio)
    kept: list[Symptom] = []
    told: list[float] = []
    for hit, name in found:
        if any(abs(hit.frequency / f - 1.0) < 0.1 for f in told):
            continue
        told.append(hit.frequency)
        seen = (
            f"the residual of {name} has a peak at {hit.frequency:.3g} Hz,"
            f" {10.0 * np.log10(hit.ratio):.0f} dB above its surroundings"
        )
        if hit.coherent:
            advice = f"{_more_masses(ended.problem.structure)}; it hangs together with the input there"
        else:
            advice = (
                "it does not hang together with the input there: look for a vibration or hum from elsewhere,"
                f" or {_more_masses(ended.problem.structure)}"
            )
        kept.append(Symptom("Peak in the residual", seen, advice))
    return kept


def _sides(motion: SimulatedMotion, f_tanh: float) -> list[Array]:
    """What makes lines in a spectrum beside the input: reversals."""
    if not np.isfinite(motion.speed).all():
        return []
    side = np.tanh(f_tanh * motion.speed)
    return [side, side**2, motion.speed]


def _followed(ended: FitContext, named: Mapping[str, Array], scales: Scales) -> list[Symptom]:
    """Patterns that the residual follows."""
    problem, best = ended.problem, ended.best
    asked = candidate_regressors(problem, named, ended.settings, scales, best.residual)
    lengths = [r.samples for r in problem.recordings for _ in r.outputs]
    questions = [Candidate(s.columns, s.kind, later=not s.described) for s in asked]
    hits = detect_regressors(best.residual, best.jacobian, lengths, questions, _LEVEL)
    found = []
    for hit in hits:
        kind = asked[hit.number].kind
        effect = registry().get(kind)
        if effect is not None:
            found.append(_missing(effect, hit))
        elif kind == RESONANCE:
            found.append(_swings(hit, asked[hit.number].frequency, problem.structure))
        else:
            found.append(_SAID[kind](hit, problem.recordings))
    return found


def _explains(hit: Detected) -> str:
    share = 1.0 - np.sqrt(max(1.0 - hit.share, 0.0))
    return f"{100.0 * share:.2g} % of the residual"


def _missing(effect: Effect, hit: Detected) -> Symptom:
    return Symptom(
        f"{effect.title} suspected",
        f"the residual follows {effect.residual_signature}, which explains {_explains(hit)}",
        f"try {effect.name} as well, or search for the structure",
    )


def _swings(hit: Detected, frequency: float, structure: Structure) -> Symptom:
    seen = f"the residual follows what a resonance near {frequency:.2g} Hz makes of the input"
    return Symptom("Resonance suspected", f"{seen}, which explains {_explains(hit)}", _more_masses(structure))


def _torque_pattern(pattern: TorquePattern, hit: Detected, recordings: tuple[Recording, ...]) -> Symptom:
    seen = f"the residual follows {pattern.follows}, which explains {_explains(hit)}"
    return Symptom(pattern.title, seen, pattern.advice)


def _drift(hit: Detected, recordings: tuple[Recording, ...]) -> Symptom:
    begins = [(r, signal) for r in recordings for signal in r.outputs]
    (r, signal), slope = max(zip(begins, hit.coefficients, strict=True), key=lambda pair: abs(float(pair[1])))
    change = f"{-float(slope) * signal.factor:.2g} {signal.unit}"
    return Symptom(
        "Drift",
        f"{signal.name} of {r.name} drifts by {change} from begin to end against the model",
        "look for a drift of the sensor, or friction that changes while the drive warms up; a shorter --window helps",
    )


def _late(hit: Detected, recordings: tuple[Recording, ...]) -> Symptom:
    late, dt = float(hit.coefficients[0]), min(r.dt for r in recordings)
    kinds = {signal.kind for r in recordings for signal in r.outputs}
    names = ", ".join(e.name for e in registry().values() if any(p.lag for p in e.parameters))
    if late < 0.0:
        return Symptom(
            "Output comes early",
            f"the outputs come {-late:.2g} s before what the input explains",
            "check the time stamps: input and output were not sampled together",
        )
    seen = f"the outputs come {late:.2g} s ({late / dt:.2g} samples) late, which explains {_explains(hit)}"
    if late < dt:
        causes = [
            *(["--hold zoh (an input held between samples)"] if any(r.hold == "linear" for r in recordings) else []),
            *(["velocity-differenced (a velocity made from positions)"] if "velocity" in kinds else []),
        ]
        half = _HALF[0] * dt < late < _HALF[1] * dt
        how = f"half a sample looks like {' or '.join(causes)}" if half and causes else "this is sampling, no evidence"
        return Symptom("Late by less than a sample", seen, how)
    return Symptom("Delay suspected", seen, f"try {names}")


_SAID: Mapping[str, Callable[[Detected, tuple[Recording, ...]], Symptom]] = {
    **{pattern.name: partial(_torque_pattern, pattern) for pattern in TORQUE_PATTERNS},
    DRIFT: _drift,
    TIME_SHIFT: _late,
}
