"""Parts of model.json, one class per object in it (docs/reference/model-json.md is the page for readers)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, NoReturn, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

__all__ = [
    "CertificatePart",
    "CriterionPart",
    "FindingPart",
    "FitPart",
    "InitialPart",
    "OutcomePart",
    "OutputFitPart",
    "ParameterPart",
    "Part",
    "ProfilePart",
    "ReadOnly",
    "RecordingValuePart",
    "RefutedPart",
    "SettingsPart",
    "SignalPart",
    "TiesPart",
    "ValuePart",
]


def _ordered(ends: tuple[float, float | None]) -> tuple[float, float | None]:
    if ends[1] is not None and ends[0] > ends[1]:
        raise ValueError("the low end is above the high one")
    return ends


def _not_zero(value: float) -> float:
    if value == 0.0:
        raise ValueError("it must not be 0")
    return value


Ordered = Annotated[tuple[float, float], AfterValidator(_ordered)]
"""Low and high end."""
K = TypeVar("K")
V = TypeVar("V")


class ReadOnlyDict(dict[K, V]):
    """A dict that refuses changes (TypeError), so that a model with dicts is frozen and can be hashed."""

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("a model cannot be changed; model_copy(update=...) makes another one")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(frozenset(self.items()))


ReadOnly = Annotated[Mapping[K, V], AfterValidator(ReadOnlyDict)]
"""Mapping of a part."""


class Part(BaseModel):
    """Base of all parts: frozen, strict about names, and free of NaN; a number that is not known is null."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ValuePart(Part):
    """A number with its unit."""

    value: float
    unit: str


class ProfilePart(Part):
    """Interval by profile likelihood; an end is null where the recording gives none within the bounds."""

    ci95: tuple[float | None, float | None]
    quadratic: bool
    text: str


class RecordingValuePart(Part):
    """Estimate in one recording, in the parameter's unit; std and ci95 are null where they are not known."""

    recording: str
    value: float
    std: float | None = Field(ge=0.0)
    ci95: Ordered | None


class ParameterPart(Part):
    """One parameter; std and ci95 are null where they are not known, at_bound is null inside the bounds.

    between_recordings is the standard deviation of the estimates from each recording alone; null with one recording.
    in_recordings has the estimates of a parameter that may differ, whose value is their mean; null for all others.
    profile is null unless a profile likelihood was requested.
    """

    value: float
    unit: str
    std: float | None = Field(ge=0.0)
    ci95: Ordered | None
    at_bound: Literal["low", "high"] | None
    between_recordings: float | None = Field(default=None, ge=0.0)
    in_recordings: tuple[RecordingValuePart, ...] | None = None
    profile: ProfilePart | None = None


class SignalPart(Part):
    """A column of the recording. Recorded value times `gain` stands in `unit`; sampling_time in s.

    `mass` is the one that an output is measured at, or that the input acts on, counted along the drive train.
    """

    name: str
    kind: str
    unit: str
    gain: Annotated[float, AfterValidator(_not_zero)]
    sampling_time: float = Field(gt=0.0)
    hold: Literal["linear", "zoh"]
    mass: int = Field(default=1, ge=1)


class SettingsPart(Part):
    """Settings that simulating and estimating again need beside structure, parameters and input.

    friction_width and speed_scale carry their units beside them; bounds and fixed stand in the parameters' units.
    friction_width is the speed within which dry friction reverses, 0 for an exact sign. friction_width_ci95 is its 95 %
    interval. Its low end is 0 if the recording shows no width, and its high end null if it shows no upper limit. The
    whole is null if the width was given or nothing reverses.
    """

    friction_width: float = Field(ge=0.0)
    friction_width_unit: str
    friction_width_ci95: Annotated[tuple[float, float | None], AfterValidator(_ordered)] | None = None
    speed_scale: float = Field(gt=0.0)
    speed_scale_unit: str
    level: Literal["accurate", "fast", "euler"]
    substeps: int = Field(ge=1)
    hold: Literal["linear", "zoh"]
    sampling_time: float = Field(gt=0.0)
    bounds: ReadOnly[str, Ordered]
    fixed: ReadOnly[str, float]

    @model_validator(mode="before")
    @classmethod
    def _read_gain(cls, data: Any) -> Any:
        """Earlier files hold f_tanh, the inverse of the width."""
        gain = data.get("f_tanh") if isinstance(data, dict) else None
        if not isinstance(gain, float | int) or not gain > 0.0:
            return data
        rest = {name: value for name, value in data.items() if name not in ("f_tanh", "f_tanh_unit")}
        return {"friction_width": 1.0 / gain, "friction_width_unit": data.get("speed_scale_unit"), **rest}


class InitialPart(Part):
    """Initial state for one recording."""

    recording: str
    state: ReadOnly[str, ValuePart]


class OutputFitPart(Part):
    """Fit of one output, rss and rmse in its unit; null where the simulation diverged.

    fit_percent = 100 (1 - |y - ysim| / |y - mean y|).
    """

    rss: float | None
    rmse: float | None
    fit_percent: float | None


class FitPart(Part):
    """Fit by output name on the recordings the model was identified from, and on the test recording."""

    train: ReadOnly[str, OutputFitPart]
    test: ReadOnly[str, OutputFitPart] | None


class CriterionPart(Part):
    """Criterion that structures are ranked by; smaller is better for BIC."""

    name: str
    value: float


class TiesPart(Part):
    """Structures and effects that the recording cannot tell apart (after a search)."""

    minimal: tuple[str, ...]
    optional: tuple[str, ...]
    left_out: ReadOnly[str, tuple[float | None, ...]] = ReadOnlyDict()


class RefutedPart(Part):
    """A largest structure that the recordings refute, with every structure within it."""

    without: tuple[str, ...]
    structure: str
    ratio: float
    excess: float
    threshold: float
    tried: str
    agreeing: int


class CertificatePart(Part):
    """Fits that decide all structures of the grammar, conditional on the optima that were found (after a search)."""

    grammar: str
    structures: int
    fitted: int
    minimal: tuple[str, ...]
    refuted: tuple[RefutedPart, ...]
    undecided: tuple[str, ...]
    unexplained: tuple[str, ...]
    offered: tuple[str, ...] = ()
    poor_fit: float | None = None
    held_back: ReadOnly[str, str] = ReadOnlyDict()


class FindingPart(Part):
    """One finding of the estimation, and the parameters it concerns."""

    kind: str
    text: str
    parameters: tuple[str, ...] = ()


class OutcomePart(Part):
    """Outcome of the estimation: the gravest finding, and all others, the gravest first."""

    kind: str
    text: str
    findings: tuple[FindingPart, ...] = ()
