"""A model as rows of text, for terminal, report and notebook."""

from __future__ import annotations

from dataclasses import dataclass

from brightgrey.model.model import Model
from brightgrey.model.schema import OutputFitPart, ParameterPart, SettingsPart
from brightgrey.numerics.number_format import is_drowned, significant, with_uncertainty
from brightgrey.report.text.prose import listing, sentence, with_forces, with_meanings

__all__ = [
    "FitRow",
    "ParameterRow",
    "differing_values",
    "fit_row",
    "fit_rows",
    "friction_width_text",
    "interval_text",
    "parameter_rows",
    "remarks",
]

FIXED = "fixed"
UNKNOWN = "uncertainty unknown"
NOT_IDENTIFIABLE = "not identifiable"
AT = {"low": "at its lower bound", "high": "at its upper bound"}


@dataclass(frozen=True)
class ParameterRow:
    """One parameter as text; `half_width` is half of the 95 % interval, empty where there is none."""

    name: str
    value: str
    half_width: str
    unit: str
    interval: str
    bounds: str
    note: str
    about: str

    @property
    def estimate(self) -> str:
        """Value and uncertainty in one."""
        return f"{self.value} ± {self.half_width}" if self.half_width else self.value


@dataclass(frozen=True)
class FitRow:
    """Fit of one output as text; `on` is ``train`` for the recordings of the fit, ``test`` for the test recording."""

    output: str
    on: str
    fit_percent: str
    rmse: str
    rss: str
    unit: str

    @property
    def recording(self) -> str:
        """Use of the recording in words."""
        return "identified" if self.on == "train" else self.on


def parameter_rows(model: Model) -> list[ParameterRow]:
    """Rows in the order of the structure."""
    rows = []
    for name, declared in model.structure.parameters.items():
        part = model.parameters[name]
        half_width = (part.ci95[1] - part.ci95[0]) / 2.0 if part.ci95 else None
        value, shown_half = with_uncertainty(part.value, half_width)
        fixed = name in model.settings.fixed
        bounds = model.settings.bounds.get(name)
        rows.append(
            ParameterRow(
                name=name,
                value=value,
                half_width=shown_half,
                unit="" if part.unit == "1" else part.unit,
                interval=interval_text(part.ci95),
                bounds="" if fixed else _range_text(bounds),
                note=FIXED
                if fixed
                else _reservation(part, half_width if shown_half else None, declared.scale == "log"),
                about=declared.about.replace("torque (or force)", "torque" if model.is_rotary else "force"),
            )
        )
    return rows


def _reservation(part: ParameterPart, half_width: float | None, positive: bool) -> str:
    """Reason to mistrust an estimate. A value that may be zero is known to be small, however wide its interval."""
    if part.at_bound:
        return AT[part.at_bound]
    if half_width is None:
        return UNKNOWN
    return NOT_IDENTIFIABLE if positive and is_drowned(part.value, half_width) else ""


def differing_values(model: Model) -> list[str]:
    """Values in each recording of the parameters that may differ, one text each."""
    texts = []
    for name, part in model.parameters.items():
        shown = []
        for own in part.in_recordings or ():
            half_width = (own.ci95[1] - own.ci95[0]) / 2.0 if own.ci95 else None
            value, half = with_uncertainty(own.value, half_width)
            shown.append(f"{value} ± {half} in {own.recording}" if half else f"{value} in {own.recording}")
        if shown:
            listed = f"{name} by recording, in {part.unit}: {', '.join(shown)}."
            texts.append(
                f"{sentence(with_meanings(listed, model.structure))}"
                " The value above is their mean, of logarithms where it is always positive."
            )
    return texts


def friction_width_text(settings: SettingsPart) -> str:
    """Speed within which dry friction reverses, with what is known of it."""
    unit, interval = settings.friction_width_unit, settings.friction_width_ci95
    if interval is None and settings.friction_width == 0.0:
        return "at once (given)"
    if interval is None:
        return f"within {significant(settings.friction_width, 3)} {unit} (given)"
    low, high = interval
    if high is None and low == 0.0:
        return "within a speed that this recording does not tell"
    if high is None:
        return f"within {significant(low, 2)} {unit} or more: this recording gives no upper limit"
    if low == 0.0:
        return f"as sharply as this recording can show: within less than {significant(high, 2)} {unit}"
    shown = with_uncertainty(settings.friction_width, 0.5 * (high - low))[0]
    return f"within {shown} {unit} ({interval_text((low, high))})"


def fit_rows(model: Model) -> list[FitRow]:
    """One row per output, then the same for the test recording."""
    units = {signal.name: signal.unit for signal in model.signals}
    rows = [fit_row(output, "train", fit, units[output]) for output, fit in model.fit.train.items()]
    rows += [fit_row(output, "test", fit, units[output]) for output, fit in (model.fit.test or {}).items()]
    return rows


def fit_row(output: str, on: str, fit: OutputFitPart, unit: str) -> FitRow:
    """Fit of one output as text; `on` says on which recording."""
    if fit.rss is None or fit.rmse is None or fit.fit_percent is None:
        return FitRow(output, on, "diverged", "diverged", "diverged", unit)
    percent = f"{fit.fit_percent:.2f}" if fit.fit_percent < 99.9 else f"{fit.fit_percent:.4f}"
    return FitRow(output, on, percent, significant(fit.rmse), significant(fit.rss), unit)


def interval_text(ci95: tuple[float, float] | None) -> str:
    """Both ends, rounded by the width of the interval."""
    if ci95 is None or ci95[0] == ci95[1]:  # nothing can be said, or fixed
        return ""
    half_width = (ci95[1] - ci95[0]) / 2.0
    return " … ".join(_interval_end(end, half_width) for end in ci95)


def _interval_end(end: float, half_width: float) -> str:
    """An end of an interval; a positive end does not become zero by rounding."""
    text = with_uncertainty(end, half_width)[0]
    return (significant(end, 2) if end else "0") if float(text) == 0.0 else text


def _range_text(pair: tuple[float, float] | None) -> str:
    return f"{significant(pair[0], 2)} … {significant(pair[1], 2)}" if pair else ""


def remarks(model: Model) -> list[str]:
    """Reservations that a reader has to know before using the numbers, in whole sentences."""
    rows = parameter_rows(model)
    units = {row.name: row.unit for row in rows}

    def named(prefix: str, note: str, reason: str = "") -> list[str]:
        names = [with_meanings(row.name, model.structure) for row in rows if row.note == note]
        return [f"{listing(prefix, names, 'and')}{reason}"] if names else []

    no_optimum = " The recording gives no optimum inside the range, so the interval is not to be trusted."
    out = [text for note in AT.values() for text in named(f"{note.capitalize()}:", note, no_optimum)]
    out += named("No uncertainty can be given for", UNKNOWN)
    out += named("Not identifiable:", NOT_IDENTIFIABLE, " Half of the 95 % interval exceeds ten times the estimate.")
    between = {name: part.between_recordings for name, part in model.parameters.items() if part.between_recordings}
    if between:
        listed = ", ".join(f"{name} {significant(value, 2)} {units[name]}".strip() for name, value in between.items())
        out.append(with_meanings(f"Standard deviation between the recordings: {listed}.", model.structure))
    for part in model.parameters.values():
        if part.profile:
            ends = " … ".join("open" if end is None else significant(end, 4) for end in part.profile.ci95)
            out.append(f"{sentence(part.profile.text)} Its 95 % interval is {ends} {part.unit}.")
    for finding in model.outcome.findings:
        if finding.kind != "at bound":
            out.append(sentence(with_meanings(finding.text, model.structure)))
        elif beside := [name for name in finding.parameters if name not in units]:  # parameters are named above
            begin = " The recording may begin otherwise: try --initial rest or a later --window."
            advice = begin if all("(0)" in name for name in beside) else ""
            out.append(f"Estimated beside the parameters, and at a bound of its range: {', '.join(beside)}.{advice}")
    return out if model.is_rotary else [with_forces(text) for text in out]
