"""Export to LaTeX: drawing of the drive, equations with values and units."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from brightgrey.drawing.items import STYLE
from brightgrey.drawing.layout import lay_out
from brightgrey.effects import PER_SPEED, Element
from brightgrey.exports.expressions.languages import LATEX, latex_name, latex_number, spell
from brightgrey.exports.expressions.trace import rename_symbols, traced
from brightgrey.exports.external_tools import MissingToolError, program, run_program
from brightgrey.exports.latex_picture import escaped, latex_picture
from brightgrey.exports.numeric_model import NumericModel, amplitude_of, numeric_model
from brightgrey.exports.registry import Exporter
from brightgrey.exports.verification import VerificationRun, Verified, native

__all__ = ["EXPORTER"]

_DOCUMENT_FILE = "drive.tex"
_DOCUMENT_TEXT = r"""\documentclass[a4paper,11pt]{article}
\usepackage{amsmath}
\usepackage[T1]{fontenc}
\usepackage[margin=25mm]{geometry}
\begin{document}
\section*{%(title)s}
Identified by brightgrey %(version)s from input %(input)s. Equations in SI units.

\subsection*{Drawing (units of the recording)}
%(drawing)s

\subsection*{State equations}
\begin{align*}
%(states)s
\end{align*}
%(elements)s
\subsection*{Outputs}
\begin{align*}
%(outputs)s
\end{align*}

\subsection*{Parameters (units of the recording; $\pm$: half of the 95\,\%% interval)}
\noindent
\begin{tabular}{lllp{85mm}}
%(parameters)s
\end{tabular}
\end{document}
"""


def files_of(numeric: NumericModel) -> dict[str, bytes]:
    """File ``drive.tex``."""
    text = _DOCUMENT_TEXT % {
        "title": escaped(numeric.title),
        "version": escaped(numeric.model.version),
        "input": escaped(f"{numeric.model.input.name} [{numeric.model.input.unit}]"),
        "drawing": latex_picture(lay_out(numeric.model.drawing().drive, STYLE.medium)),
        "states": " \\\\\n".join(_state_equations(numeric)),
        "elements": _law_equations(numeric),
        "outputs": " \\\\\n".join(_output_equations(numeric)),
        "parameters": "\n".join(_parameter_rows(numeric)),
    }
    return {_DOCUMENT_FILE: text.encode()}


def _delayed_input(numeric: NumericModel) -> str:
    return "u(t - T_{d})" if sum(numeric.delay) > 0.0 else "u"


def _state_equations(numeric: NumericModel) -> Iterable[str]:
    system = numeric.system
    names = [latex_name(name) for name in system.state_names]
    for i, name in enumerate(names):
        terms = [(float(system.A[i, j]), names[j]) for j in range(numeric.n)]
        terms.append((float(system.B[i, 0]), _delayed_input(numeric)))
        terms += [(float(e.G[i]), rf"\varphi_{{{k + 1}}}") for k, e in enumerate(system.elements)]
        yield rf"\dot{{{name}}} &= {_latex_sum(terms)}"


def _latex_sum(terms: list[tuple[float, str]]) -> str:
    """Sum of numbers times symbols, in lines of three terms, which fit the page."""
    parts = []
    for weight, name in terms:
        if weight != 0.0:
            size = "" if abs(weight) == 1.0 else latex_number(abs(weight)) + r"\,"
            parts.append(f"{'-' if weight < 0.0 else '+'} {size}{name}")
    parts = parts or ["0"]
    parts[0] = parts[0].removeprefix("+ ")
    lines = [" ".join(parts[i : i + 3]) for i in range(0, len(parts), 3)]
    return " \\\\\n&\\quad ".join(lines)


def _law_equations(numeric: NumericModel) -> str:
    """Equations of the laws."""
    if not numeric.system.elements:
        return ""
    names = [latex_name(name) for name in numeric.system.state_names]
    lines = []
    for k, element in enumerate(numeric.system.elements):
        placed = numeric.model.placed(element)
        ports = [_port_text(row, names) for row in np.asarray(element.H, float)]
        left = rf"\varphi_{{{k + 1}}} &= "
        lines.append(rf"&\text{{{escaped(placed.effect.title)}}} \notag")
        if element.limits is not None:
            lines += _limited_equations(
                element, left, ports[0].removeprefix("(").removesuffix(")"), names[element.limits.state]
            )
        else:
            port_names = [f"port{i}" for i in range(len(ports))]
            spelled = {q.symbol: placed.parameter(q.symbol) for q in placed.effect.parameters}
            spelled |= {port: f"={text}" for port, text in zip(port_names, ports, strict=True)}
            dry = element.has_exact_sign
            phi = traced(amplitude_of(element).law if dry else element.law, port_names)[0]
            text = spell(rename_symbols(phi, spelled), LATEX)
            if dry:  # at rest it is what keeps the mass there, up to its size at zero speed
                text = rf"-\operatorname{{sgn}}\left({ports[0]}\right)\,\left({text}\right)"
            lines.append(left + text)
    return "\\begin{align*}\n" + " \\\\\n".join(lines) + "\n\\end{align*}"


def _port_text(row: Iterable[float], names: list[str]) -> str:
    text = _latex_sum([(float(weight), name) for weight, name in zip(row, names, strict=True)])
    return text if "+" not in text and "-" not in text else rf"({text})"


def _limited_equations(element: Element, left: str, rate: str, state: str) -> list[str]:
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


def _output_equations(numeric: NumericModel) -> Iterable[str]:
    names = [latex_name(name) for name in numeric.system.state_names]
    for output in numeric.outputs:
        row = names[output.row] if output.row < numeric.n else rf"\dot{{{names[output.row - numeric.n]}}}"
        if output.differenced:
            row = rf"\frac{{{row}(t) - {row}(t - {latex_number(numeric.dt)})}}{{{latex_number(numeric.dt)}}}"
        yield rf"\text{{{escaped(output.name)}}} &= {row}"


def _parameter_rows(numeric: NumericModel) -> Iterable[str]:
    for name, declared in numeric.model.structure.parameters.items():
        part = numeric.model.parameters[name]
        half = "" if part.ci95 is None else rf" \pm {latex_number(0.5 * (part.ci95[1] - part.ci95[0]), 2)}"
        value = f"{latex_number(part.value)}{half}"
        yield rf"${latex_name(name)}$ & ${value}$ & {escaped(part.unit)} & {escaped(declared.about)} \\ % {name}"
    if np.isinf(numeric.settings.f_tanh):
        return
    unit, factor = numeric.model.units.of(PER_SPEED)
    gain = latex_number(numeric.settings.f_tanh * factor)
    yield rf"${latex_name('f_tanh')}$ & ${gain}$ & {escaped(unit)} & inverse of the width of the reversal \\"


def verify(folder: Path, numeric: NumericModel, run: VerificationRun) -> Verified:
    """Read the values back as they are printed, simulate with them, and set the page."""
    read = dict(_read_back((folder / _DOCUMENT_FILE).read_text(encoding="utf-8")))
    parameters = {
        name: part.model_copy(update={"value": read[name]}) for name, part in numeric.model.parameters.items()
    }
    again = numeric_model(numeric.model.model_copy(update={"parameters": parameters}), numeric.settings.f_tanh)
    y = native(replace(again, outputs=numeric.outputs), run.u, run.x0)
    by = "native simulation of the values as printed"
    try:
        run_program([program("pdflatex"), "-interaction=nonstopmode", "-halt-on-error", _DOCUMENT_FILE], folder)
    except MissingToolError as missing:
        return Verified(y, f"{by}; not set: {missing}")
    return Verified(y, f"{by}; set by pdflatex")


def _read_back(text: str) -> Iterable[tuple[str, float]]:
    for value, name in re.findall(r"^\$[^$]*\$ & \$([^$]*)\$ .* % (\S+)$", text, re.MULTILINE):
        mantissa, times, exponent = value.partition(r" \pm")[0].partition(r" \cdot 10^{")
        yield name, float(mantissa) * 10.0 ** (int(exponent.rstrip("}")) if times else 0)


EXPORTER = Exporter("LaTeX document: drawing, equations with values and units", 1e-3, files_of, verify)
