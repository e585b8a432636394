"""Laws as expressions: a declared law is called with symbols instead of numbers, and its operations are recorded.

A law may use ``+ - * /``, comparisons and :mod:`brightgrey.effects.arithmetic`; numpy hands all of these to the
symbol (``__array_ufunc__``, ``__array_function__``), so that a new effect can be exported without more code.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from brightgrey.effects import Law

__all__ = ["Expression", "constant", "rename_symbols", "symbol", "traced", "walk"]

_UFUNCS = {
    "add": "+",
    "subtract": "-",
    "multiply": "*",
    "divide": "/",
    "true_divide": "/",
    "negative": "neg",
    "tanh": "tanh",
    "exp": "exp",
    "sin": "sin",
    "cos": "cos",
    "absolute": "abs",
    "fabs": "abs",
    "maximum": "max",
    "minimum": "min",
    "greater_equal": ">=",
    "greater": ">",
    "less_equal": "<=",
    "less": "<",
    "equal": "==",
}
_NUMERIC: Mapping[str, Callable[..., float]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "neg": lambda a: -a,
    "tanh": lambda a: float(np.tanh(a)),
    "exp": lambda a: float(np.exp(a)),
    "sin": lambda a: float(np.sin(a)),
    "cos": lambda a: float(np.cos(a)),
    "abs": abs,
    "max": max,
    "min": min,
}


class Expression:
    """Operation of a law on its symbols, with its operands.

    Attributes
    ----------
    operation : str
        ``symbol``, ``constant``, an infix operator, or ``neg tanh exp sin cos abs max min where``.
    operands : tuple
        Expressions; the name of a symbol, the value of a constant.
    """

    __slots__ = ("operands", "operation")

    def __init__(self, operation: str, *operands: Any) -> None:
        self.operation = operation
        self.operands = operands

    @property
    def key(self) -> tuple[Any, ...]:
        """Equal for expressions that are written alike."""
        return (self.operation, *(o.key if isinstance(o, Expression) else o for o in self.operands))

    @property
    def value(self) -> float | None:
        """Number of a constant, else None."""
        return float(self.operands[0]) if self.operation == "constant" else None

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Expression:
        if ufunc.__name__ not in _UFUNCS or method != "__call__" or options:
            raise TypeError(f"a law uses numpy.{ufunc.__name__}: it cannot be exported")
        return _simplified(_UFUNCS[ufunc.__name__], *inputs)

    def __array_function__(self, func: Any, types: Any, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Expression:
        if func is np.where and len(args) == 3:
            return _simplified("where", *args)
        if func is np.zeros_like:
            return constant(0.0)
        if func is np.ones_like:
            return constant(1.0)
        raise TypeError(f"a law uses numpy.{func.__name__}: it cannot be exported")

    def __add__(self, other: Any) -> Expression:
        return _simplified("+", self, other)

    def __radd__(self, other: Any) -> Expression:
        return _simplified("+", other, self)

    def __sub__(self, other: Any) -> Expression:
        return _simplified("-", self, other)

    def __rsub__(self, other: Any) -> Expression:
        return _simplified("-", other, self)

    def __mul__(self, other: Any) -> Expression:
        return _simplified("*", self, other)

    def __rmul__(self, other: Any) -> Expression:
        return _simplified("*", other, self)

    def __truediv__(self, other: Any) -> Expression:
        return _simplified("/", self, other)

    def __rtruediv__(self, other: Any) -> Expression:
        return _simplified("/", other, self)

    def __neg__(self) -> Expression:
        return _simplified("neg", self)

    def __abs__(self) -> Expression:
        return _simplified("abs", self)

    def __pow__(self, power: int) -> Expression:
        if power not in (2, 3):
            raise TypeError(f"a law uses the power {power}: it cannot be exported")
        return self * self if power == 2 else self * self * self

    def __ge__(self, other: Any) -> Expression:
        return _simplified(">=", self, other)

    def __gt__(self, other: Any) -> Expression:
        return _simplified(">", self, other)

    def __le__(self, other: Any) -> Expression:
        return _simplified("<=", self, other)

    def __lt__(self, other: Any) -> Expression:
        return _simplified("<", self, other)

    def __eq__(self, other: object) -> Any:
        return _simplified("==", self, other)

    __hash__ = None  # type: ignore[assignment]

    def __bool__(self) -> bool:
        raise TypeError("a law decides by 'if': use numpy.where or brightgrey.effects.arithmetic, so that it exports")


def symbol(name: str) -> Expression:
    """Parameter or port."""
    return Expression("symbol", name)


def constant(value: float) -> Expression:
    """A number as an expression."""
    return Expression("constant", float(value))


def _simplified(operation: str, *operands: Any) -> Expression:
    """Expression in which numbers are computed, and sums and products with 0 and 1 are left out."""
    parts = [o if isinstance(o, Expression) else constant(o) for o in operands]
    numbers = [p.value for p in parts]
    if operation in _NUMERIC and None not in numbers:
        return constant(_NUMERIC[operation](*numbers))
    if operation in ("+", "-", "*", "/"):
        simple = _neutral_element(operation, parts, numbers)
        if simple is not None:
            return simple
    if operation in ("*", "/"):
        signs = [p.operation == "neg" for p in parts]
        if any(signs):  # -a b = -(a b), exactly so in floating-point numbers too
            product = _simplified(operation, *(p.operands[0] if n else p for p, n in zip(parts, signs, strict=True)))
            return product if all(signs) else _simplified("neg", product)
    if operation == "neg" and parts[0].operation == "neg":
        return parts[0].operands[0]  # type: ignore[no-any-return]
    if operation == "where" and parts[1].key == parts[2].key:
        return parts[1]
    return Expression(operation, *parts)


def _neutral_element(operation: str, parts: list[Expression], numbers: list[float | None]) -> Expression | None:
    """Value of an operation on 0 or 1, which needs no arithmetic; None if there is no such operand."""
    a, b = parts
    if operation == "*" and 0.0 in numbers:
        return constant(0.0)
    if operation == "/" and numbers[0] == 0.0:
        return a
    if numbers[1] == (0.0 if operation in "+-" else 1.0):
        return a
    if operation == "+" and numbers[0] == 0.0:
        return b
    if operation == "*" and numbers[0] == 1.0:
        return b
    if operation == "-" and numbers[0] == 0.0:
        return _simplified("neg", b)
    return None


def traced(law: Law, ports: Sequence[str]) -> tuple[Expression, tuple[Expression, ...]]:
    """Value of `law` and its slopes by each port, in symbols named by `ports` and the law's parameters.

    Raises
    ------
    TypeError
        If the law uses an operation that no expression has.
    """
    phi, slopes = law.value(tuple(map(symbol, ports)), tuple(map(symbol, law.parameters)))

    def lifted(part: Any) -> Expression:
        return part if isinstance(part, Expression) else constant(part)

    return lifted(phi), tuple(lifted(s) for s in slopes)


def walk(expression: Expression) -> list[Expression]:
    """All parts of an expression, operands before the operation on them."""
    below = [part for o in expression.operands if isinstance(o, Expression) for part in walk(o)]
    return [*below, expression]


def rename_symbols(e: Expression, names: Mapping[str, str]) -> Expression:
    """Expression with other names of its symbols; a symbol that `names` lacks keeps its own."""
    if e.operation == "symbol":
        return symbol(names.get(e.operands[0], e.operands[0]))
    return Expression(e.operation, *(rename_symbols(o, names) if isinstance(o, Expression) else o for o in e.operands))
