"""Languages that expressions are written in."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from brightgrey.effects import Element
from brightgrey.exports.expressions.trace import Expression, traced, walk

__all__ = [
    "LATEX",
    "MATLAB",
    "MODELICA",
    "PYTHON",
    "C",
    "Language",
    "assignments",
    "latex_name",
    "latex_number",
    "law_statements",
    "number_literal",
    "parameter_literals",
    "spell",
]

# Precedence of the operators; an atom (a name, a number, a call) needs no brackets anywhere.
_BINDING = {">=": 1, ">": 1, "<=": 1, "<": 1, "==": 1, "+": 2, "-": 2, "neg": 2, "*": 3, "/": 3}
_ATOM = max(_BINDING.values()) + 1


@dataclass(frozen=True)
class Language:
    """Spelling of operations: format strings with one ``{}`` per operand."""

    calls: Mapping[str, str]  #: Of functions and operators; an infix operator that is not here is written as ``a + b``.
    definition: str  #: Statement that defines a name, with ``{name}`` and ``{value}``.
    end: str  #: End of a statement.
    #: Spelling of a symbol and of a number.
    name: Callable[[str], str]
    number: Callable[[float], str]


def number_literal(value: float) -> str:
    """Shortest decimal that reads back exactly, with a point or an exponent."""
    text = repr(float(value))
    return {"inf": "HUGE_VAL", "-inf": "-HUGE_VAL"}.get(text, text)


def latex_name(name: str) -> str:
    r"""Symbol of the kit in LaTeX: ``omega_S`` is ``\omega_{S}``, ``J1`` is ``J_{1}``, ``M_C@2`` is ``M_{C,2}``."""
    if name.startswith("="):  # spelled already
        return name[1:]
    stem, at, place = name.partition("@")
    match = re.fullmatch(r"([A-Za-z]+)_(\w+)", stem) or re.fullmatch(r"([A-Za-z]+)(\d*)", stem)
    head, index = match.groups() if match else (stem, "")
    if head in ("alpha", "beta", "gamma", "lambda", "mu", "omega", "phi", "tau", "theta"):
        head = "\\" + head
    elif len(head) > 1:
        head = rf"\mathrm{{{head}}}"
    index = rf"\mathrm{{{index}}}" if len(index) > 1 else index
    below = ",".join(part for part in (index, place if at else "") if part)
    return f"{head}_{{{below}}}" if below else head


def latex_number(value: float, digits: int = 6) -> str:
    """So many digits, powers of ten written as such."""
    text = f"{value:.{digits}g}"
    mantissa, e, exponent = text.partition("e")
    return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if e else text


C = Language(
    {
        "tanh": "tanh({})",
        "exp": "exp({})",
        "sin": "sin({})",
        "cos": "cos({})",
        "abs": "fabs({})",
        "max": "fmax({}, {})",
        "min": "fmin({}, {})",
        "where": "({} ? {} : {})",
    },
    "const double {name} = {value}",
    ";",
    str,
    number_literal,
)
MATLAB = Language(
    {
        "tanh": "tanh({})",
        "exp": "exp({})",
        "sin": "sin({})",
        "cos": "cos({})",
        "abs": "abs({})",
        "max": "max({}, {})",
        "min": "min({}, {})",
        "where": "choose({}, {}, {})",
    },
    "{name} = {value}",
    ";",
    str,
    number_literal,
)
PYTHON = Language(
    {
        "tanh": "np.tanh({})",
        "exp": "np.exp({})",
        "sin": "np.sin({})",
        "cos": "np.cos({})",
        "abs": "abs({})",
        "max": "max({}, {})",
        "min": "min({}, {})",
        "where": "np.where({}, {}, {})",
    },
    "{name} = {value}",
    "",
    str,
    number_literal,
)
MODELICA = Language(
    {
        "tanh": "tanh({})",
        "exp": "exp({})",
        "sin": "sin({})",
        "cos": "cos({})",
        "abs": "abs({})",
        "max": "max({}, {})",
        "min": "min({}, {})",
        "where": "(if {} then {} else {})",
    },
    "{name} = {value}",
    ";",
    lambda name: name.replace("@", "_"),
    number_literal,
)
LATEX = Language(
    {
        "tanh": r"\tanh\left({}\right)",
        "exp": r"\exp\left({}\right)",
        "sin": r"\sin\left({}\right)",
        "cos": r"\cos\left({}\right)",
        "abs": r"\left|{}\right|",
        "max": r"\max\left({}, {}\right)",
        "min": r"\min\left({}, {}\right)",
        "where": r"\left\{{\begin{{array}}{{ll}}{1} & \text{{if }} {0}\\ {2} & \text{{else}}\end{{array}}\right.",
        "*": r"{}\,{}",
        "/": r"\frac{{{}}}{{{}}}",
        ">=": r"{} \ge {}",
        "<=": r"{} \le {}",
        "==": r"{} = {}",
    },
    "{name} = {value}",
    "",
    latex_name,
    latex_number,
)


def spell(expression: Expression, language: Language, named: Mapping[tuple[object, ...], str] | None = None) -> str:
    """Text of `expression`; parts whose key is in `named` are written by that name."""
    return _written(expression, language, named or {})[0]


def _written(e: Expression, language: Language, named: Mapping[tuple[object, ...], str]) -> tuple[str, int]:
    """Text of an expression and the precedence of its outermost operator."""
    if e.key in named:
        return named[e.key], _ATOM
    if e.operation == "symbol":
        return language.name(e.operands[0]), _ATOM
    if e.operation == "constant":
        return language.number(e.operands[0]), _ATOM if e.operands[0] >= 0.0 else _BINDING["neg"]
    texts = [_written(o, language, named) for o in e.operands]
    form = language.calls.get(e.operation)
    if e.operation not in _BINDING and form:
        return form.format(*(text for text, _ in texts)), _ATOM
    own = _BINDING[e.operation]
    if form and form.startswith("\\frac"):
        return form.format(*(text for text, _ in texts)), _ATOM
    left, *right = (
        text if binding > own or (binding == own and not i and e.operation != "neg") else f"({text})"
        for i, (text, binding) in enumerate(texts)
    )
    if e.operation == "neg":
        return f"-{left}", own
    return form.format(left, right[0]) if form else f"{left} {e.operation} {right[0]}", own


def assignments(results: Mapping[str, Expression], language: Language) -> list[str]:
    """Statements for several results; functions and parts that occur more than once are computed once.

    Returns
    -------
    list of str
        Statements that define the intermediate results, then one statement ``name = value`` per result.
    """
    parts = {part.key: part for expression in results.values() for part in walk(expression)}
    uses = Counter(o.key for part in parts.values() for o in part.operands if isinstance(o, Expression))
    uses.update(expression.key for expression in results.values())
    named: dict[tuple[object, ...], str] = {}
    lines = []
    for key, part in parts.items():
        if uses[key] > 1 and part.operation not in ("symbol", "constant"):
            text = spell(part, language, named)
            name = f"t{len(named) + 1}"
            lines.append(language.definition.format(name=name, value=text))
            named[key] = name
    lines += [f"{name} = {spell(e, language, named)}" for name, e in results.items()]
    return [line + language.end for line in lines]


def law_statements(element: Element, language: Language, force: str = "force", slope: str = "slope") -> list[str]:
    """Statements that compute the force of an element and its slope from the port ``z``, parameters as numbers first.

    Parameters
    ----------
    element : Element
        With one port.
    language : Language
    force, slope : str
        Targets of the last two statements, as the language writes them.
    """
    phi, slopes = traced(element.law, ("z",))
    lines = assignments({force: phi, slope: slopes[0]}, language)
    values = [
        language.definition.format(name=name, value=text) + language.end
        for name, text in parameter_literals(element).items()
        if any(name in line for line in lines)
    ]
    return [*values, *lines]


def parameter_literals(element: Element) -> dict[str, str]:
    """Parameters of an element's law, SI, as number literals by name."""
    return {
        name: number_literal(float(np.ravel(p)[0])) for name, p in zip(element.law.parameters, element.p, strict=True)
    }
