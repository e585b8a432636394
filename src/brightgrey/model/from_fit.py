"""Conversion of a fit, which is in SI, to a model, which is in the recording's units."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

from brightgrey.effects import SPEED
from brightgrey.estimation import Estimate, Fit, Profile
from brightgrey.estimation.uncertainty.friction_width import FrictionWidth
from brightgrey.kit import assemble
from brightgrey.model.model import SCHEMA, Model
from brightgrey.model.schema import (
    CertificatePart,
    CriterionPart,
    FindingPart,
    FitPart,
    InitialPart,
    OutcomePart,
    OutputFitPart,
    ParameterPart,
    ProfilePart,
    RecordingValuePart,
    RefutedPart,
    SettingsPart,
    SignalPart,
    TiesPart,
    ValuePart,
)
from brightgrey.recordings import Recording, Units

if TYPE_CHECKING:
    from brightgrey.search.certificate import Certificate
    from brightgrey.search.evidence import Evidence

__all__ = ["model_of"]


def model_of(
    fit: Fit,
    recordings: Sequence[Recording],
    *,
    train: Mapping[str, OutputFitPart],
    test: Mapping[str, OutputFitPart] | None,
    criterion: CriterionPart | None,
    fixed: Mapping[str, float],
    seed: int,
    version: str,
    profiles: Sequence[Profile] = (),
    evidence: Evidence | None = None,
) -> Model:
    """Model of a fit.

    Parameters
    ----------
    fit : Fit
        In SI units.
    recordings : sequence of Recording
        Recordings that were fitted; the first one's units are the model's.
    train, test : mapping of str to OutputFitPart
        Fit by output name, in the outputs' units.
    criterion : CriterionPart or None
    fixed : mapping of str to float
        Parameters that were not estimated, in SI.
    seed : int
    version : str
        Of brightgrey.
    profiles : sequence of Profile
        Of some parameters, in SI.
    evidence : Evidence, optional
        Of a search.

    Returns
    -------
    Model
    """
    units = recordings[0].units
    declared = fit.structure.parameters
    asked = {p.name: p for p in profiles}
    factors = {name: units.of(parameter.dimension)[1] for name, parameter in declared.items()}
    return Model(
        schema=SCHEMA,
        structure=fit.structure.names,
        parameters={
            name: _parameter_part(fit.estimates[name], asked.get(name), *units.of(parameter.dimension)).model_copy(
                update={"in_recordings": _in_recordings(fit, name, recordings, factors[name])}
            )
            for name, parameter in declared.items()
        },
        signals=_signal_parts(recordings[0]),
        settings=_settings_part(fit, recordings[0], factors, fixed),
        initial_state=_initial_states(fit, recordings, units),
        fit=FitPart(train=train, test=test),
        criterion=criterion,
        evidence=None if evidence is None else {card.effect: card.verdict for card in evidence.cards},
        ties=None if evidence is None else _ties(evidence),
        certificate=None if evidence is None else _certificate_part(evidence.certificate),
        outcome=OutcomePart(
            kind=fit.outcome.kind,
            text=fit.outcome.text,
            findings=tuple(
                FindingPart(kind=f.kind, text=f.text, parameters=f.parameters) for f in fit.outcome.findings
            ),
        ),
        seed=seed,
        version=version,
    )


def _ties(evidence: Evidence) -> TiesPart:
    return TiesPart(
        minimal=tuple(str(j.structure) for j in evidence.minimal),
        optional=evidence.optional,
        left_out={
            str(s): tuple(fit if math.isfinite(fit) else None for fit in fits)
            for s, fits in evidence.left_out.items()
            if fits
        },
    )


def _certificate_part(certificate: Certificate) -> CertificatePart:
    refuted = tuple(RefutedPart(**asdict(r)) for r in certificate.refuted)
    return CertificatePart(**{**vars(certificate), "refuted": refuted})


def _profile(found: Profile, factor: float) -> ProfilePart:
    low, high = (
        None if side in found.open else factor * end for side, end in zip(("low", "high"), found.ci95, strict=True)
    )
    return ProfilePart(ci95=(low, high), quadratic=found.quadratic, text=found.text)


def _parameter_part(estimate: Estimate, profile: Profile | None, unit: str, factor: float) -> ParameterPart:
    """One estimate in shown units; numbers that are not finite become None."""
    low, high = (factor * limit for limit in estimate.ci95)
    std = factor * estimate.std
    return ParameterPart(
        value=factor * estimate.value,
        unit=unit,
        std=std if math.isfinite(std) else None,
        ci95=(low, high) if math.isfinite(low) and math.isfinite(high) else None,
        at_bound=estimate.at_bound,
        between_recordings=None if estimate.between is None else abs(factor) * estimate.between,
        profile=None if profile is None else _profile(profile, factor),
    )


def _in_recordings(
    fit: Fit, name: str, recordings: Sequence[Recording], factor: float
) -> tuple[RecordingValuePart, ...] | None:
    """Estimates of a parameter in each recording, in shown units; None if it may not differ."""
    if name not in fit.in_recordings:
        return None
    parts = []
    for recording, estimate in zip(recordings, fit.in_recordings[name], strict=True):
        low, high = (factor * end for end in estimate.ci95)
        known = math.isfinite(estimate.std)
        parts.append(
            RecordingValuePart(
                recording=recording.name,
                value=factor * estimate.value,
                std=factor * estimate.std if known else None,
                ci95=(low, high) if known and math.isfinite(high) else None,
            )
        )
    return tuple(parts)


def _signal_parts(recording: Recording) -> tuple[SignalPart, ...]:
    return tuple(
        SignalPart(
            name=signal.name,
            kind=signal.kind,
            unit=signal.unit,
            gain=signal.gain,
            sampling_time=recording.dt,
            hold=recording.hold,
            mass=signal.mass,
        )
        for signal in (recording.input, *recording.outputs)
    )


def _settings_part(
    fit: Fit, recording: Recording, factors: Mapping[str, float], fixed: Mapping[str, float]
) -> SettingsPart:
    speed_unit, speed = recording.units.of(SPEED)
    s, width = fit.settings, fit.friction_width
    return SettingsPart(
        friction_width=speed / s.f_tanh,
        friction_width_unit=speed_unit,
        friction_width_ci95=None if width is None else _friction_width_interval(width, speed),
        speed_scale=s.speed_scale * speed,
        speed_scale_unit=speed_unit,
        level=s.level,
        substeps=s.substeps,
        hold=s.hold,
        sampling_time=recording.dt,
        bounds={
            name: (factors[name] * low, factors[name] * high)
            for name, (low, high) in fit.bounds.items()
            if name in factors and name not in fixed  # initial states that were estimated are no parameters
        },
        fixed={name: factors[name] * value for name, value in fixed.items()},
    )


def _friction_width_interval(width: FrictionWidth, factor: float) -> tuple[float, float | None]:
    """Interval in shown units, without a high end where there is no upper limit."""
    low, high = (factor * end for end in width.ci95)
    return low, high if math.isfinite(high) else None


def _initial_states(fit: Fit, recordings: Sequence[Recording], units: Units) -> tuple[InitialPart, ...]:
    values = {name: estimate.value for name, estimate in fit.estimates.items()}
    states = {s.name: s for s in assemble(fit.structure, values, fit.settings.f_tanh).states}
    out = []
    for recording, initial in zip(recordings, fit.initial_states, strict=True):
        shown = {}
        for name, value in initial.items():
            unit, factor = units.of(states[name].dimension)
            shown[name] = ValuePart(value=factor * value, unit=unit)
        out.append(InitialPart(recording=recording.name, state=shown))
    return tuple(out)
