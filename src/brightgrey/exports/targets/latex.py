"""Export to LaTeX: equations with values and units."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from brightgrey.effects import Element
from brightgrey.exports.expressions.languages import LATEX, latex_name, latex_number, spell
from brightgrey.exports.expressions.trace import Expression, symbol, traced
from brightgrey.exports.external_tools import MissingToolError, program, run_program
from brightgrey.exports.numeric_model import NumericModel, numeric_model
from brightgrey.exports.registry import Exporter, Verified
from brightgrey.exports.verification import VerificationRun, native

__all__ = ["EXPORTER"]

FILE = "drive.tex"
_PER_LINE = 3
_ESCAPES = str.maketrans({c: f"\\{c}" for c in "_%#&${}"} | {"\\": r"\textbackslash{}"})
_SIGNS = {"²": "$^2$", "³": "$^3$", "°": r"$^\circ$", "µ": r"$\mu$", "μ": r"$\mu$", "·": r"$\cdot$", "⁻¹": "$^{-1}$"}
_DOCUMENT = r"""\documentclass[a4paper,11pt]{article}
\usepackage{amsmath}
\usepackage[T1]{fontenc}
\usepackage[margin=25mm]{geometry}
\begin{document}
\section*{%(title)s}
Identified by brightgrey %(version)s from input %(input)s. Equations in SI units.

\subsection*{State equations}
\begin{align*}
%(states)s
\end{align*}
%(elements)s
\subsection*{Outputs}
\begin{align*}
%(outputs)s
\end{align*}

\subsection*{Parameters (units of the recording)}
\noindent
\begin{tabular}{lllp{85mm}}
%(parameters)s
\end{tabular}
\end{document}
"""


def files_of(scheme: NumericModel) -> dict[str, bytes]:
    """File ``drive.tex``."""
    text = _DOCUMENT % {
        "title": _text(scheme.title),
        "version": _text(scheme.model.version),
        "input": _text(f"{scheme.model.input.name} [{scheme.model.input.unit}]"),
        "states": " \\\\\n".join(_state_equations(scheme)),
        "elements": _elements(scheme),
        "outputs": " \\\\\n".join(_outputs(scheme)),
        "parameters": "\n".join(_parameters(scheme)),
    }
    return {FILE: text.encode()}


def _text(text: str) -> str:
    text = text.translate(_ESCAPES)
    for sign, spelled in _SIGNS.items():
        text = text.replace(sign, spelled)
    return text


def _input(scheme: NumericModel) -> str:
    return "u(t - T_{d})" if sum(scheme.delay) > 0.0 else "u"


def _state_equations(scheme: NumericModel) -> Iterable[str]:
    system = scheme.system
    names = [latex_name(name) for name in system.state_names]
    for i, name in enumerate(names):
        terms = [(float(system.A[i, j]), names[j]) for j in range(scheme.n)]
        terms.append((float(system.B[i, 0]), _input(scheme)))
        terms += [(float(e.G[i]), rf"\varphi_{{{k + 1}}}") for k, e in enumerate(system.elements)]
        yield rf"\dot{{{name}}} &= {_sum(terms)}"


def _sum(terms: list[tuple[float, str]]) -> str:
    """Sum of numbers times symbols, broken into lines."""
    parts = []
    for weight, name in terms:
        if weight != 0.0:
            size = "" if abs(weight) == 1.0 else latex_number(abs(weight)) + r"\,"
            parts.append(f"{'-' if weight < 0.0 else '+'} {size}{name}")
    parts = parts or ["0"]
    parts[0] = parts[0].removeprefix("+ ")
    lines = [" ".join(parts[i : i + _PER_LINE]) for i in range(0, len(parts), _PER_LINE)]
    return " \\\\\n&\\quad ".join(lines)


def _elements(scheme: NumericModel) -> str:
    """Equations of the laws."""
    if not scheme.system.elements:
        return ""
    names = [latex_name(name) for name in scheme.system.state_names]
    lines = []
    for k, element in enumerate(scheme.system.elements):
        placed = next(p for p in scheme.model.structure.placed if f"{p.name}@{p.place}" == element.name)
        ports = [_port(row, names) for row in np.asarray(element.H, float)]
        left = rf"\varphi_{{{k + 1}}} &= "
        lines.append(rf"&\text{{{_text(placed.effect.title)}}} \notag")
        if element.limits is not None:
            lines += _limited(element, left, ports[0].removeprefix("(").removesuffix(")"), names[element.limits.state])
        else:
            own = {q.symbol: placed.parameter(q.symbol) for q in placed.effect.parameters}
            phi = traced(element.law, [f"port{i}" for i in range(len(ports))])[0]
            lines.append(left + spell(_spelled(phi, own, ports), LATEX))
    return "\\begin{align*}\n" + " \\\\\n".join(lines) + "\n\\end{align*}"


def _port(row: Iterable[float], names: list[str]) -> str:
    text = _sum([(float(weight), name) for weight, name in zip(row, names, strict=True)])
    return text if "+" not in text and "-" not in text else rf"({text})"


def _limited(element: Element, left: str, rate: str, state: str) -> list[str]:
    """Equation of an integrator with saturation."""
    limits = element.limits
    assert limits is not None
    low, high = (latex_number(float(np.ravel(end)[0])) for end in (limits.lower, limits.upper))
    cases = [
        rf"0 & \text{{if }} {state} \ge {high} \text{{ and }} r > 0,",
        rf"0 & \text{{if }} {state} \le {low} \text{{ and }} r < 0,",
        r"r & \text{else,}",
    ]
    return [left + r"\begin{cases}" + r" \\ ".join(cases) + r"\end{cases}", f"r &= {rate}"]


def _spelled(e: Expression, own: dict[str, str], ports: list[str]) -> Expression:
    """Names of parameters with their places, and what the ports read."""
    if e.operation == "symbol":
        name = e.operands[0]
        port = re.fullmatch(r"port(\d+)", name)
        return symbol(f"={ports[int(port[1])]}" if port else own.get(name, name))
    return Expression(e.operation, *(_spelled(o, own, ports) if isinstance(o, Expression) else o for o in e.operands))


def _outputs(scheme: NumericModel) -> Iterable[str]:
    names = [latex_name(name) for name in scheme.system.state_names]
    for output in scheme.outputs:
        row = names[output.row] if output.row < scheme.n else rf"\dot{{{names[output.row - scheme.n]}}}"
        if output.differenced:
            row = rf"\frac{{{row}(t) - {row}(t - {latex_number(scheme.dt)})}}{{{latex_number(scheme.dt)}}}"
        yield rf"\text{{{_text(output.name)}}} &= {row}"


def _parameters(scheme: NumericModel) -> Iterable[str]:
    for name, declared in scheme.model.structure.parameters.items():
        part = scheme.model.parameters[name]
        spread = "" if part.std is None else rf" \pm {part.std:.1g}".replace("e", r"\mathrm{e}")
        value = f"{latex_number(part.value)}{spread}"
        yield rf"${latex_name(name)}$ & ${value}$ & {_text(part.unit)} & {_text(declared.about)} \\ % {name}"
    unit = _text(scheme.model.settings.f_tanh_unit)
    yield rf"${latex_name('f_tanh')}$ & ${latex_number(scheme.model.settings.f_tanh)}$ & {unit} & fixed upfront \\"


def verify(folder: Path, scheme: NumericModel, trial: VerificationRun) -> Verified:
    """Read the values back as they are printed, simulate with them, and set the page."""
    read = dict(_read_back((folder / FILE).read_text(encoding="utf-8")))
    parameters = {name: part.model_copy(update={"value": read[name]}) for name, part in scheme.model.parameters.items()}
    again = numeric_model(scheme.model.model_copy(update={"parameters": parameters}))
    y = native(replace(again, outputs=scheme.outputs), trial.u, trial.x0)
    by = "native simulation of the values as printed"
    try:
        run_program([program("pdflatex"), "-interaction=nonstopmode", "-halt-on-error", FILE], folder)
    except MissingToolError as missing:
        return Verified(y, f"{by}; not set: {missing}")
    return Verified(y, f"{by}; set by pdflatex")


def _read_back(text: str) -> Iterable[tuple[str, float]]:
    for value, name in re.findall(r"^\$[^$]*\$ & \$([^$]*)\$ .* % (\S+)$", text, re.MULTILINE):
        mantissa, times, exponent = value.partition(r" \pm")[0].partition(r" \cdot 10^{")
        yield name, float(mantissa) * 10.0 ** (int(exponent.rstrip("}")) if times else 0)


EXPORTER = Exporter("LaTeX document: equations with values and units", 1e-3, files_of, verify)
