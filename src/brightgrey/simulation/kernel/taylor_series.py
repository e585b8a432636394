"""Solution of one lane as a power series in time, exact for any span between events.

The states of the lane stand side by side in a register, so that a term of the series is one product of a matrix and a
vector.
"""

from __future__ import annotations

from typing import Any

from brightgrey.effects.arithmetic import magnitude
from brightgrey.simulation.kernel.machine.compilation import inner
from brightgrey.simulation.kernel.machine.memory_layout import SERIES_TERMS
from brightgrey.simulation.kernel.machine.simd import LANES, get, lanes_not_less, put, real, splat
from brightgrey.simulation.kernel.tolerances import TOLERANCES

__all__ = ["expand", "mode_columns", "value_at"]


@inner
def mode_columns(shape: Any, plant: Any, mode: Any, work: Any, lane: Any) -> None:
    """Write the columns of one lane's system matrix to ``work.system``: bit b set means limited state b is free."""
    n = shape.n
    for j in range(n):
        for i in range(n):
            put(work.system, j, i, get(plant.A, i * n + j, lane))
    for b in range(shape.limits):
        if (mode >> b) & 1:
            for j in range(n):
                rate = get(plant.rate, b * n + j, lane)
                for i in range(n):
                    put(work.system, j, i, get(work.system, j, i) + get(plant.column, b * n + i, lane) * rate)


@inner
def expand(n: Any, work: Any, span: Any) -> Any:
    """Taylor series of x' = A x + b0 + b1 t from the state in ``work.point``: (reach, number of terms).

    A, b0 and b1 are the rows of ``work.system``. The coefficients in ``work.series`` belong to t / reach. The reach is
    `span`, halved until the last term is below rounding. The last term is compared with the sum of all others, because
    the first terms are zero from rest, the more of them the more masses lie between.
    """
    put(work.series, 0, None, get(work.point, 0, None))
    size = magnitude(get(work.point, 0, None))
    before = size
    for k in range(1, SERIES_TERMS):
        total = splat(0.0, None)
        if k == 1:
            total = get(work.system, n, None) * span
        elif k == 2:
            total = get(work.system, n + 1, None) * (span * span)
        for j in range(n):
            total = total + get(work.system, j, None) * (real(work.series, (k - 1) * LANES + j) * span)
        total = total * (1.0 / k)
        put(work.series, k, None, total)
        now = magnitude(total)
        if k > 3 and lanes_not_less(now + before, size * TOLERANCES.series_rounding + 1e-300) == 0:
            return span, k + 1
        size, before = size + now, now
    last = magnitude(get(work.series, SERIES_TERMS - 1, None))
    part = 1.0
    for _ in range(60):
        size, power = splat(0.0, None), 1.0
        for k in range(SERIES_TERMS - 2):
            size = size + magnitude(get(work.series, k, None)) * power
            power *= part
        if lanes_not_less(last * part ** (SERIES_TERMS - 1), size * (100.0 * TOLERANCES.series_rounding) + 1e-300) == 0:
            break
        part *= 0.5
    power = 1.0
    for k in range(SERIES_TERMS):
        put(work.series, k, None, get(work.series, k, None) * power)
        power *= part
    return span * part, SERIES_TERMS


@inner
def value_at(work: Any, terms: Any, part: Any) -> Any:
    """State, as a register, at `part` (0 to 1) of the reach of the series."""
    total = get(work.series, terms - 1, None)
    for k in range(terms - 2, -1, -1):
        total = total * part + get(work.series, k, None)
    return total
