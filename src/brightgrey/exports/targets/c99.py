"""Export to C99: a step function that needs no heap, no global state and no library but math.h."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Element
from brightgrey.exports.expressions.languages import C, assignments, number_literal
from brightgrey.exports.expressions.trace import traced
from brightgrey.exports.external_tools import program, run_program
from brightgrey.exports.numeric_model import NumericModel, Tables, propagator_tables
from brightgrey.exports.registry import Exporter, Verified
from brightgrey.exports.verification import VerificationRun

__all__ = ["EXPORTER", "NAME", "engine", "filled", "header_words", "sources"]

NAME = "drive"


def engine(name: str) -> str:
    """Text of a file that is written by hand: the part of an export that no model changes."""
    return files("brightgrey.exports").joinpath("templates", name).read_text(encoding="utf-8")


def sources(scheme: NumericModel) -> dict[str, str]:
    """Text of ``drive.h`` and ``drive.c``."""
    words = header_words(scheme) | {
        "n": str(scheme.n),
        "r": str(len(scheme.outputs)),
        "m1": str(max(scheme.m, 1)),
        "l1": str(max(len(scheme.limited), 1)),
        "buffer": str(scheme.delay[0] + 2),
        "laws": "\n\n".join(_law(i, e) for i, (e, _) in enumerate(scheme.low.smooth)) or "/* none */",
        "dispatch": "\n".join(_case(scheme, k) for k in range(scheme.m)) or "    /* none */",
        "data": _data(scheme, propagator_tables(scheme)),
    }
    code = engine("engine.c").replace("@events@\n", engine("events.c") + "\n")
    return {f"{NAME}.h": filled(engine("engine.h"), words), f"{NAME}.c": filled(code, words)}


def header_words(scheme: NumericModel) -> dict[str, str]:
    """What every export says of its model."""
    return {
        "title": scheme.title,
        "version": scheme.model.version,
        "name": NAME,
        "NAME": NAME.upper(),
        "dt": number_literal(scheme.dt),
        "hold": "straight" if scheme.hold == "linear" else "held",
        "input": f"{scheme.model.input.name} [{scheme.model.input.unit}]",
        "outputs": ", ".join(f"{o.name} [{o.unit}]" for o in scheme.outputs),
        "states": ", ".join(f"{s.name} [{scheme.unit(s.dimension)}]" for s in scheme.system.states),
    }


def filled(text: str, words: dict[str, str]) -> str:
    """Put `words` where the text has ``@word@``."""
    for word, meaning in words.items():
        text = text.replace(f"@{word}@", meaning)
    return text


def _law(i: int, element: Element) -> str:
    """C function of a law, from the declared Python function."""
    phi, slopes = traced(element.law, ("z",))
    lines = assignments({"*force": phi, "*slope": slopes[0]}, C)
    values = [
        f"const double {name} = {number_literal(float(np.ravel(p)[0]))};"
        for name, p in zip(element.law.parameters, element.p, strict=True)
        if any(name in line for line in lines)
    ]
    body = "\n".join(f"    {line.rstrip(';')};" for line in [*values, *lines])
    return f"/* {element.name} */\nstatic void law_{i}(double z, double *force, double *slope)\n{{\n{body}\n}}"


def _case(scheme: NumericModel, k: int) -> str:
    calls = [
        f"        law_{i}(z, &f, &d);\n        *force += f;\n        *slope += d;"
        for i, (_, channel) in enumerate(scheme.low.smooth)
        if channel == k
    ]
    return "\n".join([f"    case {k}:", *calls, "        break;"])


def _data(scheme: NumericModel, table: Tables) -> str:
    low, tol = scheme.low, scheme.tolerance
    n, m, limits = scheme.n, scheme.m, len(scheme.limited)
    whole, part = scheme.delay
    m1, l1 = max(m, 1), max(limits, 1)
    scale = scheme.settings.speed_scale
    rest = [float(state.at_rest == "input") for state in scheme.system.states]
    ends = [scheme.limits(b) for b in range(limits)]
    gain = np.abs(low.G[:, :, 0]).max(axis=1, initial=0.0)
    defines = {
        "N": n,
        "M": m,
        "M1": m1,
        "L": limits,
        "L1": l1,
        "R": len(scheme.outputs),
        "LEVELS": tol.ticks,
        "BASES": scheme.base_steps,
        "NEWTON": tol.newton,
        "WHOLE": whole,
        "BUFFER": whole + 2,
        "LINEAR": int(scheme.hold == "linear"),
    }
    reals = {
        "SHIFT": part,
        "DT": scheme.dt,
        "ERROR": tol.error * scale,
        "CHANGE": tol.change * scale,
        "INPUT_FACTOR": scheme.input_factor,
    }
    rates = [scheme.rate(b) for b in range(limits)]
    columns = [np.asarray(e.G).reshape(-1) for e in scheme.limited]
    lines = [f"#define {name} {value}" for name, value in defines.items()]
    lines += [f"#define {name} {number_literal(value)}" for name, value in reals.items()]
    lines += [
        "",
        _array("A", low.A[:, :, 0]),
        _array("B", low.B[:, 0]),
        _array("C0", low.c[:, 0]),
        _array("G", _at_least_one(low.G[:, :, 0], (m1, n))),
        _array("H", _at_least_one(low.H[:, :, 0], (m1, n))),
        _array("K", _at_least_one(low.through[:, 0], (m1,))),
        _array("GAIN", _at_least_one(gain, (m1,))),
        _array("RATE", _at_least_one(np.array(rates), (l1, n))),
        _array("COLUMN", _at_least_one(np.array(columns), (l1, n))),
        _array("LOW", _at_least_one(np.array([e[1] for e in ends]), (l1,))),
        _array("HIGH", _at_least_one(np.array([e[2] for e in ends]), (l1,))),
        _whole("LIMITED", [e[0] for e in ends] or [0]),
        _array("REST", np.array(rest)),
        _whole("ROW", [o.row for o in scheme.outputs]),
        _whole("DIFFERENCED", [int(o.differenced) for o in scheme.outputs]),
        _array("OUTPUT_FACTOR", np.array([o.factor for o in scheme.outputs])),
        _array("E", table.end),
        _array("T", table.third),
        _array("S", _at_least_one(table.coupling, (*table.coupling.shape[:2], 2 * m1, 2 * m1))),
    ]
    return "\n".join(lines)


def _at_least_one(array: Array, shape: tuple[int, ...]) -> Array:
    """C has no empty arrays: zeros where there is nothing."""
    return array if array.size else np.zeros(shape)


def _array(name: str, array: Array) -> str:
    size = "".join(f"[{length}]" for length in array.shape)
    return f"static const double {name}{size} = {_braces(array)};"


def _braces(array: Array) -> str:
    if array.ndim == 1:
        return "{" + ", ".join(number_literal(value) for value in array) + "}"
    return "{" + ",\n ".join(_braces(row) for row in array) + "}"


def _whole(name: str, values: list[int]) -> str:
    return f"static const int {name}[{len(values)}] = {{{', '.join(map(str, values))}}};"


def files_of(scheme: NumericModel) -> dict[str, bytes]:
    """Files of the export."""
    return {name: text.encode() for name, text in sources(scheme).items()}


def verify(folder: Path, scheme: NumericModel, trial: VerificationRun) -> Verified:
    """Compile with gcc, every warning an error, and run."""
    gcc = program("gcc")
    text = filled(engine("run.c"), {"name": NAME, "NAME": NAME.upper()})
    (folder / "run.c").write_text(text, encoding="utf-8")
    flags = ("-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror")
    run_program([gcc, *flags, f"{NAME}.c", "run.c", "-o", "run", "-lm"], folder)
    numbers = " ".join(number_literal(value) for value in (*trial.x0, *trial.u))
    printed = run_program([folder / "run"], folder, f"{trial.u.size} {numbers}\n")
    y = np.array([line.split() for line in printed.splitlines()], float).T
    return Verified(y, "gcc, compiled and run")


EXPORTER = Exporter("C99 step function with header, self-contained", 1e-6, files_of, verify)
