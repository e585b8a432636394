"""Every public docstring is read: description, parameters, shapes, units, errors, source."""

import ast
import dataclasses
import importlib
import importlib.util
import inspect
import pkgutil
import re
import textwrap
from pathlib import Path

import pytest

import brightgrey
from brightgrey import errors
from brightgrey.effects import registry

REFERENCE_PAGES = [Path(__file__).parents[2] / "docs" / "reference" / f"{name}.md" for name in ("python", "extending")]
ERRORS = {name for name, value in vars(errors).items() if inspect.isclass(value) and issubclass(value, ValueError)}
SECTIONS = ("Parameters", "Returns", "Raises", "Attributes", "Notes", "Examples", "Yields")
# What says in which unit a number stands, or that it has none.
UNITS = re.compile(
    r"\bSI\b|\bunits?\b|\bin s\b|\bs\b|\bHz\b|rad|N m|1/s|\bm/s|\bm\b|ratio|percent|%|degrees|[Nn]umber|[Ff]actor"
    r"|samples?|chance|[Pp]robabilit|[Cc]riterion|correlation|times\b|[Ww]eight|relative|points|[Ss]tay within|part of",
)


def modules():
    for found in pkgutil.walk_packages(brightgrey.__path__, "brightgrey."):
        if found.name.startswith("brightgrey.app.") and importlib.util.find_spec("nicegui") is None:
            continue  # only the extra brings what it needs
        if not found.name.endswith("__main__"):
            yield importlib.import_module(found.name)


def public():
    """All that a module of the package offers, once, by its full name."""
    seen = {}
    for module in modules():
        for name in getattr(module, "__all__", ()):
            value = getattr(module, name)
            if (inspect.isfunction(value) or inspect.isclass(value)) and value.__module__.startswith("brightgrey"):
                seen[f"{value.__module__}.{value.__qualname__}"] = value
                if inspect.isclass(value):
                    defaults = getattr(value, "__dataclass_fields__", {})
                    for part, member in vars(value).items():
                        function = getattr(member, "__func__", member)
                        if part not in defaults and inspect.isfunction(function) and not part.startswith("_"):
                            seen[f"{value.__module__}.{value.__qualname__}.{part}"] = function
    return dict(sorted(seen.items()))


PUBLIC = public()
FUNCTIONS = {name: value for name, value in PUBLIC.items() if inspect.isfunction(value)}


def reference():
    """What the API reference shows, by its name there."""
    text = "\n".join(page.read_text(encoding="utf-8") for page in REFERENCE_PAGES)
    found = {}
    for name in re.findall(r"\.\. auto(?:function|class|exception):: ([\w.]+)", text):
        home, _, last = name.rpartition(".")
        found[name] = getattr(importlib.import_module(home), last)
    for home, listed in re.findall(r"\.\. automodule:: ([\w.]+)\n   :members: (.*)", text):
        module = importlib.import_module(home)
        found |= {f"{home}.{name}": getattr(module, name) for name in listed.split(", ")}
    return found


REFERENCE = reference()


def sections(value):
    """Sections of a numpydoc docstring by their titles; the description under an empty one."""
    out, title = {"": []}, ""
    lines = inspect.cleandoc(value.__doc__ or "").splitlines()
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if line in SECTIONS and set(below) == {"-"}:
            title = line
            out[title] = []
        elif set(line) != {"-"}:
            out[title].append(line)
    return out


def entries(lines):
    """Type and text of each entry of a section, by name; ``a, b : float`` are two."""
    out, names = {}, []
    for line in lines:
        if line and not line[0].isspace():
            left, _, kind = line.partition(" : ")
            names = [name.strip().lstrip("*") for name in left.split(",")]
            out |= dict.fromkeys(names, kind)
        else:
            out |= {name: f"{out[name]} {line.strip()}" for name in names}
    return out


def begins_with_a_sentence(value):
    first = (inspect.getdoc(value) or "").split("\n\n")[0].replace("\n", " ")
    return len(first.split()) >= 2 and first.rstrip()[-1] in ".:"


def test_public_docstrings__begin_with_a_sentence():
    assert [name for name, value in PUBLIC.items() if not begins_with_a_sentence(value)] == []


def lists_its_parameters(function):
    own = sections(function)
    described, there = set(entries(own["Parameters"])), set(inspect.signature(function).parameters)
    complete = described == there - {"self", "cls"} or "Parameters that are not listed" in " ".join(own[""])
    return described <= there and complete


def test_parameters_sections__name_those_of_the_signature():
    described = {name: function for name, function in FUNCTIONS.items() if "Parameters" in sections(function)}
    assert len(described) > 100
    assert [name for name, function in described.items() if not lists_its_parameters(function)] == []


def raised(function):
    """Errors for users that the function itself raises."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    calls = [node.exc for node in ast.walk(tree) if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)]
    return {call.func.id for call in calls if isinstance(call.func, ast.Name)} & ERRORS


def unnamed_errors(function):
    text = inspect.getdoc(function) or ""
    if "Raises" in text or "efuse" in text:
        return set()
    return {error for error in raised(function) if error not in text}


def test_docstrings__name_the_errors_that_are_raised():
    assert {name: found for name, function in FUNCTIONS.items() if (found := unnamed_errors(function))} == {}


def arrays(annotation):
    return bool(re.search(r"\bArray\b|NDArray|ArrayLike|Complex\b", str(annotation)))


@pytest.mark.parametrize("name", REFERENCE)
def test_reference__describes_parameters_shapes_units_and_return(name):
    value = REFERENCE[name]
    own = sections(value)
    if inspect.isclass(value):
        declared = {f.name: f.type for f in dataclasses.fields(value)} if dataclasses.is_dataclass(value) else {}
        if issubclass(value, tuple):
            declared = dict(value.__annotations__)
        described = entries(own.get("Attributes", []))
    else:
        declared = {p.name: p.annotation for p in inspect.signature(value).parameters.values()}
        described = entries(own.get("Parameters", []))
        if "return" in value.__annotations__ and value.__annotations__["return"] not in (None, "None"):
            assert "Returns" in own or len(declared) == 0 or len(" ".join(own[""]).split()) > 3
    short = len(declared) <= 3 and not described  # what a sentence is enough for
    if "Parameters that are not listed" not in " ".join(own[""]):
        assert short or set(described) == set(declared) - {"self"}
    for part, text in described.items():
        if arrays(declared.get(part, "")):
            assert "shape" in text or "shape" in " ".join(own[""]), part
        if re.search(r"\bfloat\b", str(declared.get(part, ""))):
            assert UNITS.search(text) or UNITS.search(" ".join(own[""])), part


@pytest.mark.parametrize("effect", registry().values(), ids=lambda e: e.name)
def test_effect__has_equation_source_and_units(effect):
    assert "=" in effect.equation
    assert re.search(r"eq\. \(|section \d|doi:", effect.source)
    for parameter in effect.parameters:
        assert len(parameter.about.split()) >= 2
    described = inspect.getmodule(effect.stamp).__doc__ or ""
    assert len(described.split()) > 3
