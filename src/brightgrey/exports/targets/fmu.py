"""Export to a functional mock-up unit: FMI 2.0, co-simulation, the C step function inside."""

from __future__ import annotations

import contextlib
import hashlib
import io
import platform
import sys
import tempfile
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from brightgrey.exports.expressions.languages import number_literal
from brightgrey.exports.external_tools import ExportError, MissingToolError, import_library, program, run_program
from brightgrey.exports.numeric_model import NumericModel
from brightgrey.exports.registry import Exporter, Verified
from brightgrey.exports.targets.c99 import NAME, engine, filled, sources
from brightgrey.exports.verification import VerificationRun
from brightgrey.recordings.units.parser import parse_unit

__all__ = ["EXPORTER"]

FILE = f"{NAME}.fmu"
_FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-Wall", "-Wextra", "-Werror")
_BASES = {"[mass]": "kg", "[length]": "m", "[time]": "s", "[current]": "A", "[angle]": "rad"}
_FOLDERS = {("linux", "x86_64"): "linux64", ("darwin", "x86_64"): "darwin64"}


def files_of(scheme: NumericModel) -> dict[str, bytes]:
    """One zip archive; the same model gives the same sources and description. Without gcc it has no binary inside."""
    text = sources(scheme)
    glue = filled(engine("fmi2.c"), _words(scheme))
    guid = hashlib.sha256("".join([glue, *text.values()]).encode()).hexdigest()[:32]
    glue = glue.replace("@guid@", guid)
    content = {f"sources/{name}": body.encode() for name, body in text.items()}
    content["sources/fmi2.c"] = glue.encode()
    content["modelDescription.xml"] = _description(scheme, guid)
    folder = _FOLDERS.get((sys.platform, platform.machine()))
    if folder:
        with contextlib.suppress(MissingToolError):  # then sources only; verify says so
            content[f"binaries/{folder}/{NAME}.so"] = _compiled(content)
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as zipped:
        for name, data in sorted(content.items()):
            zipped.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
    return {FILE: archive.getvalue()}


def _compiled(content: dict[str, bytes]) -> bytes:
    gcc = program("gcc")
    with tempfile.TemporaryDirectory(prefix="brightgrey-") as place:
        folder = Path(place)
        for name, data in content.items():
            if name.startswith("sources/"):
                (folder / Path(name).name).write_bytes(data)
        run_program([gcc, *_FLAGS, f"{NAME}.c", "fmi2.c", "-o", f"{NAME}.so", "-lm"], folder)
        return (folder / f"{NAME}.so").read_bytes()


def _words(scheme: NumericModel) -> dict[str, str]:
    values = [scheme.model.parameters[name].value for name in scheme.model.structure.parameters]
    rest = [str(int(state.at_rest == "input")) for state in scheme.system.states]
    return {
        "title": scheme.title,
        "version": scheme.model.version,
        "name": NAME,
        "NAME": NAME.upper(),
        "dt": number_literal(scheme.dt),
        "parameters": str(len(values)),
        "values": ", ".join(map(number_literal, values)),
        "rest": ", ".join(rest),
        "input_factor": number_literal(scheme.input_factor),
    }


def names_of(scheme: NumericModel) -> list[str]:
    """Names of input and outputs, each once."""
    names = [scheme.model.input.name]
    for output in scheme.outputs:
        name = output.name if output.name not in names else f"{output.name} {output.kind}"
        names.append(name if name not in names else f"{name} {len(names)}")
    return names


def _description(scheme: NumericModel, guid: str) -> bytes:
    """Text of modelDescription.xml."""
    root = ElementTree.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=scheme.title,
        guid=guid,
        description=scheme.title,
        generationTool=f"brightgrey {scheme.model.version}",
        variableNamingConvention="flat",
        numberOfEventIndicators="0",
    )
    simulation = ElementTree.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=NAME,
        canHandleVariableCommunicationStepSize="false",
        canInterpolateInputs="true",
        canGetAndSetFMUstate="true",
    )
    listed = ElementTree.SubElement(simulation, "SourceFiles")
    for name in (f"{NAME}.c", "fmi2.c"):
        ElementTree.SubElement(listed, "File", name=name)
    units = ElementTree.SubElement(root, "UnitDefinitions")
    ElementTree.SubElement(
        root,
        "DefaultExperiment",
        startTime="0",
        stopTime=number_literal(1000 * scheme.dt),
        stepSize=number_literal(scheme.dt),
    )
    variables = ElementTree.SubElement(root, "ModelVariables")
    used = _variables(scheme, variables)
    for unit in sorted(used):
        _define(units, unit)
    structure = ElementTree.SubElement(root, "ModelStructure")
    for kind in ("Outputs", "InitialUnknowns"):
        part = ElementTree.SubElement(structure, kind)
        for index in range(len(scheme.outputs)):
            ElementTree.SubElement(part, "Unknown", index=str(index + 2))
    ElementTree.indent(root)
    return bytes(ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)) + b"\n"


def _variables(scheme: NumericModel, into: ElementTree.Element) -> set[str]:
    """Write all variables in the order of their value references; returns the units in use."""
    model, used = scheme.model, set()

    def add(name: str, about: str, unit: str | None, start: float | None = None, **kind: str) -> None:
        at = str(len(into))
        said = {"name": name, "valueReference": at, "description": about, **kind}
        variable = ElementTree.SubElement(into, "ScalarVariable", said)
        real = ElementTree.SubElement(variable, "Real")
        if unit:
            real.set("unit", unit)
            used.add(unit)
        if start is not None:
            real.set("start", number_literal(start))

    names = names_of(scheme)
    add(names[0], "input", model.input.unit, 0.0, causality="input", variability="continuous")
    for name, output in zip(names[1:], scheme.outputs, strict=True):
        add(name, f"{output.kind} of mass 1", output.unit, causality="output", variability="continuous")
    constant = {"causality": "local", "variability": "constant", "initial": "exact"}
    for name, declared in model.structure.parameters.items():
        part = model.parameters[name]
        add(f"parameters.{name}", declared.about, part.unit, part.value, **constant)
    start = {"causality": "parameter", "variability": "fixed", "initial": "exact"}
    for state in scheme.system.states:
        unit = scheme.unit(state.dimension) if scheme.units else None
        add(f"start.{state.name}", f"state {state.name} at the begin", unit, 0.0, **start)
    return used


def _define(units: ElementTree.Element, text: str) -> None:
    """Unit by the SI's base units, where it has them."""
    definition = ElementTree.SubElement(units, "Unit", name=text)
    unit = parse_unit(text)
    powers = dict(unit.dimension)
    if set(powers) <= set(_BASES):
        exponents = {_BASES[base]: str(int(power)) for base, power in powers.items()}
        ElementTree.SubElement(definition, "BaseUnit", {**exponents, "factor": number_literal(unit.si)})


def verify(folder: Path, scheme: NumericModel, trial: VerificationRun) -> Verified:
    """Validate by fmpy, and step through the trial as a co-simulation master does."""
    fmpy = import_library("fmpy", "fmu")
    program("gcc")
    file = folder / FILE
    description = fmpy.read_model_description(str(file))
    problems = import_library("fmpy.validation", "fmu").validate_fmu(str(file))
    if problems:
        raise ExportError(f"fmpy refuses the unit: {problems[0]}")
    unzipped = fmpy.extract(str(file), str(folder / "unzipped"))
    unit = import_library("fmpy.fmi2", "fmu").FMU2Slave(
        guid=description.guid, unzipDirectory=unzipped, modelIdentifier=NAME, instanceName=NAME
    )
    reference = {v.name: v.valueReference for v in description.modelVariables}
    outputs = [reference[name] for name in names_of(scheme)[1:]]
    y = np.empty(trial.y.shape)
    unit.instantiate()
    try:
        unit.setupExperiment(startTime=0.0)
        unit.setReal([reference[f"start.{s}"] for s in scheme.system.state_names], list(map(float, trial.x0)))
        unit.enterInitializationMode()
        unit.setReal([0], [float(trial.u[0])])
        unit.exitInitializationMode()
        for k, u in enumerate(trial.u):
            unit.setReal([0], [float(u)])
            y[:, k] = unit.getReal(outputs)
            if k + 1 < trial.u.size:
                if scheme.hold == "linear":
                    unit.setRealInputDerivatives([0], [1], [float((trial.u[k + 1] - u) / scheme.dt)])
                unit.doStep(k * scheme.dt, scheme.dt)
        unit.terminate()
    finally:
        unit.freeInstance()
    return Verified(y, "FMU validated and stepped by fmpy")


EXPORTER = Exporter("FMI 2.0 co-simulation unit with sources and binary", 1e-6, files_of, verify)
