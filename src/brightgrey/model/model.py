"""The identified model as it is kept: model.json, schema ``brightgrey/model/2``."""

from __future__ import annotations

import html
import json
import math
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import ConfigDict, Field, ValidationError

from brightgrey.arguments import checked_arguments
from brightgrey.drawing.drive import Sensor, ValueText, drive_of, in_unit
from brightgrey.drawing.picture import DriveDrawing
from brightgrey.effects import SPEED, Element
from brightgrey.errors import BrightgreyError, SettingsError, nearest, unknown_name
from brightgrey.kit import Placed, Structure, function_set
from brightgrey.kit.in_words import structure_in_words
from brightgrey.kit.structure import Verdict
from brightgrey.model.files import check_file, write_file
from brightgrey.model.schema import (
    CertificatePart,
    CriterionPart,
    FitPart,
    InitialPart,
    OutcomePart,
    ParameterPart,
    Part,
    ReadOnly,
    SettingsPart,
    SignalPart,
    TiesPart,
)
from brightgrey.notebook_html import table
from brightgrey.numerics.number_format import with_uncertainty
from brightgrey.recordings import Signal
from brightgrey.recordings.units.parser import parse_unit
from brightgrey.recordings.units.signals import Units, kind_in_words, motion_unit
from brightgrey.simulation import Settings

__all__ = ["SCHEMA", "Model", "load_model"]

SCHEMA: Literal["brightgrey/model/2"] = "brightgrey/model/2"
_READ = ("brightgrey/model/1", SCHEMA)  # the first has no certificate


class Model(Part):
    """An identified model: structure, parameters with uncertainty, and all that simulating again needs.

    Numbers are in the recording's units, as in the file; :meth:`values_si` and :meth:`settings_si` convert them for the
    simulation. docs/reference/model-json.md describes every field.
    """

    model_config = ConfigDict(serialize_by_alias=True)

    schema_version: Literal["brightgrey/model/1", "brightgrey/model/2"] = Field(alias="schema")
    effects: tuple[str, ...] = Field(alias="structure")
    parameters: ReadOnly[str, ParameterPart]
    signals: tuple[SignalPart, ...]
    settings: SettingsPart
    initial_state: tuple[InitialPart, ...]
    fit: FitPart
    criterion: CriterionPart | None
    evidence: ReadOnly[str, Verdict] | None
    ties: TiesPart | None
    certificate: CertificatePart | None = None
    outcome: OutcomePart
    seed: int
    version: str

    @cached_property
    def structure(self) -> Structure:
        """Effects of the model with their places."""
        return Structure.of(self.effects)

    @cached_property
    def units(self) -> Units:
        """Units of the recording; ``units.of(dimension)`` gives the text and shown value over SI value."""
        return Units(self.input.unit, motion_unit(parse_unit(self.outputs[0].unit)))

    @property
    def is_rotary(self) -> bool:
        """True for a rotary drive, False for a linear axis, by the unit of its motion."""
        return "[angle]" in dict(parse_unit(self.units.motion).dimension)

    @property
    def input(self) -> Signal:
        """The input column, as the recording was read."""
        return _signal_of(self.signals[0])

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """The output columns, as the recording was read."""
        return tuple(_signal_of(part) for part in self.signals[1:])

    def placed(self, element: Element) -> Placed:
        """Placed effect that an element of the assembled model belongs to."""
        return next(p for p in self.structure.placed if f"{p.name}@{p.place}" == element.name)

    def values_si(self) -> dict[str, float]:
        """Parameter values in SI units by name."""
        return {
            name: self.parameters[name].value / self.units.of(declared.dimension)[1]
            for name, declared in self.structure.parameters.items()
        }

    def settings_si(self) -> Settings:
        """Give the simulation settings in SI units."""
        s = self.settings
        speed = self.units.of(SPEED)[1]
        return Settings(
            f_tanh=speed / s.friction_width if s.friction_width else math.inf,
            speed_scale=s.speed_scale / speed,
            level=s.level,
            hold=s.hold,
            substeps=s.substeps,
        )

    def drawing(self) -> DriveDrawing:
        """Drawing of the drive: masses, shafts, friction and all else, with values and 95 % intervals.

        Effects that the recording does not decide are dashed and have a question mark; only a search gives verdicts.

        Returns
        -------
        DriveDrawing
            A notebook shows it, ``drawing.save("drive.svg")`` writes it, ``drawing.svg()`` gives its text.
        """
        values = {}
        for name, part in self.parameters.items():
            half_width = (part.ci95[1] - part.ci95[0]) / 2.0 if part.ci95 else None
            values[name] = ValueText(*with_uncertainty(part.value, half_width, digits=4), part.unit)
        drive = drive_of(
            self.structure,
            rotary=self.is_rotary,
            values=values,
            sensors=[Sensor(s.mass, s.name, in_unit(kind_in_words(s.kind), s.unit)) for s in self.signals[1:]],
            input_text=in_unit(self.input.name, self.input.unit),
            actuator=self.input.mass,
            undecided=[name for name, verdict in (self.evidence or {}).items() if verdict == "not decidable"],
        )
        return DriveDrawing(drive)

    def _repr_html_(self) -> str:
        rows = []
        for name, part in self.parameters.items():
            deviation = "" if part.std is None else f"{part.std:.2g}"
            bound = "" if part.at_bound is None else f"at its {part.at_bound} bound"
            fixed = "fixed" if name in self.settings.fixed else bound
            about = self.structure.parameters[name].about
            rows.append((name, f"{part.value:.5g}", deviation, part.unit, fixed, about))
        fits = [
            (name, *("" if value is None else f"{value:.5g}" for value in (fit.fit_percent, fit.rmse)))
            for name, fit in self.fit.train.items()
        ]
        return (
            f"<div><p><b>{html.escape(structure_in_words(self.structure))}</b>: {html.escape(self.outcome.text)}</p>"
            f"{table(('Parameter', 'Value', 'Standard deviation', 'Unit', 'Note', 'Meaning'), rows)}"
            f"{table(('Output', 'Fit in %', 'RMSE'), fits)}</div>"
        )

    def text(self) -> str:
        """Text of model.json: the same model gives the same bytes, floats read back exactly."""
        return json.dumps(self.model_dump(mode="json"), indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    @checked_arguments
    def save(self, path: str | Path) -> None:
        """Write model.json to `path`, whole or not at all."""
        write_file(check_file(path), self.text().encode())

    @classmethod
    def check(cls, data: Any) -> Self:
        """Model from the content of a model.json.

        Raises
        ------
        SettingsError
            If a field is missing, unknown or wrong; the message names the first such field.
        """
        if not isinstance(data, dict):
            raise SettingsError(f"a JSON object is wanted, this is a {type(data).__name__}")
        schema = data.get("schema")
        if schema not in _READ:
            came = f"schema is '{schema}'" if schema else "there is no field 'schema'"
            raise SettingsError(f"{came}; this version reads '{SCHEMA}'")
        try:
            model = cls.model_validate(data)
        except ValidationError as error:
            raise SettingsError(_first_problem(error, cls)) from None
        _check_consistent(model)
        return model


@checked_arguments
def load_model(path: str | Path) -> Model:
    """Read a model.json and check it.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Model
        Its values stand in the units of the recording it was identified from.

    Raises
    ------
    SettingsError
        If the file cannot be read or is not JSON, or a field is missing, unknown or wrong.

    Examples
    --------
    >>> model = load_model("out/model.json")  # doctest: +SKIP
    >>> model.parameters["J1"].value, model.parameters["J1"].unit  # doctest: +SKIP
    (0.00126, 'kg m²')
    """
    file = Path(path)
    try:
        if file.exists() and not (file.is_file() or file.is_dir()):  # reading a device may never end
            raise OSError(0, "it is a device or a pipe")
        data = json.loads(file.read_text(encoding="utf-8"), parse_constant=_refuse_constant)
    except FileNotFoundError:
        raise SettingsError(f"no model file '{path}'; identify writes it as DIR/model.json") from None
    except OSError as error:
        hint = "; name the model.json in it" if isinstance(error, IsADirectoryError) else ""
        raise SettingsError(f"cannot read model file '{path}': {error.strerror}{hint}") from None
    except UnicodeDecodeError:
        raise SettingsError(f"model file '{path}' is not text; a model.json is wanted") from None
    except RecursionError:
        raise SettingsError(f"model file '{path}' is nested too deeply for a model.json") from None
    except json.JSONDecodeError as error:
        place = f"line {error.lineno} column {error.colno}"
        raise SettingsError(
            f"model file '{path}' is not JSON: {error.msg} at {place}; the model.json of an identification is wanted"
        ) from None
    except ValueError as error:  # parse_constant
        raise SettingsError(f"model file '{path}': {error}") from None
    try:
        return Model.check(data)
    except BrightgreyError as error:
        raise SettingsError(f"model file '{path}': {error}") from None


def _signal_of(part: SignalPart) -> Signal:
    return Signal(name=part.name, kind=part.kind, unit=part.unit, gain=part.gain, unit_given=True, mass=part.mass)


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number; write null for a number that is not known")


def _first_problem(error: ValidationError, cls: type[Part]) -> str:
    """First finding of pydantic as one line: field, problem, nearest right name."""
    found = error.errors(include_url=False)[0]
    place = ".".join(str(step) for step in found["loc"])
    if found["type"] == "extra_forbidden" and len(found["loc"]) == 1:
        guess = nearest(place, (field.alias or name for name, field in cls.model_fields.items()))
        hint = f"; did you mean '{guess}'?" if guess else ""
        return f"unknown field '{place}'{hint}"
    if found["type"] == "extra_forbidden":
        return f"unknown field '{place}'"
    if found["type"] == "missing":
        return f"field '{place}' is missing"
    came = found["input"]
    shown = f", this is {came!r}" if isinstance(came, str | int | float | bool) else ""
    return f"field '{place}': {found['msg'][0].lower()}{found['msg'][1:]}{shown}"


def _check_consistent(model: Model) -> None:
    """Refuse parts that contradict each other: structure, parameters, signals and units."""
    try:
        declared = function_set().check(model.structure).parameters
    except BrightgreyError as error:
        raise SettingsError(f"field 'structure': {error}") from None
    for name in model.parameters:
        if name not in declared:
            raise SettingsError(f"field 'parameters': {unknown_name('parameter', name, declared)}")
    for name in declared:
        if name not in model.parameters:
            raise SettingsError(f"field 'parameters.{name}' is missing; '{model.structure}' needs it")
    for name, parameter in declared.items():
        if parameter.scale == "log" and not model.parameters[name].value > 0.0:
            raise SettingsError(
                f"field 'parameters.{name}.value': it is {model.parameters[name].value:g}, and always positive"
            )
    kinds = [part.kind for part in model.signals]
    if len(kinds) < 2 or kinds[0] != "input" or "input" in kinds[1:]:
        raise SettingsError("field 'signals': the input comes first, then at least one output")
    wanted = {f"parameters.{name}.unit": parameter.dimension for name, parameter in declared.items()}
    came = {f"parameters.{name}.unit": part.unit for name, part in model.parameters.items()}
    wanted |= {"settings.friction_width_unit": SPEED, "settings.speed_scale_unit": SPEED}
    came |= {
        "settings.friction_width_unit": model.settings.friction_width_unit,
        "settings.speed_scale_unit": model.settings.speed_scale_unit,
    }
    for field, dimension in wanted.items():
        unit, _ = model.units.of(dimension)
        if came[field] != unit:
            raise SettingsError(f"field '{field}' is '{came[field]}'; the signals' units make it '{unit}'")
    try:
        model.settings_si()
    except BrightgreyError as error:
        raise SettingsError(f"field 'settings': {error}") from None
    try:
        model.text().encode()
    except UnicodeEncodeError as error:
        raise SettingsError(f"a text holds {error.object[error.start]!r}, which is no character") from None
