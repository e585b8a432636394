"""Memory of the kernel: tables of systems, working memory, and the block of addresses that an entry is given."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.simulation.kernel.machine.memory_layout import (
    SERIES_TERMS,
    Call,
    PlantRows,
    Shape,
    Work,
    column_rows,
    table_rows,
)
from brightgrey.simulation.kernel.machine.simd import LANES

__all__ = ["PlantBuffers", "address", "aligned", "block_for", "plants_for", "work_for"]

_ENTRY = np.dtype(np.float64).itemsize  # bytes of a number
_LINE = 64  # bytes of a cache line: a register that lies across two of them takes two accesses
_SHARED_FIELDS = ("law", "channel", "first", "turning", "limited", "stopped", "held", "outputs")
_FIELDS_BY_LANE = tuple(name for name in PlantRows._fields if name not in _SHARED_FIELDS)


class PlantBuffers(NamedTuple):
    """Systems in lanes for all batches of a call."""

    first: PlantRows  #: Addresses for batch 0.
    stride: int  #: Bytes from one batch to the next, of everything that differs by lane.
    memory: tuple[NDArray[Any], ...]  #: Arrays to which the addresses point.


def plants_for(
    tables: Mapping[str, NDArray[np.float64]], numbers: Mapping[str, Sequence[int]], pick: NDArray[np.int64]
) -> PlantBuffers:
    """Allocate and fill the memory of the parameter sets `pick`, shape (batches, LANES).

    Parameters
    ----------
    tables : mapping of str to ndarray, shape (rows, sets)
        Fields of `PlantRows` that differ by lane.
    numbers : mapping of str to sequence of int
        The other fields.
    pick : int ndarray
    """
    rows = np.concatenate([tables[name] for name in _FIELDS_BY_LANE])
    lanes = aligned((len(pick), len(rows), LANES))
    lanes[:] = rows[:, pick].transpose(1, 0, 2)
    whole_numbers = np.array([n for name in _SHARED_FIELDS for n in numbers[name]] or [0], np.int64)
    places: dict[str, int] = {}
    place = address(lanes)
    for name in _FIELDS_BY_LANE:
        places[name] = place
        place += len(tables[name]) * LANES * _ENTRY
    place = address(whole_numbers)
    for name in _SHARED_FIELDS:
        places[name] = place
        place += len(numbers[name]) * _ENTRY
    return PlantBuffers(PlantRows(**places), len(rows) * LANES * _ENTRY, (lanes, whole_numbers))


def block_for(shape: Shape, plants: PlantBuffers, work: Work, call: Call) -> NDArray[np.int64]:
    """Block of one thread. The caller has to keep alive all memory whose addresses it holds.

    Parameters
    ----------
    shape : Shape
    plants : PlantBuffers
    work : Work
    call : Call
        Whole numbers and addresses.
    """
    strides = [plants.stride if name in _FIELDS_BY_LANE else 0 for name in PlantRows._fields]
    return np.array([*shape, *work, *call, *plants.first, *plants.first, *strides], np.int64)


def address(array: NDArray[Any]) -> int:
    """Address of the first entry of an array."""
    return int(array.__array_interface__["data"][0])


def aligned(shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Array of zeros that begins at a cache line."""
    count = math.prod(shape)
    memory = np.zeros(count + _LINE // _ENTRY)
    begin = -address(memory) % _LINE // _ENTRY
    return memory[begin : begin + count].reshape(shape)


def work_for(shape: Shape) -> tuple[Work, NDArray[np.float64]]:
    """Zeroed memory for one thread: the addresses in it, and the memory itself."""
    rows, starts = _work_places(shape)
    memory = aligned((rows, LANES))
    begin = address(memory)
    return Work(*(begin + start for start in starts)), memory


@lru_cache(maxsize=256)
def _work_places(shape: Shape) -> tuple[int, tuple[int, ...]]:
    """Rows of a thread's memory, and the byte at which each field begins."""
    n, m, b = shape.n, shape.channels, shape.limits
    modes, levels = 2**b, shape.ticks + 1
    table, pieces = int(table_rows(shape)), 2**shape.ticks
    propagator = n * n + n * (3 + 2 * m)
    rows = Work(
        tables=modes * levels * table,
        current=table,
        mode=b,
        free=b,
        low=b,
        high=b,
        x=n,
        end=n,
        force=m,
        slope=m,
        F1=m,
        F2=m,
        a1=m,
        a2=m,
        z1=m,
        z2=m,
        M=4 * m * m,
        rhs=2 * m,
        watched=b,
        inner_watched=b * shape.points,
        error=1,
        squares=1,
        drive=3,
        plan=-(-pieces // LANES),
        first_level=1,
        point=1,
        system=n + 2,
        series=SERIES_TERMS,
        course=1,
        fading=2,
        scratch=5 * n + 7,
        build=6 * propagator,
        watched_weights=2 * (n + 3 + 2 * m),
        lane_columns=modes * levels * LANES * (n + 4 + 2 * m) * int(column_rows(shape)),
        columns_current=modes * levels,
        column=int(column_rows(shape)),
        coupled=4 * m * m,
        side=m,
        breakaway=m,
        holding=m,
    )
    starts = accumulate(rows, initial=0)
    return sum(rows), tuple(start * LANES * _ENTRY for start, _ in zip(starts, rows, strict=False))
