"""Layout of a model in the kernel's memory: numbers in tables, without any knowledge of effects.

All tables are ``[row, lane]`` arrays of float64 with LANES columns, one after the other in memory, batch after batch.
A matrix entry (i, j) is row ``i * n + j``. The kernel's functions take the addresses of tables. One *block* of whole
numbers holds these addresses together with sizes and options; the entries of the kernel take the address of the
block and nothing else (:func:`brightgrey.simulation.kernel.machine.buffers.block_for`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from brightgrey.simulation.kernel.machine.simd import LANES, group, real, register_jitable, set_whole, whole

__all__ = [
    "Call",
    "PlantRows",
    "Shape",
    "Work",
    "call_of",
    "column_rows",
    "plant_of",
    "points_of",
    "shape_of",
    "table_rows",
    "use_batch",
    "work_of",
]


class Shape(NamedTuple):
    """Sizes and options that hold for all lanes of a call."""

    #: Numbers of states, channels (distinct port and column of smooth laws), limited states, laws, outputs.
    n: int
    channels: int
    limits: int
    elements: int
    outputs: int
    ticks: int  #: Exponent: a base step is cut into at most 2^ticks pieces.
    base_steps: int  #: Base steps per sampling interval.
    jump: int  #: 1 if the step after a failed one may be much shorter, 0 if it is always half as long.
    #: Points within a base step at which limited states are watched: one, at a third of it, or 2^i - 1 that are evenly
    #: spaced.
    points: int
    newton: int  #: Newton iterations per step.
    hold: int  #: 1 if the input is linear between samples, 0 if it is held.
    #: Lanes in a group: the first one leads, and the others use its sequence of steps. 1 if each lane is alone.
    group: int
    samples: int  #: Length of the input.
    euler: int  #: 1 for the paper's explicit Euler method, where a base step is one step.
    dry: int  #: 1 if friction has its exact sign, so that masses slide or stick; 0 if its sign is smoothed.


class PlantRows(NamedTuple):
    """Systems in lanes: ``x' = A x + B u + c + sum_k G_k F_k(H_k x + K_k u)``, and limited states."""

    A: Any
    B: Any
    c: Any
    #: `gain` is the largest |G| of a channel: the acceleration that a unit of F causes.
    G: Any
    H: Any
    K: Any
    gain: Any
    #: Law number of each element, its channel and the row of its first parameter in `p`.
    law: Any
    channel: Any
    first: Any
    p: Any
    turning: Any  #: Row of f_tanh in `p` where a channel has friction that reverses with the motion, else -1.
    #: Row that gives the rate of a limited state between its limits, and the column through which that acts on x'.
    rate: Any
    column: Any
    low: Any
    high: Any
    limited: Any  #: Index of the limited state.
    #: Speed that dry friction of a channel stops, and its position; -1 if there is none.
    stopped: Any
    held: Any
    outputs: Any  #: State number i for a row of x, n + i for a row of x'.
    delay: Any  #: Dead time in whole samples, and the rest in samples.
    x0: Any


class Work(NamedTuple):
    """Memory of one thread."""

    tables: Any
    current: Any
    mode: Any
    free: Any
    #: that is free, otherwise its rate
    low: Any
    high: Any
    x: Any
    end: Any
    force: Any
    slope: Any
    F1: Any
    F2: Any
    a1: Any
    a2: Any
    z1: Any
    z2: Any
    M: Any
    rhs: Any
    watched: Any
    inner_watched: Any
    error: Any
    squares: Any
    drive: Any
    plan: Any
    first_level: Any
    point: Any
    system: Any
    series: Any
    course: Any
    fading: Any  #: per reach at which that fades
    scratch: Any
    build: Any
    watched_weights: Any
    lane_columns: Any
    columns_current: Any
    column: Any
    coupled: Any
    side: Any  #: of dry friction, per channel: 1 or -1 where the mass slides, 0 where it sticks
    breakaway: Any  #: largest dry friction at rest, per channel
    holding: Any  #: rows of the friction that masses at rest need, over the states, 1 and t


class Call(NamedTuple):
    """Inputs, outputs and options of a call, beside plants and sizes."""

    #: Sampling interval in s; tolerated error estimate of a step and tolerated last change of Newton's method, in
    #: units of speed; sum of all states from which a simulation counts as diverged.
    numbers: Any
    u: Any
    y: Any  #: Outputs, one column per lane of every batch; written by the kernel.
    stride: Any  #: Columns of `y`.
    #: First sample at which a lane's state is not finite or its squares are not below their limit; -1 if there is
    #: none. Written by the kernel.
    diverged: Any
    rejoined: Any  #: Bits of the lanes that continue from their leader's state at that sample; written by the kernel.
    idle: Any  #: Bits of the lanes that only fill a batch; their exceptional steps are not refined.
    target: Any  #: Desired outputs. If there are any, squares are summed and `y` is not written; 0 if there are none.
    weights: Any  #: Weights of the squares.
    #: Sum of the weighted squares, before the call and after it, and the sum at which a lane is given up.
    squares: Any
    square_limits: Any
    delayed: Any  #: 1 if any lane of the batch at work has dead time.
    #: Addresses of the entries of these names, as in the fields that follow; 0 where a call does not need them.
    fill_propagator_tables: Any
    input_knot_weights: Any
    set_initial_state: Any
    accept_or_refine: Any
    refine_lane: Any
    refine_group: Any
    locate_events: Any
    euler_step: Any


SERIES_TERMS = 16
assert SERIES_TERMS <= LANES  # the terms of a watched quantity are one row

_WORK = len(Shape._fields)
_CALL = _WORK + len(Work._fields)
_BATCH_AT_WORK = _CALL + len(Call._fields)  # of the batch at work
_FIRST_BATCH = _BATCH_AT_WORK + len(PlantRows._fields)  # of batch 0
_BATCH_STRIDES = _FIRST_BATCH + len(PlantRows._fields)  # from one batch to the next

shape_of = group(Shape, 0)
"""``shape_of(block) -> Shape``"""
work_of = group(Work, _WORK)
"""``work_of(block) -> Work`` of addresses"""
call_of = group(Call, _CALL)
"""``call_of(block) -> Call`` of addresses"""
plant_of = group(PlantRows, _BATCH_AT_WORK)
"""``plant_of(block) -> PlantRows`` of addresses, of the batch at work"""

_PLANT_FIELDS = len(PlantRows._fields)
_DELAYED = _CALL + Call._fields.index("delayed")
_DELAY = _BATCH_AT_WORK + PlantRows._fields.index("delay")


@register_jitable
def use_batch(block: Any, number: Any) -> Any:
    """Make batch `number` the one at work; return True if any of its lanes has dead time."""
    for i in range(_PLANT_FIELDS):
        set_whole(block, _BATCH_AT_WORK + i, whole(block, _FIRST_BATCH + i) + number * whole(block, _BATCH_STRIDES + i))
    delay = whole(block, _DELAY)
    total = 0.0
    for entry in range(2 * LANES):
        total += real(delay, entry)
    set_whole(block, _DELAYED, 1 if total > 0.0 else 0)
    return total > 0.0


@register_jitable
def end_rows(n: Any, channels: Any) -> Any:
    """Rows of the first part of a step table: per state, the weights of x (n), u, its slope, 1, F1, F2 and the kink."""
    return n * (n + 4 + 2 * channels)


@register_jitable
def table_rows(shape: Any) -> Any:
    """Rows of a step table.

    The first part belongs to the states at the end of the step. It holds for each of them the weights of x (n), u and
    its slope, the constant, F1 and F2 of each channel, and the kink. The second part holds the same for every port at
    the stage h/3, and for every watched quantity at each point within the step. The last part holds, for every port,
    the effect of each F1 and F2 at the end of the step; their effect at h/3 is in the second part.
    """
    n, channels = shape.n, shape.channels
    width = n + 4 + 2 * channels
    return (n + channels + shape.limits * shape.points) * width + 2 * channels * channels


@register_jitable
def column_rows(shape: Any) -> Any:
    """Registers of one column of a lane's step table: end states, ports at h/3 and h, and watched quantities."""
    return (shape.n + 2 * shape.channels + shape.limits * shape.points + LANES - 1) // LANES


@register_jitable
def points_of(shape: Any, level: Any) -> Any:
    """Points within a step of 2^level ticks at which limited states are watched; a single one is at a third of it."""
    return max(((shape.points + 1) >> (shape.ticks - level)) - 1, 1)
