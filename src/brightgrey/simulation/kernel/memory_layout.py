"""What the kernel knows of a model: numbers in tables, nothing of effects.

All tables are ``[row, lane]`` arrays of float64 with LANES columns, one after the other in memory, batch after batch;
the row numbers are given below, so that a matrix entry (i, j) is row ``i * n + j``. The kernel's functions take the
tables' addresses. One *block* of whole numbers holds them all, with sizes and options: entries of the kernel take its
address and nothing else (`memory.block_for`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from brightgrey.simulation.kernel.simd import LANES, group, real, register_jitable, set_whole, whole

__all__ = [
    "Call",
    "PlantRows",
    "Shape",
    "Work",
    "call_of",
    "plant_of",
    "points_of",
    "shape_of",
    "solo_rows",
    "table_rows",
    "use_batch",
    "work_of",
]


class Shape(NamedTuple):
    """Sizes and options that hold for all lanes of a call.

    Attributes
    ----------
    n, channels, limits, elements, outputs : int
        Numbers of states, channels (distinct port and column of smooth laws), limited states, laws, outputs.
    ticks : int
        Exponent: a base step is cut into at most 2^ticks pieces.
    base_steps : int
        Base steps per sampling interval.
    jump : int
        1 if the step after a failed one may be much shorter, 0 if it is always half of it.
    points : int
        Moments within a base step at which limited states are looked at: 1 for a third of it, else 2^i - 1 for evenly
        spaced ones.
    newton : int
        Newton iterations per step.
    hold : int
        1 if the input is linear between samples, 0 if it is held.
    group : int
        The first lane of every so many leads and the others use its sequence of steps; 1 if each goes on its own.
    samples : int
        Length of the input.
    euler : int
        1 for the paper's explicit Euler method, of which a base step is one step.
    """

    n: int
    channels: int
    limits: int
    elements: int
    outputs: int
    ticks: int
    base_steps: int
    jump: int
    points: int
    newton: int
    hold: int
    group: int
    samples: int
    euler: int


class PlantRows(NamedTuple):
    """Systems in lanes: ``x' = A x + B u + c + sum_k G_k F_k(H_k x + K_k u)``, and limited states.

    Attributes
    ----------
    A : n * n rows; B, c : n rows
    G, H : channels * n rows; K, gain : channels rows
        `gain` is the largest |G| of a channel: what a unit of F does to a speed per second.
    law, channel, first : int arrays (elements,)
        Law number of each element, its channel and the row of its first parameter in `p`.
    p : parameters of all laws
    turning : int array (channels,)
        Row of f_tanh in `p` where a channel has friction that turns with the motion, else -1.
    rate, column : limits * n rows
        Row w that gives the rate of a limited state between its limits, and the column it acts on.
    low, high : limits rows
    limited : int array (limits,)
        Which state is limited.
    outputs : int array (outputs,)
        State number i for a row of x, n + i for a row of x'.
    delay : 2 rows
        Dead time in whole samples, and the rest in samples.
    x0 : n rows
    """

    A: Any
    B: Any
    c: Any
    G: Any
    H: Any
    K: Any
    gain: Any
    law: Any
    channel: Any
    first: Any
    p: Any
    turning: Any
    rate: Any
    column: Any
    low: Any
    high: Any
    limited: Any
    outputs: Any
    delay: Any
    x0: Any


class Work(NamedTuple):
    """Memory of one thread.

    Attributes
    ----------
    tables : one step table per mode and level; see `table_rows`
    current : the step table of each lane's mode at the base step
    mode : int array (limits, lanes): 0 free, 1 at the upper limit, -1 at the lower, 2 closed (no width)
    free, low, high : limits rows: 1 where mode is 0, and the interval in which the watched quantity (the state if
        it is free, else its rate) has to stay
    x, end : n rows: state before and after a step
    force, slope : channels rows: F at the start of a step, and its rate of change in the step before
    F1, F2 : channels rows: F at the stages h/3 and h
    a1, a2, z1, z2 : channels rows: ports without and with F
    M, rhs : Newton's equations
    event : limits rows: watched quantity at the start of a step
    ahead : limits * points rows: watched quantity within an attempted step
    error : error estimate of the last step, in units of speed
    spent : weighted squares of what the outputs are off their targets so far
    drive : 3 rows: input at the start of a step, its slope, and the change of slope (or jump) inside
    plan : int array: level of the leader's step at each tick; begin : int array (lanes,): level to go on with after a
        full step that was not accepted
    point, system, series, course : of one lane, states side by side: state; columns of its matrix, constant and slope
        (n + 2 rows); Taylor coefficients; those of a watched quantity
    fading : of one lane, limited states side by side: what each is off its series at first, and the rate per reach at
        which that fades
    scratch : 5 n + 3 rows
    build : matrices that tables are made of; look : 2 rows of a watched quantity's weights
    solo : of every mode, level and lane, the lane's step table in columns of `solo_rows` rows; copied : int array,
        which of them are up to date; rows : one column; coupled : a lane's effect of F1 and F2 on the ports
    """

    tables: Any
    current: Any
    mode: Any
    free: Any
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
    event: Any
    ahead: Any
    error: Any
    spent: Any
    drive: Any
    plan: Any
    begin: Any
    point: Any
    system: Any
    series: Any
    course: Any
    fading: Any
    scratch: Any
    build: Any
    look: Any
    solo: Any
    copied: Any
    rows: Any
    coupled: Any


class Call(NamedTuple):
    """What a call is about, beside plants and sizes.

    Attributes
    ----------
    numbers : float array (4,)
        Sampling interval in s; tolerated error estimate of a step and tolerated last change of Newton, in units of
        speed; sum of all states from which on a simulation counts as diverged.
    u : float array (samples,)
    y : float array (outputs, samples, stride)
        Outputs, one column per lane of every batch; written by the kernel.
    stride : int
        Columns of `y`.
    diverged : int array (batches, LANES)
        First sample at which a lane's state is not finite, or its squares are no longer below `most`, -1 if there is
        none; written by the kernel.
    rejoined : int array (batches, samples)
        Bits of the lanes that go on from their leader's state at that sample; written by the kernel.
    idle : int array (batches,)
        Bits of the lanes that only fill a batch: what is exceptional in them is not gone into.
    target : float array (outputs, samples)
        What the outputs should be; then squares are summed and `y` is not written. 0 if there is none.
    weights : float array (outputs,)
        Of the squares.
    spent, most : float array (batches, LANES)
        Sum of the weighted squares, before the call and after it, and from what on a lane is given up.
    delayed : int
        1 if any lane of the batch at work has dead time.
    tables, kinks, start, sort, refine, together, creep, euler : int
        Addresses of the entries of these names; 0 for what the call does not need.
    """

    numbers: Any
    u: Any
    y: Any
    stride: Any
    diverged: Any
    rejoined: Any
    idle: Any
    target: Any
    weights: Any
    spent: Any
    most: Any
    delayed: Any
    tables: Any
    kinks: Any
    start: Any
    sort: Any
    refine: Any
    together: Any
    creep: Any
    euler: Any


SERIES_TERMS = 16
assert SERIES_TERMS <= LANES  # the terms of a watched quantity are one row

_WORK = len(Shape._fields)
_CALL = _WORK + len(Work._fields)
_PLANT = _CALL + len(Call._fields)  # of the batch at work
_FIRST = _PLANT + len(PlantRows._fields)  # of batch 0
_BYTES = _FIRST + len(PlantRows._fields)  # from one batch to the next

shape_of = group(Shape, 0)
"""``shape_of(block) -> Shape``"""
work_of = group(Work, _WORK)
"""``work_of(block) -> Work`` of addresses"""
call_of = group(Call, _CALL)
"""``call_of(block) -> Call`` of addresses"""
plant_of = group(PlantRows, _PLANT)
"""``plant_of(block) -> Plant`` of addresses, of the batch at work"""

_FIELDS = len(PlantRows._fields)
_DELAYED = _CALL + Call._fields.index("delayed")
_DELAY = _PLANT + PlantRows._fields.index("delay")


@register_jitable
def use_batch(block: Any, number: Any) -> Any:
    """Make batch `number` the one at work; returns whether it has dead time."""
    for i in range(_FIELDS):
        set_whole(block, _PLANT + i, whole(block, _FIRST + i) + number * whole(block, _BYTES + i))
    delay = whole(block, _DELAY)
    total = 0.0
    for entry in range(2 * LANES):
        total += real(delay, entry)
    set_whole(block, _DELAYED, 1 if total > 0.0 else 0)
    return total > 0.0


@register_jitable
def end_rows(n: Any, channels: Any) -> Any:
    """Rows of the first part of a step table, per state i: from x (n), u, slope of u, 1, F1, F2 and the kink."""
    return n * (n + 4 + 2 * channels)


@register_jitable
def table_rows(shape: Any) -> Any:
    """Rows of a step table.

    First, for every state at the end of the step, the weights of: x (n), u and its slope, the constant, F1 and
    F2 of each channel, the kink. Then the same for every port at the stage h/3, and for every watched quantity
    at each point within the step. Last, for every port, the effect of each F1 and F2 at the end of the step (those
    at h/3 stand in the second part).
    """
    n, channels = shape.n, shape.channels
    width = n + 4 + 2 * channels
    return (n + channels + shape.limits * shape.points) * width + 2 * channels * channels


@register_jitable
def solo_rows(shape: Any) -> Any:
    """Registers that hold a column of one lane's step table: end states, ports at h/3 and h, watched quantities."""
    return (shape.n + 2 * shape.channels + shape.limits * shape.points + LANES - 1) // LANES


@register_jitable
def points_of(shape: Any, level: Any) -> Any:
    """Points within a step of 2^level ticks at which limited states are looked at; 1 is the one at a third of it."""
    return max(((shape.points + 1) >> (shape.ticks - level)) - 1, 1)
