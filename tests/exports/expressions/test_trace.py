"""Laws written in other languages: each says what the declared Python function says."""

import shutil
import subprocess

import numpy as np
import pytest

from brightgrey.effects import Law, friction_law, registry
from brightgrey.effects.arithmetic import exp, magnitude, positive_part, sign, tanh
from brightgrey.exports.expressions.languages import LATEX, PYTHON, C, assignments, latex_name, number_literal, spell
from brightgrey.exports.expressions.trace import constant, symbol, traced

LAWS = {name: effect.law for name, effect in registry().items() if effect.law is not None}
PORTS = ("z", "z2")


def hardening(z, p):
    """A law that the kit does not have."""
    stiffer = p[0] * z[0] * z[0] * z[0]
    return -stiffer - p[1] * positive_part(z[0]), (-3.0 * p[0] * z[0] ** 2 - p[1] * (0.5 + 0.5 * sign(z[0])),)


NEW = Law(("k", "one_sided"), hardening)


@pytest.mark.parametrize(("name", "law"), [*LAWS.items(), ("new", NEW)])
def test_traced_law__written_in_python__gives_the_numbers_of_the_law(name, law):
    rng = np.random.default_rng(3)
    phi, slopes = traced(law, PORTS[: law.ports])
    lines = assignments({"phi": phi, **{f"slope{i}": s for i, s in enumerate(slopes)}}, PYTHON)
    for _ in range(200):
        p = rng.uniform(0.1, 3.0, len(law.parameters))
        z = rng.choice([-1.0, 0.0, 1.0], law.ports) * rng.uniform(0.0, 2.0, law.ports)
        names = dict(zip((*law.parameters, *PORTS), (*p, *z), strict=False)) | {"np": np}
        exec("\n".join(lines), names)
        value, gradients = law.value(tuple(z), tuple(p))
        assert names["phi"] == pytest.approx(float(value), rel=1e-14, abs=1e-300)
        for i, gradient in enumerate(gradients):
            assert names[f"slope{i}"] == pytest.approx(float(gradient), rel=1e-14, abs=1e-300)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_traced_law__unknown_to_the_kit__compiles_in_c(tmp_path):
    def amplitude(v, p):
        a = p[0] * exp(-magnitude(v)) + p[1]
        return a, -p[0] * exp(-magnitude(v)) * sign(v)

    law = friction_law(("M", "N"), amplitude)
    lines = assignments({"*f": traced(law, ("z",))[0]}, C)
    body = "".join(f"{line.rstrip(';')};" for line in lines)
    (tmp_path / "law.c").write_text(
        "#include <math.h>\n#include <stdio.h>\nstatic void law(double z, double M, double N, double f_tanh, double *f)"
        f'{{{body}}}\nint main(void){{double f; law(-0.7, 1.5, 0.4, 3.0, &f); printf("%.17g", f);}}\n'
    )
    subprocess.run(["gcc", "-std=c99", "-Werror", "law.c", "-o", "law", "-lm"], cwd=tmp_path, check=True)
    printed = subprocess.run([tmp_path / "law"], capture_output=True, text=True, check=True).stdout
    assert float(printed) == pytest.approx(float(law.value((-0.7,), (1.5, 0.4, 3.0))[0]), rel=1e-14)


def test_traced_law__operation_without_an_expression__is_refused():
    def decides(z, p):
        return (p[0] if z[0] > 0.0 else -p[0]), (0.0,)

    with pytest.raises(TypeError, match="'if'"):
        traced(Law(("a",), decides, lambda z, p: (1.0,)), ("z",))
    with pytest.raises(TypeError, match=r"numpy\.arctan"):
        traced(Law(("a",), lambda z, p: (np.arctan(z[0]), (0.0,)), lambda z, p: (1.0,)), ("z",))
    with pytest.raises(TypeError, match="power"):
        traced(Law(("a",), lambda z, p: (z[0] ** 0.5, (0.0,)), lambda z, p: (1.0,)), ("z",))


def test_spell__nested_operators__keeps_the_needed_brackets():
    a, b, c = map(symbol, "abc")
    for expression, text in (
        (a - (b - c), "a - (b - c)"),
        (a - b - c, "a - b - c"),
        (a / (b * c), "a / (b * c)"),
        (a * b / c, "a * b / c"),
        ((a + b) * c, "(a + b) * c"),
        (-(a + b), "-(a + b)"),
        (-a * b, "-(a * b)"),
        (a * -2.0, "a * (-2.0)"),
        (2.0 * constant(3.0) + 0.0 * a, "6.0"),
    ):
        assert eval(spell(expression, C), {"a": 2.0, "b": 5.0, "c": 7.0}) == eval(text, {"a": 2.0, "b": 5.0, "c": 7.0})
        assert spell(expression, C).count("(") <= text.count("(")
    assert spell(tanh(a) / (b + c), LATEX) == r"\frac{\tanh\left(a\right)}{b + c}"


def test_names_and_numbers__are_spelled_for_latex_and_read_back():
    wanted = {
        "omega_S": r"\omega_{S}",
        "J1": "J_{1}",
        "M_C@2": "M_{C,2}",
        "alpha": r"\alpha",
        "lambda1": r"\lambda_{1}",
    }
    assert {name: latex_name(name) for name in wanted} == wanted
    rng = np.random.default_rng(1)
    for value in [0.0, 1.0, -1e-300, *rng.normal(size=100)]:
        assert float(number_literal(value)) == value
