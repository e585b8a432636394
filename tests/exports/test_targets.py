"""Exports: each is run by its own tool chain and compared with the native simulation."""

import importlib
import io
import json
import shutil
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from brightgrey.cli import main
from brightgrey.errors import SettingsError
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.exports import external_tools as tools
from brightgrey.exports.numeric_model import numeric_model
from brightgrey.exports.registry import EXPORTS, export, exporter
from brightgrey.exports.targets import modelica
from brightgrey.exports.verification import compare_with_native, deviation, native, verification_of, verification_run
from brightgrey.kit import Structure
from brightgrey.model.files import write_files
from brightgrey.recordings import Recording
from brightgrey.simulation.plain import plain_response
from support.models import (
    first_period,
    model_with_intervals,
    model_with_values,
    random_model,
    random_models,
    random_structures,
)

PROGRAMS = {"c": ("gcc",), "fmu": ("gcc",), "matlab": ("octave-cli",), "latex": ("pdflatex",)}
PACKAGES = {"fmu": "fmpy", "control": "control", "modelica": "rumoca"}
OWN_SOLVER = ("control", "modelica")
ALL = ("position", "velocity", "acceleration")


def needs(to):
    """Skip where the tool chain of a target is absent."""
    for name in PROGRAMS.get(to, ()):
        if shutil.which(name) is None:
            pytest.skip(f"{name} is not installed")
    if to in PACKAGES:
        pytest.importorskip(PACKAGES[to], reason=f"{PACKAGES[to]} is not installed")


def deviation_of(to, model, folder):
    """Deviation of an export on the test input, relative to the range."""
    numeric = numeric_model(model)
    run = first_period(verification_of(numeric))
    target = exporter(to)
    write_files(folder, target.files(numeric))
    verified = target.verify(folder, numeric, run)
    if to in OWN_SOLVER:  # these may come closer to the truth than we do
        return min(deviation(run.y, verified.y), deviation(run.y_fine, verified.y))
    return deviation(run.y, verified.y)


@pytest.mark.system
@pytest.mark.parametrize("to", EXPORTS)
@pytest.mark.parametrize(
    ("structure", "options"),
    [
        ("two_mass+coulomb+viscous+stribeck+backlash+delay", {"kinds": ALL, "hold": "linear"}),
        (
            "two_mass+coulomb+gravity+current_control+delay",
            {"kinds": ("velocity-differenced", "acceleration"), "hold": "zoh", "linear_axis": True},
        ),
        ("two_mass+viscous+directional_viscous+coulomb@2+viscous@2+ground_spring@2+pendulum", {"kinds": ALL}),
        (
            "three_mass+backlash@2+stribeck@3+gravity@2+pendulum@2+directional_viscous@3+viscous@3",
            {"linear_axis": True},
        ),
        ("three_mass+coulomb+backlash@2+cubic_spring", {"kinds": ALL}),
        ("three_mass+coulomb+viscous@2+backlash+current_control", {"kinds": ALL, "actuator": 2}),
    ],
)
def test_export__run_by_its_tool__moves_like_the_model(to, structure, options, tmp_path):
    needs(to)
    assert deviation_of(to, random_model(structure, 11, **options), tmp_path) <= exporter(to).tolerance


@pytest.mark.system
@pytest.mark.parametrize("to", ["c", "fmu", "matlab"])
def test_export__damper_relaxes_in_nanoseconds__moves_like_the_model(to, tmp_path):
    """d/c = 1 ns: a power series of the gap's own motion would reach a thousandth of a step."""
    needs(to)
    values = {"J1": 0.0165, "J2": 0.00704, "J3": 0.000972, "c1": 123e3, "c2": 0.156, "d1": 1.23e-4, "d2": 0.0398}
    drive = model_with_values("three_mass+coulomb+backlash", values | {"M_C": 0.288, "alpha": 0.7})
    assert deviation_of(to, drive, tmp_path) <= exporter(to).tolerance


@pytest.mark.system
@pytest.mark.parametrize("to", ["c", "matlab"])
def test_export__drive_rests_at_the_end_of_its_gap__moves_like_the_model(to, tmp_path):
    """Rounding of c/d times the twist, at 18 rad, must not open and close the contact for ever."""
    needs(to)
    structure = "two_mass+stribeck+backlash"
    values = random_values(Structure.parse(structure).parameters, np.random.default_rng([3, 58, 0]))
    numeric = numeric_model(model_with_values(structure, values))
    u = PAPER_EXPERIMENT.torque()[:760]
    run = verification_run(numeric, u, numeric.system.rest(u=u[0]), "a drive that rests")
    write_files(tmp_path, exporter(to).files(numeric))
    assert deviation(run.y, exporter(to).verify(tmp_path, numeric, run).y) <= exporter(to).tolerance


@pytest.mark.system
@pytest.mark.parametrize("to", ["c", "matlab"])
def test_export__gap_that_relaxes_within_a_step__moves_like_the_model(to, tmp_path):
    """Its damper relaxes 20 times within the shortest step, and the gap does not begin where it would be by itself."""
    needs(to)
    c, alpha = 100.0, 1e-3
    d = c * PAPER_EXPERIMENT.dt / (128 * 20.0)
    numeric = numeric_model(
        model_with_values("two_mass+backlash", {"J1": 0.01, "J2": 0.004, "c1": c, "d1": d, "alpha": alpha})
    )
    for start in (0.8, 2.0, -3.1):  # twists in halves of the gap: inside, beyond a limit each way
        x0 = np.array([start * alpha, 0.0, 1.0, 0.0, -1.2 * alpha])
        run = verification_run(numeric, np.full(20, 0.3), x0, "a gap that fades")
        write_files(tmp_path, exporter(to).files(numeric))
        assert deviation(run.y, exporter(to).verify(tmp_path, numeric, run).y) <= exporter(to).tolerance


def test_latex__parameters__have_half_of_their_interval_beside_them():
    text = exporter("latex").files(numeric_model(model_with_intervals(relative=0.1)))["drive.tex"].decode()
    (row,) = (line for line in text.splitlines() if line.endswith("% J1"))
    value, half = (
        float(part.replace(r" \cdot 10^{", "e").strip("$}")) for part in row.split("&")[1].strip().split(r" \pm ")
    )
    assert half / value == pytest.approx(0.5 * (1.1 - 1.0 / 1.1), rel=0.05)


@pytest.mark.long
@pytest.mark.parametrize("to", EXPORTS)
def test_export__twenty_random_structures__move_like_the_model(to, tmp_path):
    needs(to)
    worst = {}
    for i, drive in enumerate(random_models(20, 1)):
        worst[f"{i} {drive.structure}"] = deviation_of(to, drive, tmp_path / str(i))
    found = np.array(list(worst.values()))
    print(f"{to:9} median {np.median(found):.1e}  worst {found.max():.1e}  {max(worst, key=worst.get)}")
    assert found.max() <= exporter(to).tolerance


def test_random_structures__twenty__have_every_effect():
    from brightgrey.effects import registry

    drawn = {name for structure in random_structures(20, 1) for name in structure.split("+")}
    assert drawn == {e.name for e in registry().values() if e.number <= 11}


@pytest.mark.parametrize("to", EXPORTS)
def test_export__same_model__gives_the_same_files(to):
    if to == "fmu":
        needs(to)
    numeric = numeric_model(random_model("two_mass+coulomb+backlash", 5))
    target = exporter(to)
    assert target.files(numeric) == target.files(numeric)


def test_c_export__compared_with_plain_simulation__agrees_to_rounding(tmp_path):
    needs("c")
    from brightgrey.exports.targets import c99 as c_code

    numeric = numeric_model(random_model("three_mass+coulomb+stribeck+backlash+delay", 2, kinds=ALL))
    run = verification_of(numeric)
    write_files(tmp_path, c_code.EXPORTER.files(numeric))
    y = c_code.verify(tmp_path, numeric, run).y
    plain = plain_response(numeric.system, run.u[:80], numeric.dt, run.x0, numeric.settings)
    # Same steps, other root finders: what remains is rounding, carried on by stiff friction.
    assert np.all(np.abs(y[:, :80] - plain).max(axis=1) <= 1e-8 * np.abs(plain).max(axis=1))


def test_c_export__with_or_without_states__starts_there_or_at_rest(tmp_path):
    needs("c")
    from brightgrey.exports.targets import c99 as c_code

    numeric = numeric_model(random_model("two_mass+coulomb+backlash+current_control", 4, kinds=ALL))
    files = c_code.EXPORTER.files(numeric)
    text = files["drive.c"].decode() + files["drive.h"].decode()
    assert "malloc" not in text
    assert [line for line in text.splitlines() if line.startswith("#include <")] == ["#include <math.h>"]
    write_files(tmp_path, files)
    u = np.sin(0.05 * np.arange(100)) * verification_of(numeric).u.max()
    x0 = numeric.system.rest(position=0.3, speed=2.0, u=0.1)
    x0[numeric.system.state_names.index("lambda1")] = -0.5 * numeric.limits(0)[1]
    run = verification_run(numeric, u, x0, "a start in motion")
    assert deviation(run.y, c_code.verify(tmp_path, numeric, run).y) < 1e-9


def test_fmu__description__names_variables_units_and_sources(tmp_path):
    needs("fmu")
    fmpy = importlib.import_module("fmpy")
    model = random_model("two_mass+coulomb+viscous", 7, linear_axis=True)
    done = export(model, "fmu", tmp_path)
    (file,) = done.files
    described = fmpy.read_model_description(str(file))
    assert described.coSimulation.canInterpolateInputs
    variables = {v.name: v for v in described.modelVariables}
    assert (variables["torque"].causality, variables["torque"].unit) == ("input", "N")
    assert (variables["velocity"].causality, variables["velocity"].unit) == ("output", "mm/s")
    for name, part in model.parameters.items():
        assert float(variables[f"parameters.{name}"].start) == part.value
        assert variables[f"parameters.{name}"].unit == part.unit
    units = {unit.name: unit.baseUnit for unit in described.unitDefinitions}
    assert (units["mm/s"].m, units["mm/s"].s, units["mm/s"].factor) == (1, -1, 1e-3)
    with zipfile.ZipFile(io.BytesIO(file.read_bytes())) as zipped:
        assert {"modelDescription.xml", "sources/drive.c", "sources/drive.h", "sources/fmi2.c"} <= set(
            zipped.namelist()
        )
    # By fmpy's own loop, which holds the input: as a drive whose input is held.
    numeric = numeric_model(model)
    u = verification_of(numeric).u[:200]
    signals = np.array(list(zip(numeric.dt * np.arange(200), u, strict=True)), [("time", float), ("torque", float)])
    step = numeric.dt
    result = fmpy.simulate_fmu(str(file), input=signals, output_interval=step, stop_time=199 * step)
    from dataclasses import replace

    held = native(replace(numeric, settings=replace(numeric.settings, hold="zoh")), u, numeric.system.rest())
    assert deviation(held, result["velocity"][None, :]) < 1e-9


def test_fmu__set_to_a_kept_state__repeats_its_motion(tmp_path):
    needs("fmu")
    fmpy, fmi2 = importlib.import_module("fmpy"), importlib.import_module("fmpy.fmi2")
    (file,) = export(random_model("two_mass+coulomb+backlash+delay", 7), "fmu", tmp_path).files
    described, place = fmpy.read_model_description(str(file)), fmpy.extract(str(file), str(tmp_path / "unit"))
    unit = fmi2.FMU2Slave(guid=described.guid, unzipDirectory=place, modelIdentifier="drive", instanceName="drive")

    def steps():
        for k in range(50):
            unit.setReal([0], [5.0])
            unit.doStep(1e-3 * k, 1e-3)
            yield unit.getReal([1])[0]

    unit.instantiate()
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    first = list(steps())
    kept = unit.getFMUState()
    second = list(steps())
    unit.setFMUState(kept)
    assert list(steps()) == second
    unit.freeFMUState(kept)
    unit.reset()
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    assert list(steps()) == first
    with pytest.raises(importlib.import_module("fmpy.fmi1").FMICallException):
        unit.doStep(0.05, 0.7e-3)
    unit.terminate()
    unit.freeInstance()


def test_mat_file__has_matrices_parameters_and_settings():
    numeric = numeric_model(random_model("two_mass+coulomb+backlash", 5))
    content = loadmat(io.BytesIO(exporter("matlab").files(numeric)["drive.mat"]), simplify_cells=True)
    np.testing.assert_array_equal(content["A"], numeric.low.A[:, :, 0])
    assert content["parameters"]["J1"]["value"] == numeric.model.parameters["J1"].value
    assert content["parameters"]["J1"]["unit"] == "kg m²"
    assert content["settings"]["friction_width"] == numeric.model.settings.friction_width
    assert content["structure"] == str(numeric.model.structure)


def test_control_export__both_objects__agree_with_the_model(tmp_path):
    needs("control")
    numeric = numeric_model(random_model("two_mass+coulomb+viscous+current_control", 6, kinds=ALL))
    from brightgrey.exports.targets import python_control

    space = {}
    exec(python_control.EXPORTER.files(numeric)["drive_control.py"], space)
    x = numeric.system.rest(speed=0.4, u=0.2)
    linear, known = space["linear"](x, 0.2), numeric.system.linearise(x, 0.2)
    for name in "ABCD":
        np.testing.assert_allclose(getattr(linear, name), getattr(known, name), rtol=1e-12, atol=1e-12)
    nonlinear = space["nonlinear"]()
    np.testing.assert_allclose(nonlinear.dynamics(0.0, x, [0.2]), numeric.system.derivative(x, 0.2), rtol=1e-12)
    np.testing.assert_allclose(nonlinear.output(0.0, x, [0.2]), numeric.system.output(x, 0.2), rtol=1e-12)


def test_modelica__of_the_papers_effects__uses_standard_components():
    text = (
        exporter("modelica")
        .files(numeric_model(random_model("two_mass+coulomb+viscous+gravity+delay", 3)))["Drive.mo"]
        .decode()
    )
    for name in ("Components.Inertia", "Components.SpringDamper", "Components.Damper", "Sources.ConstantTorque"):
        assert f"Modelica.Mechanics.Rotational.{name} " in text
    assert "Modelica.Blocks.Nonlinear.FixedDelay " in text
    axis = (
        exporter("modelica")
        .files(numeric_model(random_model("two_mass+gravity", 3, linear_axis=True)))["Drive.mo"]
        .decode()
    )
    assert "Modelica.Mechanics.Translational.Components.Mass " in axis


def test_modelica__as_equations__moves_like_the_model(tmp_path):
    needs("modelica")
    numeric = numeric_model(random_model("two_mass+coulomb+stribeck+gravity+backlash+current_control", 8, kinds=ALL))
    run = verification_of(numeric)
    (tmp_path / "Drive.mo").write_text(modelica.equation_model(numeric))
    assert deviation(run.y, modelica.verify(tmp_path, numeric, run).y) <= modelica.EXPORTER.tolerance


@pytest.mark.system
@pytest.mark.parametrize("to", ["c", "matlab"])
def test_export__program_is_missing__says_so_and_writes_the_files(to, tmp_path, monkeypatch):
    monkeypatch.setattr(tools.shutil, "which", lambda name: None)
    done = export(random_model("one_mass+coulomb", 1), to, tmp_path)
    assert done.text == f"not verified: {PROGRAMS[to][0]} is not installed"
    assert done.deviation is None
    assert all(file.exists() for file in done.files)


def test_export__package_is_missing__says_how_to_install_it(tmp_path, monkeypatch):
    def absent(name):
        raise ImportError(name)

    target, numeric = exporter("control"), numeric_model(random_model("one_mass+coulomb", 1))
    run = verification_of(numeric)
    monkeypatch.setattr(tools.importlib, "import_module", absent)
    _, text, _ = compare_with_native(tmp_path, numeric, run, target.verify, target.tolerance)
    assert text == "not verified: control is not installed (pip install 'brightgrey[control]')"


def test_export__deviates_too_much__is_not_good(tmp_path, monkeypatch):
    needs("c")
    from brightgrey.exports.targets import c99 as c_code

    honest = c_code.sources

    def altered(numeric):
        text = honest(numeric)
        return text | {"drive.c": text["drive.c"].replace("d.slope = rise / DT", "d.slope = 1.01 * rise / DT")}

    monkeypatch.setattr(c_code, "sources", altered)
    done = export(random_model("one_mass+coulomb", 1), "c", tmp_path)
    assert not done.good
    assert "was to be expected" in done.text
    assert done.text.endswith("% of the range do not matter")


def test_export__wrong_target_folder_or_sampling__is_refused(tmp_path):
    model = random_model("one_mass+coulomb", 1)
    with pytest.raises(SettingsError, match="Did you mean 'matlab'"):
        export(model, "mathlab", tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(SettingsError, match="is a file"):
        export(model, "c", tmp_path / "file")
    t = 2e-3 * np.arange(50)
    other = Recording("slow.csv", t, 0.0 * t, np.sin(t)[None, :], model.input, model.outputs)
    with pytest.raises(SettingsError, match=r"every 0\.002 s; the model every 0\.001 s"):
        export(model, "c", tmp_path, other)


def test_export_command__writes_files_and_prints_the_deviation(tmp_path, capsys):
    needs("c")
    model = random_model("two_mass+coulomb+viscous", 9)
    model.save(tmp_path / "model.json")
    t = 1e-3 * np.arange(300)
    rows = [f"{a:.3f},{b:.5f},0.0" for a, b in zip(t, 3.0 * np.sin(40.0 * t), strict=True)]
    (tmp_path / "run.csv").write_text("\n".join(["t [s],torque [N m],velocity [rad/s]", *rows]))
    arguments = ["export", str(tmp_path / "model.json"), "--to", "c", "--out", str(tmp_path / "out")]
    assert main([*arguments, "--recording", str(tmp_path / "run.csv")]) == 0
    printed = capsys.readouterr().out
    assert "of range on the input of run.csv (gcc, compiled and run)" in printed
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"drive.c", "drive.h"}
    assert main([*arguments, "--json"]) == 0
    (said,) = json.loads(capsys.readouterr().out)
    assert (said["to"], said["good"]) == ("c", True)
    assert said["deviation"] < 1e-6
    assert main([*arguments[:2], "--to", "cpp"]) == 2
    assert "unknown export 'cpp'" in capsys.readouterr().err


def test_export__leaves_no_temporary_files(tmp_path, monkeypatch):
    needs("c")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    export(random_model("one_mass+coulomb", 1), "c", tmp_path / "out")
    assert [p for p in tmp_path.iterdir() if p != Path(tmp_path / "out")] == []
