"""Export to Modelica: components of the standard library where effects declare them, else the equations."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from string import Template
from typing import Any, get_args

import numpy as np

from brightgrey.effects import Element, Stage
from brightgrey.exports.expressions.languages import MODELICA, number_literal, spell
from brightgrey.exports.expressions.trace import Expression, symbol, traced
from brightgrey.exports.external_tools import ExportError, import_library
from brightgrey.exports.numeric_model import NumericModel
from brightgrey.exports.registry import Exporter, Verified
from brightgrey.exports.targets.c99 import engine, filled, header_words
from brightgrey.exports.verification import VerificationRun
from brightgrey.kit.structure import Placed
from brightgrey.recordings.units.parser import parse_unit

__all__ = ["EXPORTER"]

FILE = "Drive.mo"
ROTATION = {"package": "Rotational", "q": "phi", "v": "w", "f": "tau", "Mass": "Inertia", "m": "J", "Force": "Torque"}
TRANSLATION = {"package": "Translational", "q": "s", "v": "v", "f": "f", "Mass": "Mass", "m": "m", "Force": "Force"}
_TOLERANCES = (1e-9, 1e-8, 1e-10, 1e-7, 1e-6)
_STAGES: tuple[str, ...] = get_args(Stage)


def files_of(scheme: NumericModel) -> dict[str, bytes]:
    """File ``Drive.mo``."""
    drawn = all(placed.effect.modelica for placed in scheme.model.structure.placed)
    return {FILE: (_drawn(scheme) if drawn else _equations(scheme)).encode()}


def _domain(scheme: NumericModel) -> dict[str, str]:
    words = ROTATION if parse_unit(scheme.model.units.motion).dimension == parse_unit("rad").dimension else TRANSLATION
    return {**words, "library": f"Modelica.Mechanics.{words['package']}"}


def _head(scheme: NumericModel) -> list[str]:
    """Parameters, starts and signals, all in SI."""
    lines = [
        f'parameter Real {_name(name)}{_unit(scheme, declared.dimension)} = {number_literal(value)} "{declared.about}";'
        for (name, declared), value in zip(
            scheme.model.structure.parameters.items(), scheme.model.values_si().values(), strict=True
        )
    ]
    lines.append(f'parameter Real f_tanh = {number_literal(scheme.settings.f_tanh)} "Gain that smooths reversals";')
    lines += [
        f'parameter Real start_{s.name}{_unit(scheme, s.dimension)} = 0 "State {s.name} at the begin";'
        for s in scheme.system.states
    ]
    lines.append('Modelica.Blocks.Interfaces.RealInput u "Input";')
    lines += [
        f'Modelica.Blocks.Interfaces.RealOutput y{i + 1} "{_kind(scheme, i)} of mass 1";'
        for i in range(len(scheme.outputs))
    ]
    return lines


def _kind(scheme: NumericModel, i: int) -> str:
    kind = scheme.outputs[i].kind
    return "position" if scheme.outputs[i].differenced else kind


def _name(name: str) -> str:
    return MODELICA.name(name)


def _physical(scheme: NumericModel) -> bool:
    """Whether the input is a torque or force, so that the components' units hold."""
    return scheme.units is not None and (scheme.units.input, scheme.units.motion) in (("N m", "rad"), ("N", "m"))


def _unit(scheme: NumericModel, dimension: Any) -> str:
    """Modelica's way to write the unit of a declaration."""
    if not _physical(scheme):
        return ""
    factors = parse_unit(scheme.unit(dimension)).factors
    text = ".".join(s if power == 1 else f"{s}{power}" for s, power in factors)
    return f'(unit = "{text or 1}")'


def _model(scheme: NumericModel, declarations: list[str], equations: list[str], before: str = "") -> str:
    words = header_words(scheme)
    body = "".join(f"  {line}\n" for line in [*_head(scheme), *declarations])
    rules = "".join(f"  {line};\n" for line in equations)
    said = f"{words['title']}, written by brightgrey {words['version']}. SI units throughout"
    if not _physical(scheme):
        said += f"; torque and force stand for the input in {scheme.model.input.unit}"
    return f'within ;\n{before}model Drive "{said}"\n{body}equation\n{rules}end Drive;\n'


def _drawn(scheme: NumericModel) -> str:
    """Model of components."""
    domain = _domain(scheme)
    components: dict[str, tuple[str, str]] = {}
    equations, models = [], []
    path = "u"
    last = sorted(scheme.model.structure.placed, key=lambda p: -_STAGES.index(p.effect.stage))
    for placed in scheme.model.structure.placed:
        said, words = placed.effect.modelica, _words(scheme, placed, domain)
        assert said is not None
        for kind, name, modifiers in said.components:
            components[_put(name, words)] = (_put(kind, words), _put(modifiers, words))
        equations += [_put(equation, words) for equation in said.equations]
        if said.instead:
            name, kind, more = (_put(text, words) for text in said.instead)
            components[name] = (kind, f"{components[name][1]}, {more}")
        if said.model:
            models.append(_put(said.model, words))
    for placed in last:  # what is stamped last is nearest to the input
        said, words = placed.effect.modelica, _words(scheme, placed, domain)
        if said and said.block:
            name = words["name"]
            components[name] = (_put(said.block[0], words), _put(said.block[1], words))
            equations.append(f"{name}.u = {path}")
            path = f"{name}.y"
    equations.append(f"motor.{domain['f']} = {path}")
    read = {"position": domain["q"], "velocity": domain["v"], "acceleration": "a"}
    equations += [f"y{i + 1} = mass1.{read[_kind(scheme, i)]}" for i in range(len(scheme.outputs))]
    declarations = [f"{kind} {name}{f'({more})' if more else ''};" for name, (kind, more) in components.items()]
    return _model(scheme, declarations, equations, "".join(f"{model}\n" for model in dict.fromkeys(models)))


def _words(scheme: NumericModel, placed: Placed, domain: Mapping[str, str]) -> dict[str, str]:
    """What the ``$`` words of a placed effect's drawing stand for."""
    words = {
        **domain,
        "place": str(placed.place),
        "next": str(placed.place + 1),
        "name": f"{placed.name}{placed.place}",
    }
    own = {q.symbol: _name(placed.parameter(q.symbol)) for q in placed.effect.parameters}
    said, law = placed.effect.modelica, placed.effect.law
    if law is not None and said is not None and said.port:
        phi = traced(law, (_put(said.port, words),))[0]
        words["law"] = spell(_renamed(phi, own), MODELICA)
    return words | own


def _renamed(e: Expression, names: Mapping[str, str]) -> Expression:
    if e.operation == "symbol":
        return symbol(names.get(e.operands[0], e.operands[0]))
    return Expression(e.operation, *(_renamed(o, names) if isinstance(o, Expression) else o for o in e.operands))


def _put(text: str, words: Mapping[str, str]) -> str:
    return Template(text).substitute(words)


def _equations(scheme: NumericModel) -> str:
    """Model of equations, for effects that declare no drawing."""
    low, names = scheme.low, scheme.system.state_names
    x = [f"x_{name}" for name in names]
    declarations = [f"Real {x_i}(start = start_{name}, fixed = true);" for x_i, name in zip(x, names, strict=True)]
    declarations += [f"Real F{i + 1};" for i in range(len(low.smooth))]
    declarations += [f"Real rate{b + 1};" for b in range(len(scheme.limited))]
    declarations.append('Real delayed "Input after the dead time";')
    whole, part = scheme.delay
    late = (whole + part) * scheme.dt
    equations = [f"delayed = delay(u, {number_literal(late)})" if late > 0.0 else "delayed = u"]
    terms = [[(low.A[i, j, 0], x[j]) for j in range(scheme.n)] for i in range(scheme.n)]
    for i, row in enumerate(terms):
        row += [(low.B[i, 0], "delayed"), (low.c[i, 0], "1")]
        row += [(low.G[k, i, 0], f"F{e + 1}") for e, (_, k) in enumerate(low.smooth)]
        row += [
            (float(np.asarray(element.G).reshape(-1)[i]), f"rate{b + 1}") for b, element in enumerate(scheme.limited)
        ]
        equations.append(f"der({x[i]}) = {_sum(row)}")
    for e, (element, k) in enumerate(low.smooth):
        port = _sum([*zip(low.H[k, :, 0], x, strict=True), (low.through[k, 0], "delayed")])
        equations.append(f"F{e + 1} = {_law(element, f'({port})')}")
    for b in range(len(scheme.limited)):
        state, low_end, high_end = scheme.limits(b)
        free = _sum(list(zip(scheme.rate(b), x, strict=True)))
        equations.append(
            f"rate{b + 1} = if {number_literal(high_end)} <= {number_literal(low_end)} then 0"
            f" elseif {x[state]} >= {number_literal(high_end)} and {free} > 0 then 0"
            f" elseif {x[state]} <= {number_literal(low_end)} and {free} < 0 then 0 else {free}"
        )
    equations += [
        f"y{i + 1} = {x[o.row] if o.row < scheme.n else f'der({x[o.row - scheme.n]})'}"
        for i, o in enumerate(scheme.outputs)
    ]
    return _model(scheme, declarations, equations)


def _law(element: Element, port: str) -> str:
    phi = traced(element.law, ("z",))[0]
    values = {n: number_literal(float(np.ravel(p)[0])) for n, p in zip(element.law.parameters, element.p, strict=True)}
    return spell(_renamed(phi, {**values, "z": port}), MODELICA)


def _sum(terms: list[tuple[float, str]]) -> str:
    return "(" + (" + ".join(f"({number_literal(w)}) * {name}" for w, name in terms if w != 0.0) or "0") + ")"


def verify(folder: Path, scheme: NumericModel, trial: VerificationRun) -> Verified:
    """Compile and simulate by rumoca, with the standard library on MODELICAPATH or a stand-in for the classes used."""
    rumoca = import_library("rumoca", "modelica")
    roots = [path for path in os.environ.get("MODELICAPATH", "").split(os.pathsep) if path]
    source = (folder / FILE).read_text(encoding="utf-8")
    text = (
        (_standin() if not roots else "within ;\n")
        + re.sub(r"^within ;\n", "", source)
        + _bench(scheme, trial, (0, 0.0) if roots else scheme.delay)
    )
    result = _simulated(rumoca, roots, text, scheme, (trial.u.size - 1) * scheme.dt)
    if isinstance(result, str):
        return Verified(None, f"compiled by rumoca, whose solver gave up ({result})")
    t = np.asarray(result.time)
    y = np.empty(trial.y.shape)
    wanted = np.arange(trial.u.size) * scheme.dt
    at = np.searchsorted(t, wanted + 1e-6 * scheme.dt) - 1  # behind an event, where there is one
    if np.abs(t[at] - wanted).max() > 1e-6 * scheme.dt:
        raise ExportError("rumoca gave no result at some of the samples")
    for i, output in enumerate(scheme.outputs):
        y[i] = np.asarray(result[f"drive.y{i + 1}"])[at]
        if output.differenced:
            speed = trial.x0[scheme.system.state_names.index(f"v{scheme.system.state_names[output.row][1:]}")]
            y[i] = np.diff(y[i], prepend=y[i, 0] - scheme.dt * speed) / scheme.dt
        y[i] *= output.factor
    where = "standard library" if roots else "a stand-in for the standard library"
    if not roots and sum(scheme.delay) > 0.0:
        where += ", dead time in its input"
    return Verified(y, f"Modelica by rumoca with {where}")


def _simulated(rumoca: Any, roots: list[str], text: str, scheme: NumericModel, end: float) -> Any:
    """Result of the bench, or why there is none: rumoca gives up where its steps disagree, seldom at all tolerances."""
    problem = ""
    try:
        model = rumoca.Session(roots=roots).loads(text, model="Bench")
    except rumoca.RumocaError as error:
        raise ExportError(f"rumoca refuses the model: {str(error).splitlines()[0]}") from None
    for rtol in _TOLERANCES:
        how = rumoca.SimConfig(rtol=rtol, atol=1e-2 * rtol * scheme.settings.speed_scale, solver="bdf")
        try:
            return model.simulate(t=(0.0, end), dt=scheme.dt, config=how)
        except rumoca.RumocaError as error:
            problem = str(error).splitlines()[0]
    return problem


def _standin() -> str:
    domains = "".join(filled(engine("standin_domain.mo"), words) for words in (ROTATION, TRANSLATION))
    return filled(engine("standin.mo"), {"domains": domains})


def _bench(scheme: NumericModel, trial: VerificationRun, late: tuple[int, float]) -> str:
    """Model that drives the exported one by the trial's input, `late` (whole samples, part of one) behind it."""
    starts = ", ".join(
        f"start_{name} = {number_literal(value)}"
        for name, value in zip(scheme.system.state_names, trial.x0, strict=True)
    )
    table = [
        number_literal(value * scheme.input_factor)
        for value in (*[trial.u[0]] * (late[0] + 1), *trial.u, trial.u[-1], trial.u[-1])
    ]
    return filled(
        engine("bench.mo"),
        {
            "starts": starts,
            "table": ", ".join(table),
            "size": str(len(table)),
            "dt": number_literal(scheme.dt),
            "part": number_literal(late[1]),
            "share": f"time / {number_literal(scheme.dt)} + {number_literal(1.0 - late[1])} - k"
            if scheme.hold == "linear"
            else "0",
        },
    )


EXPORTER = Exporter("Modelica model of standard components", 2e-4, files_of, verify)
