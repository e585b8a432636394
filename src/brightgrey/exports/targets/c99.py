"""Export to C99: a step function that needs no heap, no global state and no library but math.h."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Element
from brightgrey.exports.expressions.languages import C, law_statements, number_literal
from brightgrey.exports.external_tools import program, run_program
from brightgrey.exports.numeric_model import NumericModel, propagator_tables
from brightgrey.exports.registry import Exporter
from brightgrey.exports.source_text import NAME, fill_words, header_words, template
from brightgrey.exports.verification import VerificationRun, Verified

__all__ = ["EXPORTER", "sources"]

_CALL = "        law_{law}(z, &f, &d);\n        *force += f;\n        *slope += d;"
_DRY_CALL = """        law_{law}(speed, &f, &d);
        *force -= side * (f + d * (side * z - speed));
        *slope -= side * side * d;"""


def sources(numeric: NumericModel) -> dict[str, str]:
    """Text of ``drive.h`` and ``drive.c``."""
    laws = [_law_function(i, law.element) for i, law in enumerate(numeric.laws)]
    words = header_words(numeric) | {
        "n": str(numeric.n),
        "r": str(len(numeric.outputs)),
        "m1": str(max(numeric.m, 1)),
        "l1": str(max(len(numeric.limited), 1)),
        "buffer": str(numeric.delay[0] + 2),
        "laws": "\n\n".join(laws) or "/* none */",
        "dispatch": "\n".join(_case(numeric, k) for k in range(numeric.m)) or "    /* none */",
        "data": "\n".join([*_macros(numeric), "", *_tables(numeric)]),
    }
    code = template("engine.c").replace("@events@\n", template("events.c") + "\n")
    return {f"{NAME}.h": fill_words(template("engine.h"), words), f"{NAME}.c": fill_words(code, words)}


def _law_function(i: int, element: Element) -> str:
    """C function of a law, from the declared Python function."""
    lines = law_statements(element, C, "*force", "*slope")
    unused = [] if any(re.search(r"\bz\b", line) for line in lines) else ["(void)z;"]
    body = "\n".join(f"    {line}" for line in [*unused, *lines])
    return f"/* {element.name} */\nstatic void law_{i}(double z, double *force, double *slope)\n{{\n{body}\n}}"


def _case(numeric: NumericModel, k: int) -> str:
    """Case of the switch over the ports that calls the laws of port k."""
    calls = [_DRY_CALL if law.dry else _CALL for law in numeric.laws if law.port == k]
    numbers = [i for i, law in enumerate(numeric.laws) if law.port == k]
    lines = [call.format(law=i) for i, call in zip(numbers, calls, strict=True)]
    return "\n".join([f"    case {k}:", *lines, "        break;"])


def _macros(numeric: NumericModel) -> list[str]:
    """Sizes and scalars, one ``#define`` each. C has no empty arrays: M1 and L1 are sizes that are at least one."""
    whole, part = numeric.delay
    limits = len(numeric.limited)
    numbers = {
        "N": numeric.n,
        "M": numeric.m,
        "M1": max(numeric.m, 1),
        "L": limits,
        "L1": max(limits, 1),
        "R": len(numeric.outputs),
        "LEVELS": numeric.tolerance.ticks,
        "BASES": numeric.base_steps,
        "NEWTON": numeric.tolerance.newton,
        "WHOLE": whole,
        "BUFFER": whole + 2,
        "LINEAR": int(numeric.hold == "linear"),
        "SHIFT": number_literal(part),
        "DT": number_literal(numeric.dt),
        "ERROR": number_literal(numeric.step_error),
        "CHANGE": number_literal(numeric.step_change),
        "INPUT_FACTOR": number_literal(numeric.input_factor),
    }
    return [f"#define {name} {value}" for name, value in numbers.items()]


def _tables(numeric: NumericModel) -> list[str]:
    """All arrays of the model and of its step tables."""
    table = propagator_tables(numeric)
    ports = 2 * max(numeric.m, 1)
    coupling = table.coupling if numeric.m else np.zeros((*table.coupling.shape[:2], ports, ports))
    arrays = numeric.arrays() | {"E": table.end, "T": table.third, "S": coupling}
    return [_array({"c": "C0"}.get(name, name.upper()), array) for name, array in arrays.items()]


def _array(name: str, array: Array) -> str:
    """Definition of an array; zeros stand where it would be empty."""
    filled = array if array.size else np.zeros([max(length, 1) for length in array.shape], array.dtype)
    size = "".join(f"[{length}]" for length in filled.shape)
    kind = "double" if np.issubdtype(array.dtype, np.floating) else "int"
    return f"static const {kind} {name}{size} = {_braces(filled)};"


def _braces(array: Array) -> str:
    """Initialiser of an array."""
    if array.ndim == 1:
        floating = np.issubdtype(array.dtype, np.floating)
        return "{" + ", ".join(number_literal(v) if floating else str(int(v)) for v in array) + "}"
    return "{" + ",\n ".join(_braces(row) for row in array) + "}"


def files_of(numeric: NumericModel) -> dict[str, bytes]:
    """Files of the export."""
    return {name: text.encode() for name, text in sources(numeric).items()}


def verify(folder: Path, numeric: NumericModel, run: VerificationRun) -> Verified:
    """Compile with gcc, every warning an error, and run."""
    gcc = program("gcc")
    text = fill_words(template("run.c"), {"name": NAME, "NAME": NAME.upper()})
    (folder / "run.c").write_text(text, encoding="utf-8")
    flags = ("-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror")
    run_program([gcc, *flags, f"{NAME}.c", "run.c", "-o", "run", "-lm"], folder)
    numbers = " ".join(number_literal(value) for value in (*run.x0, *run.u))
    printed = run_program([folder / "run"], folder, f"{run.u.size} {numbers}\n")
    y = np.array([line.split() for line in printed.splitlines()], float).T
    return Verified(y, "gcc, compiled and run")


EXPORTER = Exporter("C99 step function with header, self-contained", 1e-6, files_of, verify)
