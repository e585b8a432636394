"""Vector registers: a type for numba that holds one number per lane, and access to tables with it.

Compiled functions get the addresses of tables. For arrays, numba would count references at every call, which costs
more than the arithmetic.

The kernel is written once. Its functions take ``who``: ``None`` works on all lanes of a vector register at once, an
integer works on that lane alone with plain floats. Tables are two-dimensional, with one row per quantity and one column
per lane. numba compiles each function for both kinds by the types of its arguments.

Vectorisation does not rely on the compiler. Every operation is one LLVM instruction on ``<LANES x double>``, which LLVM
maps to the registers of the processor. Multiplications and additions may be contracted to one rounding, but nothing is
reordered, so that a lane never depends on its neighbours.
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import extending
from numba.core import types
from numba.extending import models, overload, register_model

__all__ = [
    "LANES",
    "call",
    "choose_lanes",
    "choose_less",
    "get",
    "group",
    "lanes_not_less",
    "put",
    "real",
    "set_whole",
    "skip",
    "splat",
    "store",
    "whole",
]

# numba declares these by their Python signature, which differs from the one that compiled code sees.
intrinsic: Any = extending.intrinsic
register_jitable: Any = extending.register_jitable

LANES = 16
"""Parameter sets side by side: two registers of 512 bits, of which one computes while the other waits. This measured a
quarter faster than 8 lanes. Narrower processors take more instructions."""

DOUBLE = ir.DoubleType()
VECTOR = ir.VectorType(DOUBLE, LANES)
WORD = ir.IntType(64)
_CONTRACT = ("contract",)


class LaneVector(types.Type):
    """numba type of LANES doubles in a register."""

    def __init__(self) -> None:
        super().__init__(name=f"lanes{LANES}")


lanes: Any = LaneVector()


@register_model(LaneVector)
class _LanesModel(models.PrimitiveModel):
    """Data model: a register is an LLVM vector."""

    def __init__(self, manager: Any, fe_type: Any) -> None:
        super().__init__(manager, fe_type, VECTOR)  # type: ignore[no-untyped-call]


def _is_number(kind: Any) -> bool:
    return bool(kind == lanes or isinstance(kind, types.Float | types.Integer))


def _broadcast(builder: Any, value: Any) -> Any:
    """Copy a double to all lanes."""
    first = ir.Constant(ir.IntType(32), 0)
    undefined = ir.Constant(VECTOR, ir.Undefined)
    lane0 = builder.insert_element(undefined, value, first)
    return builder.shuffle_vector(lane0, undefined, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))


def _as_lanes(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if kind == lanes:
        return value
    return _broadcast(builder, context.cast(builder, value, kind, types.float64))


def _binary(instruction: str) -> Any:
    @intrinsic
    def operation(typing: Any, a: Any, b: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            pair = [_as_lanes(context, builder, k, v) for k, v in zip(signature.args, args, strict=True)]
            return getattr(builder, instruction)(*pair, flags=_CONTRACT)

        return lanes(a, b), generate

    def offer(a: Any, b: Any) -> Any:
        if lanes in (a, b) and _is_number(a) and _is_number(b):
            return lambda a, b: operation(a, b)
        return None

    return offer


for _operator, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    overload(_operator, strict=False)(_binary(_instruction))


@overload(operator.neg, strict=False)
def _negative(a: Any) -> Any:
    if a == lanes:
        return lambda a: 0.0 - a
    return None


def _address(builder: Any, table: Any, row: Any, lane: Any) -> Any:
    """Address of one entry of a C-contiguous table with LANES columns."""
    flat = builder.mul(row, ir.Constant(row.type, LANES))
    pointer = builder.inttoptr(table, DOUBLE.as_pointer())
    return builder.gep(pointer, [flat if lane is None else builder.add(flat, lane)])


@intrinsic
def get(typing: Any, table: Any, row: Any, who: Any) -> Any:
    """``get(table, row, who)``: all lanes of a row as a register, or the float of one lane."""
    one = isinstance(who, types.Integer)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        lane = context.cast(builder, args[2], signature.args[2], types.intp) if one else None
        index = context.cast(builder, args[1], signature.args[1], types.intp)
        address = _address(builder, args[0], index, lane)
        if one:
            return builder.load(address)
        return builder.load(builder.bitcast(address, VECTOR.as_pointer()), align=8)

    return (types.float64 if one else lanes)(table, row, who), generate


@intrinsic
def put(typing: Any, table: Any, row: Any, who: Any, value: Any) -> Any:
    """``put(table, row, who, value)``: write a register to a row, or a float to one lane of it."""
    one = isinstance(who, types.Integer)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        lane = context.cast(builder, args[2], signature.args[2], types.intp) if one else None
        index = context.cast(builder, args[1], signature.args[1], types.intp)
        address = _address(builder, args[0], index, lane)
        if one:
            builder.store(context.cast(builder, args[3], signature.args[3], types.float64), address)
        else:
            register = _as_lanes(context, builder, signature.args[3], args[3])
            builder.store(register, builder.bitcast(address, VECTOR.as_pointer()), align=8)
        return context.get_dummy_value()

    return types.void(table, row, who, value), generate


def _entry(kind: Any) -> Any:
    @intrinsic
    def load(typing: Any, table: Any, index: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            i = context.cast(builder, args[1], signature.args[1], types.intp)
            pointer = builder.inttoptr(args[0], context.get_value_type(kind).as_pointer())
            return builder.load(builder.gep(pointer, [i]))

        return kind(table, index), generate

    return load


whole = _entry(types.int64)
"""``whole(address, i)``: entry i of a flat array of int64."""

real = _entry(types.float64)
"""``real(address, i)``: entry i of a flat array of float64."""


@intrinsic
def set_whole(typing: Any, table: Any, index: Any, value: Any) -> Any:
    """``set_whole(address, i, value)``: write entry i of a flat array of int64."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        i = context.cast(builder, args[1], signature.args[1], types.intp)
        pointer = builder.inttoptr(args[0], WORD.as_pointer())
        builder.store(context.cast(builder, args[2], signature.args[2], types.int64), builder.gep(pointer, [i]))
        return context.get_dummy_value()

    return types.void(table, index, value), generate


def group(kind: Any, at: int) -> Any:
    """Make ``f(address)``: a NamedTuple `kind` of the whole numbers from entry `at` on."""
    result = types.NamedUniTuple(types.int64, len(kind._fields), kind)  # type: ignore[no-untyped-call]

    @intrinsic
    def load(typing: Any, table: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            pointer = builder.inttoptr(args[0], WORD.as_pointer())
            places = [ir.Constant(WORD, at + i) for i in range(len(kind._fields))]
            values = [builder.load(builder.gep(pointer, [place])) for place in places]
            return context.make_tuple(builder, signature.return_type, values)

        return result(table), generate

    return load


@intrinsic
def call(typing: Any, address: Any, numbers: Any) -> Any:
    """``call(address, (a, b, ...))``: call an entry of the kernel with integers."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(ir.VoidType(), [WORD] * len(numbers))
        function = builder.inttoptr(args[0], kind.as_pointer())
        values = [builder.extract_value(args[1], i) for i in range(len(numbers))]
        whole_numbers = [context.cast(builder, v, k, types.int64) for v, k in zip(values, numbers, strict=True)]
        builder.call(function, whole_numbers)
        return context.get_dummy_value()

    return types.void(address, numbers), generate


@intrinsic
def store(typing: Any, array: Any, index: Any, value: Any) -> Any:
    """``store(address, i, value)``: write a register to the entries of a flat array from i on."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        i = context.cast(builder, args[1], signature.args[1], types.intp)
        pointer = builder.gep(builder.inttoptr(args[0], DOUBLE.as_pointer()), [i])
        builder.store(args[2], builder.bitcast(pointer, VECTOR.as_pointer()), align=8)
        return context.get_dummy_value()

    return types.void(array, index, value), generate


@register_jitable
def skip(table: Any, rows: Any) -> Any:
    """Address of the table that begins `rows` rows further on."""
    return table + rows * (8 * LANES)


@intrinsic
def splat(typing: Any, value: Any, who: Any) -> Any:
    """``splat(value, who)``: `value` in all lanes of a register, or as a float for a single lane."""
    if isinstance(who, types.Integer):
        return types.float64(value, who), lambda c, b, s, a: c.cast(b, a[0], s.args[0], types.float64)
    return lanes(value, who), lambda c, b, s, a: _as_lanes(c, b, s.args[0], a[0])


@intrinsic
def choose_less(typing: Any, a: Any, b: Any, yes: Any, no: Any) -> Any:
    """``choose_less(a, b, yes, no)``: yes where a < b, else no; no where either is not a number."""
    wide = lanes in (a, b, yes, no)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pairs = list(zip(signature.args, args, strict=True))
        if wide:
            v = [_as_lanes(context, builder, k, x) for k, x in pairs]
        else:
            v = [context.cast(builder, x, k, types.float64) for k, x in pairs]
        return builder.select(builder.fcmp_ordered("<", v[0], v[1]), v[2], v[3])

    return (lanes if wide else types.float64)(a, b, yes, no), generate


@intrinsic
def choose_lanes(typing: Any, bits: Any, yes: Any, no: Any) -> Any:
    """``choose_lanes(bits, yes, no)``: of two registers, `yes` in the lanes whose bit is set."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        number = context.cast(builder, args[0], signature.args[0], types.int64)
        mask = builder.bitcast(builder.trunc(number, ir.IntType(LANES)), ir.VectorType(ir.IntType(1), LANES))
        return builder.select(mask, args[1], args[2])

    return lanes(bits, yes, no), generate


@intrinsic
def lanes_not_less(typing: Any, a: Any, b: Any) -> Any:
    """``lanes_not_less(a, b)``: bit mask of the lanes where a < b does not hold (also for not-a-number)."""
    wide = lanes in (a, b)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pairs = list(zip(signature.args, args, strict=True))
        if wide:
            v = [_as_lanes(context, builder, k, x) for k, x in pairs]
            bits = builder.bitcast(builder.fcmp_unordered(">=", *v), ir.IntType(LANES))
            return builder.zext(bits, WORD)
        v = [context.cast(builder, x, k, types.float64) for k, x in pairs]
        return builder.zext(builder.fcmp_unordered(">=", *v), WORD)

    return types.int64(a, b), generate
