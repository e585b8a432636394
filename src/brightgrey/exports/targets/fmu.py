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
from brightgrey.exports.registry import Exporter
from brightgrey.exports.source_text import NAME, fill_words, header_words, signal_names, template
from brightgrey.exports.targets.c99 import sources
from brightgrey.exports.verification import VerificationRun, Verified
from brightgrey.recordings.units.parser import parse_unit

__all__ = ["EXPORTER"]

_ARCHIVE = f"{NAME}.fmu"
_COMPILER_FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-Wall", "-Wextra", "-Werror")
_SI_BASE_UNITS = {"[mass]": "kg", "[length]": "m", "[time]": "s", "[current]": "A", "[angle]": "rad"}
_PLATFORM_FOLDERS = {("linux", "x86_64"): "linux64", ("darwin", "x86_64"): "darwin64"}


def files_of(numeric: NumericModel) -> dict[str, bytes]:
    """One zip archive; the same model gives the same sources and description. Without gcc it has no binary inside."""
    text = sources(numeric)
    glue = fill_words(template("fmi2.c"), _glue_words(numeric))
    guid = hashlib.sha256("".join([glue, *text.values()]).encode()).hexdigest()[:32]
    glue = glue.replace("@guid@", guid)
    content = {f"sources/{name}": body.encode() for name, body in text.items()}
    content["sources/fmi2.c"] = glue.encode()
    content["modelDescription.xml"] = _description(numeric, guid)
    folder = _PLATFORM_FOLDERS.get((sys.platform, platform.machine()))
    if folder:
        with contextlib.suppress(MissingToolError):  # then sources only; verify says so
            content[f"binaries/{folder}/{NAME}.so"] = _shared_library(content)
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as zipped:
        for name, data in sorted(content.items()):
            zipped.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
    return {_ARCHIVE: archive.getvalue()}


def _shared_library(content: dict[str, bytes]) -> bytes:
    gcc = program("gcc")
    with tempfile.TemporaryDirectory(prefix="brightgrey-") as place:
        folder = Path(place)
        for name, data in content.items():
            if name.startswith("sources/"):
                (folder / Path(name).name).write_bytes(data)
        run_program([gcc, *_COMPILER_FLAGS, f"{NAME}.c", "fmi2.c", "-o", f"{NAME}.so", "-lm"], folder)
        return (folder / f"{NAME}.so").read_bytes()


def _glue_words(numeric: NumericModel) -> dict[str, str]:
    values = [numeric.model.parameters[name].value for name in numeric.model.structure.parameters]
    rest = [str(int(state.at_rest == "input")) for state in numeric.system.states]
    return header_words(numeric) | {
        "parameters": str(len(values)),
        "values": ", ".join(map(number_literal, values)),
        "rest": ", ".join(rest),
        "input_factor": number_literal(numeric.input_factor),
    }


def _description(numeric: NumericModel, guid: str) -> bytes:
    """Text of modelDescription.xml."""
    root = ElementTree.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=numeric.title,
        guid=guid,
        description=numeric.title,
        generationTool=f"brightgrey {numeric.model.version}",
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
        stopTime=number_literal(1000 * numeric.dt),
        stepSize=number_literal(numeric.dt),
    )
    variables = ElementTree.SubElement(root, "ModelVariables")
    used = _add_variables(numeric, variables)
    for unit in sorted(used):
        _define(units, unit)
    structure = ElementTree.SubElement(root, "ModelStructure")
    for kind in ("Outputs", "InitialUnknowns"):
        part = ElementTree.SubElement(structure, kind)
        for index in range(len(numeric.outputs)):
            ElementTree.SubElement(part, "Unknown", index=str(index + 2))
    ElementTree.indent(root)
    return bytes(ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)) + b"\n"


def _add_variables(numeric: NumericModel, into: ElementTree.Element) -> set[str]:
    """Write all variables in the order of their value references; returns the units in use."""
    model, used = numeric.model, set()

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

    names = signal_names(numeric)
    add(names[0], "input", model.input.unit, 0.0, causality="input", variability="continuous")
    for name, output in zip(names[1:], numeric.outputs, strict=True):
        add(name, f"{output.kind} of mass {output.mass}", output.unit, causality="output", variability="continuous")
    constant = {"causality": "local", "variability": "constant", "initial": "exact"}
    for name, declared in model.structure.parameters.items():
        part = model.parameters[name]
        add(f"parameters.{name}", declared.about, part.unit, part.value, **constant)
    start = {"causality": "parameter", "variability": "fixed", "initial": "exact"}
    for state in numeric.system.states:
        unit = numeric.unit(state.dimension) if numeric.units else None
        add(f"start.{state.name}", f"state {state.name} at the begin", unit, 0.0, **start)
    return used


def _define(units: ElementTree.Element, text: str) -> None:
    """Unit by the SI's base units, where it has them."""
    definition = ElementTree.SubElement(units, "Unit", name=text)
    unit = parse_unit(text)
    powers = dict(unit.dimension)
    if set(powers) <= set(_SI_BASE_UNITS):
        exponents = {_SI_BASE_UNITS[base]: str(int(power)) for base, power in powers.items()}
        ElementTree.SubElement(definition, "BaseUnit", {**exponents, "factor": number_literal(unit.si)})


def verify(folder: Path, numeric: NumericModel, run: VerificationRun) -> Verified:
    """Validate by fmpy, and step through the verification as a co-simulation master does."""
    fmpy = import_library("fmpy", "fmu")
    program("gcc")
    file = folder / _ARCHIVE
    description = fmpy.read_model_description(str(file))
    problems = import_library("fmpy.validation", "fmu").validate_fmu(str(file))
    if problems:
        raise ExportError(f"fmpy refuses the unit: {problems[0]}")
    unzipped = fmpy.extract(str(file), str(folder / "unzipped"))
    unit = import_library("fmpy.fmi2", "fmu").FMU2Slave(
        guid=description.guid, unzipDirectory=unzipped, modelIdentifier=NAME, instanceName=NAME
    )
    reference = {v.name: v.valueReference for v in description.modelVariables}
    outputs = [reference[name] for name in signal_names(numeric)[1:]]
    y = np.empty(run.y.shape)
    unit.instantiate()
    try:
        unit.setupExperiment(startTime=0.0)
        unit.setReal([reference[f"start.{s}"] for s in numeric.system.state_names], list(map(float, run.x0)))
        unit.enterInitializationMode()
        unit.setReal([0], [float(run.u[0])])
        unit.exitInitializationMode()
        for k, u in enumerate(run.u):
            unit.setReal([0], [float(u)])
            y[:, k] = unit.getReal(outputs)
            if k + 1 < run.u.size:
                if numeric.hold == "linear":
                    unit.setRealInputDerivatives([0], [1], [float((run.u[k + 1] - u) / numeric.dt)])
                unit.doStep(k * numeric.dt, numeric.dt)
        unit.terminate()
    finally:
        unit.freeInstance()
    return Verified(y, "FMU validated and stepped by fmpy")


EXPORTER = Exporter("FMI 2.0 co-simulation unit with sources and binary", 1e-6, files_of, verify)
