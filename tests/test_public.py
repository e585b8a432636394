"""The public face: every name with its type and its description, and no import before it is needed."""

import ast
import inspect
import pkgutil
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest

import brightgrey

FUNCTIONS = {
    *("analyse", "check", "demo", "design", "export", "identify", "identify_fleet", "identify_resumable", "inspect"),
    *(
        "list_runs",
        "load_model",
        "plan",
        "read_for",
        "read_manifest",
        "read_recording",
        "read_recordings",
        "read_stretches",
    ),
    *("recording_from", "selftest", "simulate", "watch", "write_selftest"),
}
TYPES = {
    *("Analysis", "Axis", "Budget", "Compensator", "Design", "Export", "Fleet", "GeneticSettings", "Inspection"),
    *(
        "CheckResult",
        "Checkup",
        "Margins",
        "Member",
        "Model",
        "Plan",
        "Recording",
        "Result",
        "RunStatus",
        "SelfTest",
        "Signal",
        "Simulation",
        "StoredRun",
        "Structure",
    ),
    "Watch",
}
ERRORS = {"BrightgreyError", "ExportError", "RecordingError", "RunError", "SettingsError", "StructureError"}
HEAVY = ("numpy", "scipy", "numba", "matplotlib", "plotly", "jinja2", "ruckig")


def test_all__lists_functions_types_errors_and_version():
    assert set(brightgrey.__all__) == FUNCTIONS | TYPES | ERRORS | {"__version__"}
    assert sorted(brightgrey.__all__) == brightgrey.__all__


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_public_function__has_types_and_numpydoc_sections(name):
    function = getattr(brightgrey, name)
    assert inspect.isfunction(function)
    doc = inspect.getdoc(function)
    if "those of `read_recording`" in doc:
        doc += inspect.getdoc(brightgrey.read_recording)
    signature = inspect.signature(function)
    assert "Returns\n-------" in doc
    assert signature.return_annotation is not inspect.Signature.empty
    if signature.parameters:
        assert "Parameters\n----------" in doc
    for parameter in signature.parameters.values():
        assert parameter.annotation is not inspect.Parameter.empty, parameter
        assert parameter.name in doc, parameter


@pytest.mark.parametrize("name", sorted(TYPES | ERRORS))
def test_public_type__is_described(name):
    found = getattr(brightgrey, name)
    assert inspect.isclass(found)
    assert found.__name__ == name
    assert found.__doc__.strip()
    assert issubclass(found, brightgrey.BrightgreyError) == (name in ERRORS)


def test_type_checker__sees_the_names_that_are_imported_lazily():
    tree = ast.parse(Path(brightgrey.__file__).read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    seen = {alias.name: node.module for node in block.body for alias in node.names}
    assert set(seen) == set(brightgrey.__all__) - {"__version__"}
    for name, module in seen.items():
        assert getattr(brightgrey, name) is getattr(sys.modules[module], name)


def test_dir__shows_every_name():
    assert set(brightgrey.__all__) <= set(dir(brightgrey))


def test_no_name__is_that_of_a_package_inside():
    modules = {module.name for module in pkgutil.iter_modules(brightgrey.__path__)}
    assert not modules & set(brightgrey.__all__)


@pytest.mark.parametrize("first", ["import brightgrey.exports.registry", "from brightgrey import export"])
def test_export__is_the_function_whatever_is_imported_first(first):
    code = f"{first}; import brightgrey.exports.registry, brightgrey; print(type(brightgrey.export).__name__)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "function"


def test_unknown_name__is_an_attribute_error():
    with pytest.raises(AttributeError, match="identfy"):
        brightgrey.identfy  # noqa: B018


def imported_after(code, packages=HEAVY):
    """Those of the packages that a fresh interpreter has imported after `code`."""
    show = f"; import sys; print('imported', *(m for m in {packages!r} if m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code + show], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1].split()[1:]


def test_import_brightgrey__loads_no_heavy_package():
    assert imported_after("import brightgrey") == []


def test_help__loads_no_heavy_package():
    # A clock says nothing on a busy machine; these imports are what would make it slow.
    code = "from brightgrey.cli import main; main(['--help']); main(['identify', '--help'])"
    assert imported_after(code) == []


def test_identify_with_a_given_structure__loads_no_package_it_does_not_use(tmp_path):
    demo = files("brightgrey.excitation").joinpath("data/demo.csv")
    arguments = ["identify", str(demo), "--input", "torque", "--output", "velocity", "--structure", "one_mass+viscous"]
    code = f"from brightgrey.cli import main; main({[*arguments, '--quiet', '--out', str(tmp_path)]!r})"
    unused = {"scipy.stats", "scipy.signal", "scipy.optimize", "scipy.integrate", "scipy.io", "matplotlib", "ruckig"}
    unused |= {"brightgrey.search.decision", "brightgrey.search.genetic", "brightgrey.api.differences"}
    assert not unused & set(imported_after(code, tuple(unused)))
