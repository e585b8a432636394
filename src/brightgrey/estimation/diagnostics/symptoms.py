"""Symptoms: signs in a fit that the model is not right yet, and what to try."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from brightgrey.arrays import Array, positive
from brightgrey.effects import DAMPING, Scales, registry
from brightgrey.estimation.diagnostics.options import (
    DIAGNOSTIC_DEFAULTS,
    PEAK_DEFAULTS,
    DiagnosticOptions,
)
from brightgrey.estimation.diagnostics.outcome import FitContext
from brightgrey.estimation.diagnostics.recording_faults import RecordingFault, recording_faults
from brightgrey.estimation.diagnostics.residual_regressors import (
    DRIFT,
    RESONANCE,
    TIME_SHIFT,
    candidate_regressors,
    motions,
)
from brightgrey.estimation.diagnostics.residual_tests import Candidate, Detected, detect_regressors
from brightgrey.estimation.diagnostics.spectral_peaks import Peak, highest_peak
from brightgrey.estimation.diagnostics.torque_patterns import TORQUE_PATTERNS, SimulatedMotion, TorquePattern
from brightgrey.estimation.problem.segments import segments, split_recordings
from brightgrey.kit import Placed, Structure
from brightgrey.kit.in_words import effect_in_words
from brightgrey.recordings import Recording

__all__ = ["Symptom", "residual_symptoms", "symptoms"]


@dataclass(frozen=True)
class Symptom:
    """One symptom."""

    title: str  #: A few words.
    observation: str  #: What the recording shows; one sentence without its full stop.
    advice: str  #: What to try; one sentence without its full stop.
    #: The motion holds something that the model lacks; False where sampling or a vibration from elsewhere explains it.
    unmodelled: bool = True
    suggested: tuple[Placed, ...] = ()  #: Effects that may explain it, each by itself.
    #: Part of the residual's sum of squares that follows it; 0 where that is not known.
    share: float = 0.0


def symptoms(
    context: FitContext, scales: Scales, options: DiagnosticOptions = DIAGNOSTIC_DEFAULTS
) -> tuple[Symptom, ...]:
    """Symptoms of a fit: of its parameters, then of its residual.

    Parameters
    ----------
    context : FitContext
        Its residual is that of its best values.
    scales : Scales
        Scales of the recordings.
    options : DiagnosticOptions

    Notes
    -----
    A residual that follows nothing gives a symptom in about 1 % of all fits, and a peak in about as many
    (`bench/symptoms.py`).
    """
    values = context.space.by_name(context.best.values)
    faults = [_recording_fault(fault, context.problem.recordings) for fault in recording_faults(context, options)]
    residual = residual_symptoms(context, scales, options)
    of_parameters = _missing_mass(context, values, scales, options)
    complete = not any(symptom.unmodelled for symptom in (*of_parameters, *residual))
    of_parameters += _effects_at_bound(context, values, scales, complete=complete)
    return (*of_parameters, *faults, *residual)


def residual_symptoms(
    context: FitContext, scales: Scales, options: DiagnosticOptions = DIAGNOSTIC_DEFAULTS
) -> tuple[Symptom, ...]:
    """Symptoms of the residual alone; arguments as for :func:`symptoms`."""
    if not np.isfinite(context.best.cost) or not context.best.residual.any():
        return ()
    arrays = context.space.named(context.best.values[:, None])
    return (
        *_peaks(context, arrays, options),
        *_detected(context, arrays, scales, options),
        *_bad_starts(context, options),
    )


# --- parameters ---


def _missing_mass(
    context: FitContext, values: Mapping[str, float], scales: Scales, options: DiagnosticOptions
) -> list[Symptom]:
    """Damping at its bound together with a large lag."""
    structure, estimates = context.problem.structure, context.estimates.by_name
    dampings = [
        p.parameter(q.symbol)
        for p in structure.placed
        for q in p.effect.parameters
        if p.effect.masses and q.dimension == DAMPING
    ]
    large = options.large_lag * scales.interval
    lags = [name for name, q in structure.parameters.items() if q.lag and values[name] > large]
    at_bound = [name for name in dampings if name in estimates and estimates[name].at_bound]
    if not at_bound or not lags:
        return []
    sides = ", ".join(f"{n} is at its {'lower' if estimates[n].at_bound == 'low' else 'upper'} bound" for n in at_bound)
    large_lags = " and ".join(f"{name} = {values[name]:.3g} s" for name in lags)
    observation = f"{sides}, and {large_lags} is large"
    return [Symptom("Another mass suspected", observation, _one_more_mass(structure))]


def _one_more_mass(structure: Structure) -> str:
    tried = " or ".join(effect_in_words(p) for p in _further_mass(structure))
    return f"try {tried}: it oscillates and lags" if tried else "no effect has more masses than this one"


def _further_mass(structure: Structure) -> tuple[Placed, ...]:
    return tuple(Placed(e.name) for e in registry().values() if e.masses == structure.masses + 1)


def _effects_at_bound(
    context: FitContext, values: Mapping[str, float], scales: Scales, *, complete: bool
) -> list[Symptom]:
    """Effects whose size is at its lower bound, below any relevant size: negligible if the model is `complete`.

    Else their part may have gone to another effect, in the place of one that is missing.
    """
    found = []
    for placed in context.problem.structure.placed:
        if placed.effect.masses:
            continue
        negligible = [
            name
            for name, size in placed.relevant_size(scales, values).items()
            if name in context.estimates.by_name
            and context.estimates.by_name[name].at_bound == "low"
            and 0.0 <= values[name] < size
        ]
        if negligible:
            observation = f"{', '.join(negligible)} is at its lower bound, below any relevant size"
            title, advice = f"{placed.effect.title} is negligible", f"leave out {effect_in_words(placed)}"
            if not complete:
                title = f"{placed.effect.title} is at its lower bound"
                advice = (
                    "this need not be true of the drive: the model lacks something, as the other symptoms say, and"
                    " other effects may have taken its part. Mend that first"
                )
            found.append(Symptom(title, observation, advice))
    return found


# --- faults of the recording ---


def _recording_fault(fault: RecordingFault, recordings: tuple[Recording, ...]) -> Symptom:
    """Symptom of a fault that the fit needs beside the parameters."""
    if fault.kind == "drift":
        signal = recordings[0].input
        size, std = fault.size * signal.factor, fault.std * signal.factor
        return Symptom(
            "Torque drifts",
            f"the fit needs a torque that grows with the time, by {size:.3g} ± {2.0 * std:.1g} {signal.unit} over the"
            " recording",
            "the structure may lack an effect, friction may change while the drive warms up, or the sensor of the"
            " torque drifts. After a motion to one side first, a constant load or friction by direction looks alike:"
            " try them, let the drive warm up, or use a shorter --window",
        )
    if fault.kind == "sign":
        name = recordings[0].input.name
        return Symptom(
            "Input has the wrong sign",
            f"with the sign of '{name}' turned the same structure leaves {100.0 * fault.size:.2g} % of the residual's"
            " sum of squares",
            "a positive input has to accelerate the motion: turn its sign by --input-gain -1 (times the gain that was"
            " given). Above a resonance that the structure lacks the motion is opposite, too",
        )
    if fault.kind == "jump":
        r = recordings[fault.recording]
        signal = r.outputs[fault.output]
        size, std = fault.size * signal.factor, fault.std * signal.factor
        return Symptom(
            "Position jumps",
            f"the fit needs '{signal.name}' of {r.name} to jump by {size:.3g} ± {2.0 * std:.1g} {signal.unit} at"
            f" {fault.time:.6g} s",
            "samples are lost there without a gap in the time, the encoder slips, or the structure lacks an effect: use"
            " the time before or after it by --window",
        )
    first, name = recordings[0].outputs[0].name, recordings[0].outputs[fault.output].name
    way = "later" if fault.size > 0.0 else "earlier"
    return Symptom(
        "Outputs are not of one time",
        f"the fit needs '{name}' to come {abs(fault.size):.2g} ± {2.0 * fault.std:.1g} s {way} than '{first}'",
        "a skew of clocks, a filter of one channel, or an effect that the structure lacks: a skew is taken back by"
        f" --shift '{name}={-fault.size:.3g}'",
    )


# --- residuals ---


def _peaks(context: FitContext, values: Mapping[str, Array], options: DiagnosticOptions) -> list[Symptom]:
    """Highest peak of every segment; of several at about the same frequency, only the highest."""
    problem, f_tanh = context.problem, context.settings.f_tanh
    moved = motions(problem, values, context.settings)
    level, found = options.symptom_level / len(problem.segment_lengths), []
    for (r, errors), motion in zip(split_recordings(context.best.residual, problem.recordings), moved, strict=True):
        for signal, error in zip(r.outputs, errors, strict=True):
            peak = highest_peak(error, r.u, _periodic_signals(motion, f_tanh), r.dt, level)
            if peak is not None:
                found.append((peak, signal.name))
    found.sort(key=lambda pair: -pair[0].ratio)
    kept: list[Symptom] = []
    reported: list[float] = []
    for peak, name in found:
        if not any(abs(peak.frequency / f - 1.0) < PEAK_DEFAULTS.same_frequency for f in reported):
            reported.append(peak.frequency)
            kept.append(_peak_symptom(peak, name, problem.structure))
    return kept


def _peak_symptom(peak: Peak, name: str, structure: Structure) -> Symptom:
    observation = (
        f"the residual of {name} has a peak at {peak.frequency:.3g} Hz,"
        f" {10.0 * np.log10(peak.ratio):.0f} dB above the neighbouring frequencies"
    )
    more = _one_more_mass(structure)
    advice = (
        f"{more}; the residual is coherent with the input at this frequency"
        if peak.coherent
        else f"the residual is not coherent with the input there: look for a vibration or hum from elsewhere, or {more}"
    )
    return Symptom("Peak in the residual", observation, advice, peak.coherent, _further_mass(structure))


def _bad_starts(context: FitContext, options: DiagnosticOptions) -> list[Symptom]:
    """Starts of recordings that leave far more than any later part, by more than the motion differs there."""
    estimated = any(part.name.startswith("speed") for part in context.problem.unknown_initial)
    advice = (
        "what the drive did before the first sample may act on there: leave the start out by --window"
        if estimated
        else "the drive was not at rest there, or a gap was open: try --initial estimated, or leave the start out by"
        " --window"
    )
    found = []
    for r, errors in split_recordings(context.best.residual, context.problem.recordings):
        length = r.samples // options.start_blocks
        if length < options.start_samples:
            continue
        for signal, y, error in zip(r.outputs, r.y, errors, strict=True):
            left, moved = (_mean_squares(x, length) for x in (error, np.gradient(y)))
            times, livelier = (float(x[0] / positive(x[1:].max())) for x in (left, moved))
            if times > options.start_ratio * max(livelier, 1.0):
                observation = (
                    f"the first {length * r.dt:.2g} s of {signal.name} in {r.name} leave a residual whose RMS is"
                    f" {np.sqrt(times):.2g} times that of any later part"
                )
                found.append(Symptom("Start is off", observation, advice, unmodelled=False))
    return found


def _mean_squares(x: Array, length: int) -> Array:
    """Mean squares of blocks of a length, shape (blocks,)."""
    blocks = x[: x.size // length * length].reshape(-1, length)
    return np.asarray(np.square(blocks).mean(axis=1))


def _periodic_signals(motion: SimulatedMotion, f_tanh: float) -> list[Array]:
    """Signals that make lines in a spectrum beside the input: reversals and the speed."""
    if not np.isfinite(motion.speed).all():
        return []
    direction = np.tanh(f_tanh * motion.speed)
    return [direction, direction**2, motion.speed]


def _detected(
    context: FitContext, values: Mapping[str, Array], scales: Scales, options: DiagnosticOptions
) -> list[Symptom]:
    """Regressors that the residual follows."""
    problem, best = context.problem, context.best
    regressors = candidate_regressors(problem, values, context.settings, scales, best.residual)
    candidates = [Candidate(s.columns, s.kind, later=not s.described, compared=s.compared) for s in regressors]
    hits = detect_regressors(best.residual, best.jacobian, problem.segment_lengths, candidates, options.symptom_level)
    found = []
    for hit in hits:
        kind = regressors[hit.number].kind
        if kind.partition("@")[0] in registry():
            found.append(_missing_effect(Placed.parse(kind), hit))
        elif kind == RESONANCE:
            found.append(_resonance(hit, regressors[hit.number].frequency, problem.structure))
        elif kind == TIME_SHIFT:
            found.append(_time_shift(hit, problem.recordings, options))
        else:
            found.append(_SYMPTOM_OF[kind](hit, problem.recordings))
    return found


def _explains(hit: Detected) -> str:
    share = 1.0 - np.sqrt(max(1.0 - hit.share, 0.0))
    return f"explains {100.0 * share:.2g} % of the residual"


def _missing_effect(placed: Placed, hit: Detected) -> Symptom:
    at = "" if placed.place == 1 else f" of {placed.effect.where} {placed.place}"
    observation = f"the residual follows {placed.effect.residual_signature}{at}, which {_explains(hit)}"
    if placed.place > 1 and hit.coefficients[0] > 0.0:  # more of it would leave more
        return Symptom(
            "Friction is elsewhere",
            observation,
            "the drive has less friction than the model where that mass moves: of another kind, or at another mass."
            " Search for the structure with the function set drive",
            suggested=(placed,),
        )
    instead = "search for the structure" + (" with the function set drive" if placed.place > 1 else "")
    advice = f"try {effect_in_words(placed)} as well, or {instead}"
    return Symptom(f"{placed.title} suspected", observation, advice, suggested=(placed,))


def _resonance(hit: Detected, frequency: float, structure: Structure) -> Symptom:
    observation = f"the residual follows the response of a resonance near {frequency:.2g} Hz to the input"
    advice, more = _one_more_mass(structure), _further_mass(structure)
    observation += f", which {_explains(hit)}"
    return Symptom("Resonance suspected", observation, advice, suggested=more, share=hit.share)


def _torque_pattern(pattern: TorquePattern, hit: Detected, recordings: tuple[Recording, ...]) -> Symptom:
    observation = f"the residual follows {pattern.follows}, which {_explains(hit)}"
    return Symptom(pattern.title, observation, pattern.advice, suggested=tuple(map(Placed, pattern.effects)))


def _drift(hit: Detected, recordings: tuple[Recording, ...]) -> Symptom:
    parts, coefficients = list(segments(recordings)), hit.coefficients.tolist()
    part, slope = max(zip(parts, coefficients, strict=True), key=lambda pair: abs(float(pair[1])))
    signal = part.recording.outputs[part.output]
    change = f"{-float(slope) * signal.factor:.2g} {signal.unit}"
    return Symptom(
        "Drift",
        f"{signal.name} of {part.recording.name} drifts by {change} from begin to end, relative to the model",
        "look for a drift of the sensor, or friction that changes while the drive warms up; a shorter --window helps",
    )


def _time_shift(hit: Detected, recordings: tuple[Recording, ...], options: DiagnosticOptions) -> Symptom:
    late, dt = float(hit.coefficients[0]), min(r.dt for r in recordings)
    if late < 0.0:
        return Symptom(
            "Output comes early",
            f"the outputs come {-late:.2g} s earlier than the input explains",
            "check the time stamps: input and output were not sampled together",
        )
    observation = f"the outputs come {late:.2g} s ({late / dt:.2g} samples) late, which {_explains(hit)}"
    if late >= dt:
        lags = tuple(Placed(e.name) for e in registry().values() if any(p.lag for p in e.parameters))
        tried = " or ".join(effect_in_words(p) for p in lags)
        return Symptom("Delay suspected", observation, f"try {tried}", suggested=lags)
    kinds = {signal.kind for r in recordings for signal in r.outputs}
    causes = [
        *(["--hold zoh (an input held between samples)"] if any(r.hold == "linear" for r in recordings) else []),
        *(["velocity-differenced (a velocity made from positions)"] if "velocity" in kinds else []),
    ]
    low, high = options.half_sample
    advice = "sampling explains it, so it is no evidence of a lag"
    if causes and low * dt < late < high * dt:
        advice = f"half a sample looks like {' or '.join(causes)}"
    return Symptom("Late by less than a sample", observation, advice, unmodelled=False)


_SYMPTOM_OF: Mapping[str, Callable[[Detected, tuple[Recording, ...]], Symptom]] = {
    **{pattern.name: partial(_torque_pattern, pattern) for pattern in TORQUE_PATTERNS},
    DRIFT: _drift,
}
