"""Reference solution, method 'fixed': classical Runge-Kutta with one fixed small step, compiled.

The step divides every straight piece of the input and is halved until the solution no longer changes. It is split
where the shaft leaves or meets a side of the backlash gap. In the gap the shaft carries no torque; the exact solution
tau_0 exp(-(c/d) t) of tau' = -(c/d) tau is used there.

With exact dry friction, a mass at rest follows Filippov's convention (1988, doi:10.1007/978-94-015-7793-9): it sticks
where both fields, of sliding forth and of sliding back, point at rest, and slides along one that points away. A step is
split where the speed passes zero and where a field turns away.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit

from brightgrey.arrays import Array
from brightgrey.simulation.reference.plant import Plant, Segments, Trajectory, difference
from brightgrey.simulation.reference.tolerances import REFERENCE_TOLERANCES

__all__ = ["FixedStepSolution", "solve_fixed_step"]

# Modes of the shaft with backlash. STIFF stands for a shaft without backlash, or with a gap of no width.
STIFF, FRONT, BACK, GAP = 0, 1, 2, 3
# What splits a step.
NO_EVENT, CONTACT, FRICTION = 0, 1, 2
# How mass 1 slides: 1 or -1 is a direction, SMOOTH where the sign of its speed is smoothed, or it has no dry friction.
STICK, SMOOTH = 0, 2
# Speed that counts as rest, in parts of what friction alone would change in one step: rounding.
STILL = 1e-12
# Events per step: a shaft that chatters within the rounding error must not stop the clock. It stands here and not
# among the tolerances, as numba's cache only looks at this file.
MAX_SWITCHES_PER_STEP = 12

F = TypeVar("F", bound=Callable[..., Any])


def _compile_cached(function: F) -> F:
    """Compile and keep on disk. No compiled function here depends on another file: the cache cannot go stale."""
    return cast(F, njit(cache=True, nogil=True, error_model="numpy", forceinline=True)(function))


@dataclass(frozen=True)
class FixedStepSolution:
    """Solution at the finest step."""

    trajectory: Trajectory
    change: float  #: Largest change by the last halving of the step, relative to the peak of position or velocity.
    step: float  #: The finest step in s.


def _pack(plant: Plant, step: float) -> Array:
    """Pack the numbers of a plant for the compiled functions.

    0: masses, f_v, M_C, M_S, 1/omega_S; 5: f_tanh, M_G, 1/T_1 or 0, 2 alpha; 9: the speed that counts as rest if
    mass 1 can stick, else -1; 10: 1/J; 14: c; 17: d.
    """
    p = np.zeros(20)
    p[:7] = plant.masses, plant.f_v, plant.M_C, plant.M_S, 1.0 / plant.fading, plant.f_tanh, plant.M_G
    p[7] = 0.0 if plant.T_1 is None else 1.0 / plant.T_1
    p[8] = 2.0 * (plant.alpha or 0.0)
    p[9] = STILL * plant.breakaway / plant.J[0] * step if plant.sticks else -1.0
    p[10 : 10 + plant.masses] = 1.0 / np.array(plant.J)
    p[14 : 14 + len(plant.c)] = plant.c
    p[17 : 17 + len(plant.d)] = plant.d
    return p


@_compile_cached
def _state_rates(x: Array, mode: int, slide: int, u: float, p: Array, out: Array) -> None:
    """Newton's law for every mass; x = (q, v, T), p as packed by :func:`_pack`.

    Friction of a direction continues smoothly where a trial step passes rest.
    """
    n = int(p[0])
    v1 = x[n]
    torque = u
    if p[7] > 0.0:
        torque = x[2 * n]
        out[2 * n] = (u - torque) * p[7]
    torque += p[6] - p[1] * v1
    if slide != SMOOTH:
        torque -= slide * (p[2] + p[3] * math.exp(-slide * v1 * p[4]))
    elif p[2] != 0.0 or p[3] != 0.0:
        torque -= math.tanh(p[5] * v1) * (p[2] + p[3] * math.exp(-abs(v1) * p[4]))
    for i in range(n):
        out[i] = x[n + i]
        shaft = 0.0
        if i + 1 < n and not (i == 0 and mode == GAP):
            twist = x[i] - x[i + 1]
            if i == 0 and mode == BACK:
                twist += p[8]
            shaft = p[14 + i] * twist + p[17 + i] * (x[n + i] - x[n + i + 1])
        out[n + i] = (torque - shaft) * p[10 + i]
        torque = shaft
    if slide == STICK:
        out[n] = 0.0


@_compile_cached
def _rk4(x: Array, mode: int, slide: int, h: float, u: float, du: float, p: Array, w: Array, out: Array) -> None:
    """One step of length h from x to out; the input is u + du t. `w` is room for slopes."""
    m = len(x)
    _state_rates(x, mode, slide, u, p, w[0])
    for i in range(m):
        w[4, i] = x[i] + 0.5 * h * w[0, i]
    _state_rates(w[4], mode, slide, u + 0.5 * h * du, p, w[1])
    for i in range(m):
        w[4, i] = x[i] + 0.5 * h * w[1, i]
    _state_rates(w[4], mode, slide, u + 0.5 * h * du, p, w[2])
    for i in range(m):
        w[4, i] = x[i] + h * w[2, i]
    _state_rates(w[4], mode, slide, u + h * du, p, w[3])
    for i in range(m):
        out[i] = x[i] + h / 6.0 * (w[0, i] + 2.0 * (w[1, i] + w[2, i]) + w[3, i])


@_compile_cached
def _contact_guard(x: Array, mode: int, gap: float, p: Array) -> float:
    """Not negative while the mode lasts: torque in contact, distance to the nearer side in the gap."""
    n = int(p[0])
    twist, rate = x[0] - x[1], x[n] - x[n + 1]
    if mode == FRONT:
        return float(p[14] * twist + p[17] * rate)
    if mode == BACK:
        return float(-p[14] * (twist + p[8]) - p[17] * rate)
    return min(-gap, float(gap + p[8]))


@_compile_cached
def _fields_at_rest(x: Array, mode: int, u: float, p: Array, work: Array) -> tuple[float, float]:
    """Accelerations of mass 1 at rest, if it slid forth and if it slid back."""
    _state_rates(x, mode, 1, u, p, work)
    forth = work[int(p[0])]
    return forth, forth + 2.0 * (p[2] + p[3]) * p[10]


@_compile_cached
def _friction_guard(x: Array, mode: int, slide: int, u: float, p: Array, work: Array) -> float:
    """Not negative while mass 1 slides on, and while both fields hold it at rest."""
    if slide != STICK:
        return float(slide * x[int(p[0])] + p[9])
    forth, back = _fields_at_rest(x, mode, u, p, work)
    return min(-forth, back)


@_compile_cached
def _direction(x: Array, mode: int, u: float, p: Array, work: Array) -> int:
    """Side to which mass 1 slides from here; a speed that counts as rest becomes zero."""
    n = int(p[0])
    if p[9] < 0.0:
        return SMOOTH
    if abs(x[n]) > p[9]:
        return 1 if x[n] > 0.0 else -1
    x[n] = 0.0
    forth, back = _fields_at_rest(x, mode, u, p, work)
    if forth >= 0.0:
        return 1
    return -1 if back <= 0.0 else STICK


@_compile_cached
def _gap_after(x: Array, out: Array, mode: int, gap: float, tau: float, t: float, p: Array) -> float:
    """Lambda after a step of length t from x to out: in the gap it follows the twist less what tau relaxes.

    It is computed as a change, so that just after a side was left the distance to it has no rounding error.
    """
    if mode != GAP:
        return gap
    return float(gap + ((out[0] - out[1]) - (x[0] - x[1])) - tau * math.expm1(-p[14] / p[17] * t))


@_compile_cached
def _guard(event: int, x: Array, mode: int, gap: float, slide: int, u: float, p: Array, work: Array) -> float:
    """Guard of the event, CONTACT or FRICTION."""
    if event == CONTACT:
        return _contact_guard(x, mode, gap, p)
    return _friction_guard(x, mode, slide, u, p, work)


@_compile_cached
def _until(
    event: int,
    x: Array,
    mode: int,
    gap: float,
    tau: float,
    slide: int,
    h: float,
    u: float,
    du: float,
    p: Array,
    w: Array,
    out: Array,
) -> float:
    """Time in [0, h] at which the guard of an event passes zero (Illinois rule), with the state then in `out`."""
    a, ga = 0.0, _guard(event, x, mode, gap, slide, u, p, w[0])
    b = h
    gb = _guard(event, out, mode, _gap_after(x, out, mode, gap, tau, h, p), slide, u + h * du, p, w[0])
    if ga <= 0.0:
        out[:] = x
        return 0.0
    last = 0
    for _ in range(100):
        t = b - gb * (b - a) / (gb - ga)
        if not a < t < b:
            t = 0.5 * (a + b)
        _rk4(x, mode, slide, t, u, du, p, w, out)
        g = _guard(event, out, mode, _gap_after(x, out, mode, gap, tau, t, p), slide, u + t * du, p, w[0])
        if g <= 0.0:
            b, gb = t, g
            ga *= 0.5 if last == 1 else 1.0
            last = 1
        else:
            a, ga = t, g
            gb *= 0.5 if last == 2 else 1.0
            last = 2
        if b - a <= 1e-12 * h or g == 0.0:
            break
    _rk4(x, mode, slide, b, u, du, p, w, out)
    return b


@_compile_cached
def _run_pieces(
    x: Array,
    mode: int,
    gap: float,
    p: Array,
    length: Array,
    start: Array,
    end: Array,
    sample: Any,
    step: float,
    states: Array,
    modes: Any,
    gaps: Array,
) -> None:
    """Integrate over all pieces; write state, mode and lambda at every sample."""
    w = np.zeros((5, len(x)))
    out, n = np.zeros(len(x)), int(p[0])
    states[0], modes[0], gaps[0] = x, mode, gap
    tau = x[0] - x[1] - gap if mode == GAP else 0.0
    sticks = p[9] >= 0.0
    for piece in range(len(length)):
        count = max(1, math.ceil(length[piece] / step - 1e-9))
        h = length[piece] / count
        du = (end[piece] - start[piece]) / length[piece]
        for j in range(count):
            done = 0.0
            for attempt in range(MAX_SWITCHES_PER_STEP):
                left = h - done
                u = start[piece] + du * (j * h + done)
                slide = _direction(x, mode, u, p, w[0]) if sticks else SMOOTH
                _rk4(x, mode, slide, left, u, du, p, w, out)
                moved = _gap_after(x, out, mode, gap, tau, left, p)
                t, event = left, NO_EVENT
                watch = attempt < MAX_SWITCHES_PER_STEP - 1
                if watch and mode != STIFF and _contact_guard(out, mode, moved, p) < 0.0:
                    t, event = _until(CONTACT, x, mode, gap, tau, slide, t, u, du, p, w, out), CONTACT
                    moved = _gap_after(x, out, mode, gap, tau, t, p)
                if watch and sticks and _friction_guard(out, mode, slide, u + t * du, p, w[0]) < 0.0:
                    t, event = _until(FRICTION, x, mode, gap, tau, slide, t, u, du, p, w, out), FRICTION
                    moved = _gap_after(x, out, mode, gap, tau, t, p)
                gap = moved
                if mode == GAP:
                    tau *= math.exp(-p[14] / p[17] * t)
                x[:] = out
                done += t
                if event == NO_EVENT:
                    break
                if event == FRICTION:
                    x[n] = 0.0
                    continue
                if mode == GAP:
                    mode = FRONT if gap > -0.5 * p[8] else BACK
                    gap = 0.0 if mode == FRONT else -p[8]
                else:
                    mode = GAP
                    tau = x[0] - x[1] - gap
        if sample[piece] >= 0:
            states[sample[piece]], modes[sample[piece]], gaps[sample[piece]] = x, mode, gap


@_compile_cached
def _accelerations(states: Array, modes: Any, u: Array, p: Array, acceleration: Array) -> None:
    """Acceleration of mass 1 at every sample, from the right-hand side."""
    out = np.zeros(states.shape[1])
    for k in range(len(states)):
        slide = _direction(states[k], modes[k], u[k], p, out)
        _state_rates(states[k], modes[k], slide, u[k], p, out)
        acceleration[k] = out[int(p[0])]


def _initial_mode(plant: Plant, x: Array) -> tuple[Array, int, float]:
    """Split the initial state into (q, v, T), mode and lambda."""
    n = plant.masses
    if plant.alpha is None:
        return x, STIFF, 0.0
    gap, rest = float(x[2 * n]), np.delete(x, 2 * n)
    if plant.alpha == 0.0:
        return rest, STIFF, 0.0
    pressing = plant.c[0] * (float(x[0] - x[1]) - gap) + plant.d[0] * float(x[n] - x[n + 1])
    if gap == 0.0 and pressing >= 0.0:
        return rest, FRONT, gap
    if gap == -2.0 * plant.alpha and pressing <= 0.0:
        return rest, BACK, gap
    return rest, GAP, gap


def _integrate(plant: Plant, segments: Segments, x0: Array, step: float) -> Trajectory:
    """Integrate once with the given step."""
    p = _pack(plant, step)
    x, mode, gap = _initial_mode(plant, x0)
    samples = len(segments.at_sample)
    states, gaps = np.zeros((samples, len(x))), np.zeros(samples)
    modes = np.zeros(samples, dtype=np.int64)
    s = segments
    _run_pieces(x.copy(), mode, gap, p, s.length, s.start, s.end, s.sample, step, states, modes, gaps)
    acceleration = np.zeros(samples)
    _accelerations(states, modes, s.at_sample, p, acceleration)
    if plant.alpha is not None:
        states = np.insert(states, 2 * plant.masses, gaps, axis=1)
    return Trajectory(plant.state_names, states.T, acceleration)


def solve_fixed_step(plant: Plant, segments: Segments, x0: Array, tolerance: float) -> FixedStepSolution:
    """Halve the step until position and velocity of mass 1 change by less than `tolerance` of their peaks.

    The method ends earlier where halving no longer helps. Many impacts magnify rounding errors, which no step can
    reduce; a chaotic system never settles.
    """
    step = min(REFERENCE_TOLERANCES.coarsest_step, 0.5 / plant.fastest_rate)
    coarse, before = _integrate(plant, segments, x0, step), math.inf
    while True:
        step *= 0.5
        fine = _integrate(plant, segments, x0, step)
        change = max(difference(kind, fine, coarse) for kind in ("position", "velocity"))
        settled = step <= REFERENCE_TOLERANCES.trusted_step and change > 0.3 * before
        if change <= tolerance or settled or step <= REFERENCE_TOLERANCES.finest_step:
            return FixedStepSolution(fine, change, step)
        coarse, before = fine, change
