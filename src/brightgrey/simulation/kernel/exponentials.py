"""Step tables: the linear part of a step, exact for any stiffness.

Between two knots of the input a system is ``x' = A x + B (u0 + u1 t) + c + G (F0 + F1 t)``. Its solution is a
matrix times x plus a column for each of the other terms: the phi functions of exponential integrators
(doi:10.1017/S0962492910000048). They come from a Taylor polynomial for a tiny step, and from doubling for larger ones.
"""

from __future__ import annotations

from typing import Any

from brightgrey.simulation.kernel.machine.compilation import Entry, inner
from brightgrey.simulation.kernel.machine.memory_layout import (
    call_of,
    end_rows,
    plant_of,
    points_of,
    shape_of,
    table_rows,
    work_of,
)
from brightgrey.simulation.kernel.machine.simd import LANES, choose_less, get, put, real, skip, splat, whole
from brightgrey.simulation.kernel.tolerances import TOLERANCES

__all__ = ["fill_propagator_tables", "mode_matrix", "propagator_over"]


@inner
def mode_matrix(shape: Any, plant: Any, mode: Any, A: Any) -> None:
    """Write the system matrix of a mode to the first n * n rows of A: bit b set means limited state b is free."""
    n = shape.n
    for r in range(n * n):
        put(A, r, None, get(plant.A, r, None))
    for b in range(shape.limits):
        if (mode >> b) & 1:
            for i in range(n):
                g = get(plant.column, b * n + i, None)
                for j in range(n):
                    put(A, i * n + j, None, get(A, i * n + j, None) + g * get(plant.rate, b * n + j, None))


@inner
def _multiply(n: Any, columns: Any, X: Any, Y: Any, at: Any, stride: Any, step: Any, out: Any) -> None:
    """Out = X Y for an n by n matrix X and `columns` columns of Y; entry (i, c) at `at + i stride + c step`.

    With many states Y is larger than the first cache. So four rows of X are multiplied by every entry that is read.
    """
    full = n - n % 4
    for i in range(0, full, 4):
        for c in range(columns):
            y = get(Y, at + c * step, None)
            first, second = get(X, i * n, None) * y, get(X, (i + 1) * n, None) * y
            third, fourth = get(X, (i + 2) * n, None) * y, get(X, (i + 3) * n, None) * y
            for j in range(1, n):
                y = get(Y, at + j * stride + c * step, None)
                first = first + get(X, i * n + j, None) * y
                second = second + get(X, (i + 1) * n + j, None) * y
                third = third + get(X, (i + 2) * n + j, None) * y
                fourth = fourth + get(X, (i + 3) * n + j, None) * y
            put(out, at + i * stride + c * step, None, first)
            put(out, at + (i + 1) * stride + c * step, None, second)
            put(out, at + (i + 2) * stride + c * step, None, third)
            put(out, at + (i + 3) * stride + c * step, None, fourth)
    for i in range(full, n):
        for c in range(columns):
            total = get(X, i * n, None) * get(Y, at + c * step, None)
            for j in range(1, n):
                total = total + get(X, i * n + j, None) * get(Y, at + j * stride + c * step, None)
            put(out, at + i * stride + c * step, None, total)


@inner
def _compose(n: Any, channels: Any, first: Any, length: Any, second: Any, out: Any) -> None:
    """Propagator over `first` (of `length`) and then `second`.

    Propagators are stacked as matrix (n * n rows) and columns (n rows each): value and slope of u, the constant,
    value and slope of every F.
    """
    pairs = 1 + channels
    columns = 3 + 2 * channels
    _multiply(n, n, second, first, 0, n, 1, out)
    _multiply(n, columns, second, first, n * n, 1, n, out)
    for i in range(n):
        r = n * n + 2 * n + i
        put(out, r, None, get(out, r, None) + get(second, r, None))
        for pair in range(pairs):
            value = n * n + i + (0 if pair == 0 else (1 + 2 * pair) * n)
            start = get(second, value, None)
            put(out, value, None, get(out, value, None) + start)
            put(
                out,
                value + n,
                None,
                get(out, value + n, None) + length * start + get(second, value + n, None),
            )


@inner
def _copy_rows(rows: Any, source: Any, target: Any) -> None:
    for r in range(rows):
        put(target, r, None, get(source, r, None))


@inner
def _halvings(n: Any, A: Any, work: Any, scaling: Any) -> Any:
    """Write to row 0 of `scaling` the halvings of the length in row 1 until sqrt(|A^2|) length <= 1/2.

    Return the largest number. The norm of the square does not depend on the different sizes of positions and speeds,
    which |A| does.
    """
    _multiply(n, n, A, A, 0, n, 1, work)
    most = 0
    for lane in range(LANES):
        norm = 0.0
        for j in range(n):
            total = 0.0
            for i in range(n):
                total += abs(get(work, i * n + j, lane))
            norm = max(norm, total)
        size = norm**0.5 * get(scaling, 1, lane)
        count = 0
        while size > 0.5 and count < 60:
            size *= 0.5
            count += 1
        put(scaling, 0, lane, float(count))
        most = max(most, count)
    return most


@inner
def _taylor(n: Any, channels: Any, plant: Any, A: Any, length: Any, out: Any, work: Any) -> None:
    """Propagator over `length` (a register) by the Taylor polynomial; |A length| is small."""
    # Matrix: Horner's scheme, I + A h (I + A h / 2 (I + ...)).
    for i in range(n):
        for j in range(n):
            put(out, i * n + j, None, splat(1.0 if i == j else 0.0, None))
    for degree in range(TOLERANCES.taylor_degree, 0, -1):
        _multiply(n, n, A, out, 0, n, 1, work)
        for i in range(n):
            for j in range(n):
                term = get(work, i * n + j, None) * (length * (1.0 / degree))
                put(out, i * n + j, None, term + 1.0 if i == j else term)
    # Columns: b h (I + A h / 2 (I + ...)) for a constant, b h^2 / 2 (I + A h / 3 (I + ...)) for a slope.
    columns = 3 + 2 * channels
    for column in range(columns):
        slope = column == 1 or (column > 2 and (column - 3) % 2 == 1)
        at = n * n + column * n
        order = 2 if slope else 1
        factor = length * length * 0.5 if slope else length
        for i in range(n):
            put(work, i, None, factor * _source(n, plant, column, i))
            put(out, at + i, None, get(work, i, None))
        for degree in range(1, TOLERANCES.taylor_degree):
            for i in range(n):
                total = get(A, i * n, None) * get(work, 0, None)
                for j in range(1, n):
                    total = total + get(A, i * n + j, None) * get(work, j, None)
                put(work, n + i, None, total * (length * (1.0 / (degree + order))))
            for i in range(n):
                term = get(work, n + i, None)
                put(work, i, None, term)
                put(out, at + i, None, get(out, at + i, None) + term)


@inner
def propagator_over(n: Any, channels: Any, plant: Any, A: Any, length: Any, out: Any, spare: Any, scaling: Any) -> None:
    """Propagator over any `length` (a register) with the forces of all `channels`; `scaling` has two rows."""
    rows = n * n + n * (3 + 2 * channels)
    put(scaling, 1, None, length)
    most = _halvings(n, A, spare, scaling)
    for lane in range(LANES):
        put(scaling, 1, lane, get(scaling, 1, lane) * 0.5 ** get(scaling, 0, lane))
    part = get(scaling, 1, None)
    _taylor(n, channels, plant, A, part, out, spare)
    for doubling in range(most):
        done = splat(doubling + 0.5, None) - get(scaling, 0, None)
        _compose(n, channels, out, part, out, spare)
        part = choose_less(0.0, done, part, part + part)
        for r in range(rows):
            put(out, r, None, choose_less(0.0, done, get(out, r, None), get(spare, r, None)))


@inner
def _source(n: Any, plant: Any, column: Any, i: Any) -> Any:
    """Entry i of what drives x' in a column of the propagator."""
    if column < 2:
        return get(plant.B, i, None)
    if column == 2:
        return get(plant.c, i, None)
    return get(plant.G, (column - 3) // 2 * n + i, None)


@inner
def _row_weights(
    shape: Any, P: Any, length: Any, stage: Any, row: Any, at: Any, table: Any, unit: Any, who: Any
) -> None:
    """Weights of ``row x`` after `length` into `table` from row `at` on.

    `stage` is 1/3 or 1: the part of the step that the propagator P covers. F runs linearly through F1 at h/3 and
    F2 at h, so its value at 0 is (3 F1 - F2) / 2 and its slope 3 (F2 - F1) / (2 h). `unit` >= 0 reads state
    `unit` instead of `row`.
    """
    n = shape.n
    per_h = stage / length  # 1 / h
    for j in range(n):
        put(table, at + j, who, _row_times_columns(n, P, j, n, row, unit, who))
    for extra in range(3):
        put(table, at + n + extra, who, _row_times_columns(n, P, n * n + extra * n, 1, row, unit, who))
    for k in range(shape.channels):
        base = n * n + (3 + 2 * k) * n
        value = _row_times_columns(n, P, base, 1, row, unit, who)
        slope = _row_times_columns(n, P, base + n, 1, row, unit, who) * (1.5 * per_h)
        put(table, at + n + 3 + k, who, value * 1.5 - slope)
        put(table, at + n + 3 + shape.channels + k, who, slope - value * 0.5)
    put(table, at + n + 3 + 2 * shape.channels, who, splat(0.0, who))


@inner
def _row_times_columns(n: Any, P: Any, at: Any, stride: Any, row: Any, unit: Any, who: Any) -> Any:
    """Product of a row with column entries ``at + i stride`` of P."""
    if unit >= 0:
        return get(P, at + unit * stride, who)
    total = splat(0.0, who)
    for i in range(n):
        total = total + get(row, i, who) * get(P, at + i * stride, who)
    return total


@inner
def _fill_step_table(shape: Any, plant: Any, mode: Any, full: Any, third: Any, h: Any, points: Any, table: Any) -> None:
    """Step table of one mode and level from the propagators over the step and a third of it."""
    n, m = shape.n, shape.channels
    width = n + 4 + 2 * m
    for i in range(n):
        _row_weights(shape, full, h, 1.0, plant.H, i * width, table, i, None)
    at = end_rows(n, m)
    for k in range(m):
        _row_weights(shape, third, h / 3.0, 1.0 / 3.0, skip(plant.H, k * n), at, table, -1, None)
        # K reads the input at the stage
        put(table, at + n, None, get(table, at + n, None) + get(plant.K, k, None))
        put(table, at + n + 1, None, get(table, at + n + 1, None) + get(plant.K, k, None) * (h / 3.0))
        at += width
    for b in range(shape.limits):
        if points > 1:
            continue
        row = at + b * shape.points * width
        if (mode >> b) & 1:
            _row_weights(shape, third, h / 3.0, 1.0 / 3.0, plant.H, row, table, whole(plant.limited, b), None)
        else:
            _row_weights(shape, third, h / 3.0, 1.0 / 3.0, skip(plant.rate, b * n), row, table, -1, None)
    at += shape.limits * shape.points * width
    for k in range(m):
        for j in range(m):
            for stage in range(2):
                total = splat(0.0, None)
                for i in range(n):
                    weight = get(table, i * width + n + 3 + stage * m + j, None)
                    total = total + get(plant.H, k * n + i, None) * weight
                put(table, at + k * 2 * m + stage * m + j, None, total)


@inner
def _fill_inner_points(shape: Any, plant: Any, mode: Any, unit: Any, span: Any, work: Any) -> None:
    """Weights of the watched quantities at evenly spaced points of all steps that have such, in one mode.

    `unit` is the propagator from one point to the next, `span` later. The watched row is carried back through one
    more of them for every point: x (n), then the constants and slopes as in a propagator's columns.
    """
    n, m = shape.n, shape.channels
    width, columns = n + 4 + 2 * m, 3 + 2 * m
    row, next_row = work.watched_weights, skip(work.watched_weights, n + columns)
    for b in range(shape.limits):
        for j in range(n + columns):
            put(row, j, None, splat(0.0, None))
        if (mode >> b) & 1:
            put(row, whole(plant.limited, b), None, splat(1.0, None))
        else:
            for j in range(n):
                put(row, j, None, get(plant.rate, b * n + j, None))
        for i in range(shape.points):
            for j in range(n + columns):
                at, stride = (j, n) if j < n else (n * n + (j - n) * n, 1)
                put(next_row, j, None, _row_times_columns(n, unit, at, stride, row, -1, None))
            for column in range(columns):
                j = n + column
                carried = get(next_row, j, None) + get(row, j, None)
                if column == 1 or (column > 2 and (column - 3) % 2 == 1):
                    carried = carried + get(row, j - 1, None) * span
                put(next_row, j, None, carried)
            for j in range(n + columns):
                put(row, j, None, get(next_row, j, None))
            for level in range(shape.ticks, -1, -1):
                points = points_of(shape, level)
                if points == 1 or i >= points:
                    break
                table = skip(work.tables, (mode * (shape.ticks + 1) + level) * table_rows(shape))
                at = end_rows(n, m) + (m + b * shape.points + i) * width
                for j in range(n + 3):
                    put(table, at + j, None, get(row, j, None))
                per_h = 1.0 / (span * (points + 1.0))
                for k in range(m):
                    value = get(row, n + 3 + 2 * k, None)
                    slope = get(row, n + 4 + 2 * k, None) * (1.5 * per_h)
                    put(table, at + n + 3 + k, None, value * 1.5 - slope)
                    put(table, at + n + 3 + m + k, None, slope - value * 0.5)
                put(table, at + n + 3 + 2 * m, None, splat(0.0, None))


@Entry
def fill_propagator_tables(block: Any) -> None:
    """Fill ``work.tables`` for every mode and level; level l covers 2^l ticks."""
    shape, plant, work = shape_of(block), plant_of(block), work_of(block)
    tick = real(call_of(block).numbers, 0) / (shape.base_steps * (1 << shape.ticks))
    n, m = shape.n, shape.channels
    rows = n * n + n * (3 + 2 * m)
    A, third, full = work.build, skip(work.build, rows), skip(work.build, 2 * rows)
    spare, half, unit = skip(work.build, 3 * rows), skip(work.build, 4 * rows), skip(work.build, 5 * rows)
    size = table_rows(shape)
    for mode in range(1 << shape.limits):
        mode_matrix(shape, plant, mode, A)
        length = splat(tick / 3.0, None)
        propagator_over(n, m, plant, A, length, third, spare, work.scratch)
        _compose(n, m, third, length, third, half)
        _compose(n, m, half, length + length, third, full)
        h, span = tick, 0.0
        for level in range(shape.ticks + 1):
            table = skip(work.tables, (mode * (shape.ticks + 1) + level) * size)
            _fill_step_table(shape, plant, mode, full, third, h, points_of(shape, level), table)
            if (1 << (shape.ticks - level)) == shape.points + 1:
                _copy_rows(rows, full, unit)
                span = h
            if level < shape.ticks:
                _compose(n, m, third, splat(h / 3.0, None), third, spare)
                third, spare = spare, third
                _compose(n, m, full, splat(h, None), full, spare)
                full, spare = spare, full
            h *= 2.0
        if shape.points > 1:
            _fill_inner_points(shape, plant, mode, unit, span, work)
