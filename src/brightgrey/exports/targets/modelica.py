"""Export to Modelica: components of the standard library where effects declare them, else the equations."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from string import Template
from typing import Any, get_args

import numpy as np

from brightgrey.effects import Stage
from brightgrey.exports.expressions.languages import MODELICA, number_literal, parameter_literals, spell
from brightgrey.exports.expressions.trace import rename_symbols, traced
from brightgrey.exports.external_tools import ExportError, import_library
from brightgrey.exports.numeric_model import NumericModel
from brightgrey.exports.registry import Exporter
from brightgrey.exports.source_text import fill_words, header_words, template
from brightgrey.exports.verification import VerificationRun, Verified
from brightgrey.kit.structure import Placed
from brightgrey.recordings.units.parser import parse_unit

__all__ = ["EXPORTER", "component_model", "equation_model"]

_MODEL_FILE = "Drive.mo"
ROTATION = {"package": "Rotational", "q": "phi", "v": "w", "f": "tau", "Mass": "Inertia", "m": "J", "Force": "Torque"}
TRANSLATION = {"package": "Translational", "q": "s", "v": "v", "f": "f", "Mass": "Mass", "m": "m", "Force": "Force"}
_TOLERANCES = (1e-9, 1e-8, 1e-10, 1e-7, 1e-6)  # relative, in the order in which the solver is tried with them
_STAGES: tuple[str, ...] = get_args(Stage)


def files_of(numeric: NumericModel) -> dict[str, bytes]:
    """File ``Drive.mo``; dry friction needs equations, because it knows what keeps its mass at rest."""
    drawn = not numeric.low.dry and all(placed.effect.modelica for placed in numeric.model.structure.placed)
    return {_MODEL_FILE: (component_model(numeric) if drawn else equation_model(numeric)).encode()}


def _domain(numeric: NumericModel) -> dict[str, str]:
    """Words of rotational or of translational mechanics."""
    rotates = parse_unit(numeric.model.units.motion).dimension == parse_unit("rad").dimension
    words = ROTATION if rotates else TRANSLATION
    return {**words, "library": f"Modelica.Mechanics.{words['package']}"}


def _interface(numeric: NumericModel) -> list[str]:
    """Declarations of parameters, initial states and signals, all in SI."""
    values = numeric.model.values_si()
    lines = []
    for name, declared in numeric.model.structure.parameters.items():
        typed = f"{MODELICA.name(name)}{_unit_attribute(numeric, declared.dimension)}"
        lines.append(f'parameter Real {typed} = {number_literal(values[name])} "{declared.about}";')
    if not numeric.low.dry:
        gain = number_literal(numeric.settings.f_tanh)
        lines.append(f'parameter Real f_tanh = {gain} "Gain that smooths reversals";')
    lines += [
        f'parameter Real start_{s.name}{_unit_attribute(numeric, s.dimension)} = 0 "State {s.name} at the begin";'
        for s in numeric.system.states
    ]
    lines.append('Modelica.Blocks.Interfaces.RealInput u "Input";')
    lines += [
        f'Modelica.Blocks.Interfaces.RealOutput y{i + 1} "{_kind(numeric, i)} of mass {numeric.outputs[i].mass}";'
        for i in range(len(numeric.outputs))
    ]
    return lines


def _kind(numeric: NumericModel, i: int) -> str:
    kind = numeric.outputs[i].kind
    return "position" if numeric.outputs[i].differenced else kind


def _has_mechanical_units(numeric: NumericModel) -> bool:
    """True if the input is a torque or force, so that the units of the components hold."""
    return numeric.units is not None and (numeric.units.input, numeric.units.motion) in (("N m", "rad"), ("N", "m"))


def _unit_attribute(numeric: NumericModel, dimension: Any) -> str:
    """Attribute that declares the unit of a Modelica variable; empty where the components' units do not hold."""
    if not _has_mechanical_units(numeric):
        return ""
    factors = parse_unit(numeric.unit(dimension)).factors
    text = ".".join(s if power == 1 else f"{s}{power}" for s, power in factors)
    return f'(unit = "{text or 1}")'


def _model(numeric: NumericModel, declarations: list[str], equations: list[str], before: str = "") -> str:
    """Text of the Modelica file."""
    words = header_words(numeric)
    body = "".join(f"  {line}\n" for line in [*_interface(numeric), *declarations])
    rules = "".join(f"  {line};\n" for line in equations)
    about = f"{words['title']}, written by brightgrey {words['version']}. SI units throughout"
    if not _has_mechanical_units(numeric):
        about += f"; torque and force stand for the input in {numeric.model.input.unit}"
    return f'within ;\n{before}model Drive "{about}"\n{body}equation\n{rules}end Drive;\n'


def component_model(numeric: NumericModel) -> str:
    """Modelica text of a model of standard components; every effect has to declare its drawing."""
    domain = _domain(numeric)
    placed_effects = numeric.model.structure.placed
    components: dict[str, tuple[str, str]] = {}
    equations, models = [], []
    for placed in placed_effects:
        drawing, words = placed.effect.modelica, _drawing_words(numeric, placed, domain)
        assert drawing is not None
        for kind, name, modifiers in drawing.components:
            components[_substitute(name, words)] = (_substitute(kind, words), _substitute(modifiers, words))
        equations += [_substitute(equation, words) for equation in drawing.equations]
        if drawing.instead:
            name, kind, more = (_substitute(text, words) for text in drawing.instead)
            components[name] = (kind, f"{components[name][1]}, {more}")
        if drawing.model:
            models.append(_substitute(drawing.model, words))
    path = "u"
    for placed in sorted(placed_effects, key=lambda p: -_STAGES.index(p.effect.stage)):  # the last stage is the input's
        drawing, words = placed.effect.modelica, _drawing_words(numeric, placed, domain)
        if drawing and drawing.block:
            name = words["name"]
            components[name] = (_substitute(drawing.block[0], words), _substitute(drawing.block[1], words))
            equations.append(f"{name}.u = {path}")
            path = f"{name}.y"
    equations.append(f"connect(motor.flange, mass{numeric.model.input.mass}.flange_a)")
    equations.append(f"motor.{domain['f']} = {path}")
    read = {"position": domain["q"], "velocity": domain["v"], "acceleration": "a"}
    equations += [
        f"y{i + 1} = mass{numeric.outputs[i].mass}.{read[_kind(numeric, i)]}" for i in range(len(numeric.outputs))
    ]
    declarations = [f"{kind} {name}{f'({more})' if more else ''};" for name, (kind, more) in components.items()]
    return _model(numeric, declarations, equations, "".join(f"{model}\n" for model in dict.fromkeys(models)))


def _drawing_words(numeric: NumericModel, placed: Placed, domain: Mapping[str, str]) -> dict[str, str]:
    """Meaning of the ``$`` words in the drawing of a placed effect."""
    words = {
        **domain,
        "place": str(placed.place),
        "next": str(placed.place + 1),
        "name": f"{placed.name}{placed.place}",
    }
    own = {q.symbol: MODELICA.name(placed.parameter(q.symbol)) for q in placed.effect.parameters}
    drawing, law = placed.effect.modelica, placed.effect.law
    if law is not None and drawing is not None and drawing.port:
        phi = traced(law, (_substitute(drawing.port, words),))[0]
        words["law"] = spell(rename_symbols(phi, own), MODELICA)
    return words | own


def _substitute(text: str, words: Mapping[str, str]) -> str:
    return Template(text).substitute(words)


def equation_model(numeric: NumericModel) -> str:
    """Modelica text of a model of equations, for structures with an effect that declares no drawing."""
    low, names = numeric.low, numeric.system.state_names
    x = [f"x_{name}" for name in names]
    limited = range(len(numeric.limited))
    declarations = [f"Real {x_i}(start = start_{name}, fixed = true);" for x_i, name in zip(x, names, strict=True)]
    declarations += [f"Real F{i + 1};" for i, law in enumerate(numeric.laws) if not law.dry]
    stops = [k for k in range(numeric.m) if low.stopped[k] >= 0]
    for k in stops:
        declarations += _dry_declarations(numeric, k, names[low.stopped[k]])
    declarations += [f"Real rate{b + 1};" for b in limited]
    declarations.append('Real delayed "Input after the dead time";')
    late, equations = sum(numeric.delay) * numeric.dt, ["delayed = u"]
    if late > 0.0:
        declarations.append(f"Modelica.Blocks.Nonlinear.FixedDelay dead_time(delayTime = {number_literal(late)});")
        equations = ["dead_time.u = u", "delayed = dead_time.y"]
    for i in range(numeric.n):
        row = [*zip(low.A[i, :, 0], x, strict=True), (low.B[i, 0], "delayed"), (low.c[i, 0], "1")]
        row += [(low.G[law.port, i, 0], f"F{e + 1}") for e, law in enumerate(numeric.laws) if not law.dry]
        row += [(numeric.column(b)[i], f"rate{b + 1}") for b in limited]
        own = [k for k in stops if low.stopped[k] == i]
        equations += [f"needed{k + 1} = -{_modelica_sum(row)} / ({number_literal(low.G[k, i, 0])})" for k in own]
        row += [(low.G[k, i, 0], f"friction{k + 1}") for k in stops]
        still = "".join(f"if side{k + 1} == 0 then 0 else " for k in own)
        equations.append(f"der({x[i]}) = {still}{_modelica_sum(row)}")
    for k in stops:
        equations += _dry_equations(numeric, k, x[low.stopped[k]])
    for e, (element, k, dry) in enumerate(numeric.laws):
        if dry:
            continue
        port = _modelica_sum([*zip(low.H[k, :, 0], x, strict=True), (low.through[k, 0], "delayed")])
        phi = traced(element.law, ("z",))[0]
        named = rename_symbols(phi, {**parameter_literals(element), "z": f"({port})"})
        equations.append(f"F{e + 1} = {spell(named, MODELICA)}")
    equations += [f"rate{b + 1} = {_saturated_rate(numeric, b, x)}" for b in limited]
    equations += [
        f"y{i + 1} = {x[o.row] if o.row < numeric.n else f'der({x[o.row - numeric.n]})'}"
        for i, o in enumerate(numeric.outputs)
    ]
    return _model(numeric, declarations, equations)


def _dry_size(numeric: NumericModel, k: int, speed: str) -> str:
    """Size of the dry friction at port k for a speed >= 0."""
    sizes = [
        spell(
            rename_symbols(traced(law.element.law, ("z",))[0], {**parameter_literals(law.element), "z": speed}),
            MODELICA,
        )
        for law in numeric.laws
        if law.dry and law.port == k
    ]
    return f"({' + '.join(sizes)})"


def _dry_declarations(numeric: NumericModel, k: int, speed: str) -> list[str]:
    number, start = k + 1, f"start_{speed}"
    return [
        f'parameter Real most{number} = {_dry_size(numeric, k, "0")} "Breakaway torque";',
        f'Real needed{number} "Friction that keeps the mass at rest";',
        f"Real friction{number};",
        f"discrete Integer side{number}(start = if {start} > 0 then 1 elseif {start} < 0 then -1 else 0, fixed = true)"
        ' "1 or -1 where the mass slides, 0 where it sticks";',
    ]


def _dry_equations(numeric: NumericModel, k: int, speed: str) -> list[str]:
    """Friction of port k, and the events at which its mass stops or breaks away."""
    side, needed, most = f"side{k + 1}", f"needed{k + 1}", f"most{k + 1}"
    sliding = _dry_size(numeric, k, f"max({side} * {speed}, 0)")
    yields = f"if {needed} > {most} then -1 elseif {needed} < -{most} then 1 else 0"
    return [
        f"friction{k + 1} = if {side} == 0 then {needed} else -{side} * {sliding}",
        f"when pre({side}) * {speed} < 0 then\n    {side} = {yields};\n    reinit({speed}, 0);\n"
        f"  elsewhen {{initial(), pre({side}) == 0 and abs({needed}) > {most}}} then\n"
        f"    {side} = if pre({side}) <> 0 then pre({side}) else{yields};\n  end when",
    ]


def _saturated_rate(numeric: NumericModel, b: int, x: list[str]) -> str:
    """Rate of limited state b: its free rate, and zero where it would leave its limits."""
    state, lower, upper = numeric.limits(b)
    free = _modelica_sum(list(zip(numeric.rate(b), x, strict=True)))
    low, high = number_literal(lower), number_literal(upper)
    return (
        f"if {high} <= {low} then 0 elseif {x[state]} >= {high} and {free} > 0 then 0"
        f" elseif {x[state]} <= {low} and {free} < 0 then 0 else {free}"
    )


def _modelica_sum(terms: list[tuple[float, str]]) -> str:
    return "(" + (" + ".join(f"({number_literal(w)}) * {name}" for w, name in terms if w != 0.0) or "0") + ")"


def verify(folder: Path, numeric: NumericModel, run: VerificationRun) -> Verified:
    """Compile and simulate by rumoca, with the standard library on MODELICAPATH or a stand-in for the classes used."""
    rumoca = import_library("rumoca", "modelica")
    roots = [path for path in os.environ.get("MODELICAPATH", "").split(os.pathsep) if path]
    source = (folder / _MODEL_FILE).read_text(encoding="utf-8")
    text = (
        (_library_stand_in() if not roots else "within ;\n")
        + re.sub(r"^within ;\n", "", source)
        + _test_bench(numeric, run, (0, 0.0) if roots else numeric.delay)
    )
    result = _solve_by_rumoca(rumoca, roots, text, numeric, (run.u.size - 1) * numeric.dt)
    if isinstance(result, str):
        return Verified(None, f"compiled by rumoca, whose solver gave up ({result})")
    t = np.asarray(result.time)
    wanted = np.arange(run.u.size) * numeric.dt
    at = np.searchsorted(t, wanted + 1e-6 * numeric.dt) - 1  # behind an event, where there is one
    if np.abs(t[at] - wanted).max() > 1e-6 * numeric.dt:
        raise ExportError("rumoca gave no result at some of the samples")
    y = [np.asarray(result[f"drive.y{i + 1}"])[at] for i in range(len(numeric.outputs))]
    where = "standard library" if roots else "a stand-in for the standard library"
    if not roots and sum(numeric.delay) > 0.0:
        where += ", dead time in its input"
    return Verified(numeric.shown(np.array(y), run.x0), f"Modelica by rumoca with {where}")


def _solve_by_rumoca(rumoca: Any, roots: list[str], text: str, numeric: NumericModel, end: float) -> Any:
    """Result of the test bench; the complaint of rumoca's solver if it gives up at all tolerances.

    It gives up where its steps disagree, seldom at all of them.
    """
    problem = ""
    try:
        model = rumoca.Session(roots=roots).loads(text, model="Bench")
    except rumoca.RumocaError as error:
        raise ExportError(f"rumoca refuses the model: {str(error).splitlines()[0]}") from None
    for rtol in _TOLERANCES:
        how = rumoca.SimConfig(rtol=rtol, atol=1e-2 * rtol * numeric.settings.speed_scale, solver="bdf")
        try:
            return model.simulate(t=(0.0, end), dt=numeric.dt, config=how)
        except rumoca.RumocaError as error:
            problem = str(error).splitlines()[0]
    return problem


def _library_stand_in() -> str:
    domains = "".join(fill_words(template("standin_domain.mo"), words) for words in (ROTATION, TRANSLATION))
    return fill_words(template("standin.mo"), {"domains": domains})


def _test_bench(numeric: NumericModel, run: VerificationRun, late: tuple[int, float]) -> str:
    """Model that drives the exported one by the input of the run, `late` by whole samples and a part of one."""
    starts = ", ".join(
        f"start_{name} = {number_literal(value)}"
        for name, value in zip(numeric.system.state_names, run.x0, strict=True)
    )
    table = [
        number_literal(value * numeric.input_factor)
        for value in (*[run.u[0]] * (late[0] + 1), *run.u, run.u[-1], run.u[-1])
    ]
    return fill_words(
        template("bench.mo"),
        {
            "starts": starts,
            "table": ", ".join(table),
            "size": str(len(table)),
            "dt": number_literal(numeric.dt),
            "part": number_literal(late[1]),
            "share": f"time / {number_literal(numeric.dt)} + {number_literal(1.0 - late[1])} - k"
            if numeric.hold == "linear"
            else "0",
        },
    )


EXPORTER = Exporter("Modelica model of standard components", 2e-4, files_of, verify)
