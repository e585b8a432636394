"""Reference solution, method 'fixed': classical Runge-Kutta with one fixed small step, compiled.

The step divides every straight piece of the input and is halved until the solution no longer changes. It is split
where the shaft leaves or meets a side of the backlash gap. In the gap the shaft carries no torque; the exact solution
tau_0 exp(-(c/d) t) of tau' = -(c/d) tau is used there.

With exact dry friction, a mass at rest follows Filippov's convention (1988, doi:10.1007/978-94-015-7793-9). It sticks
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
# What splits a step; the number of a mass, from 0, stands for its friction.
NO_EVENT, CONTACT = -2, -1
# How a mass slides: 1 or -1 is a direction, SMOOTH where the sign of its speed is smoothed, or it has no dry friction.
STICK, SMOOTH = 0, 2
# Speed that counts as rest, in parts of what friction alone would change in one step: rounding.
STILL = 1e-12
# Events per step: a shaft that chatters within the rounding error must not stop the clock. It stands here and not
# among the tolerances, as numba's cache only looks at this file.
MAX_SWITCHES_PER_STEP = 24

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


def _pack(plant: Plant, step: float) -> tuple[Array, Array]:
    """Pack the numbers of a plant for the compiled functions, those of the drive and those of its masses, one row each.

    Drive: 0: masses, 1/T_1 or 0, 2 alpha, number of the shaft with the gap, f_tanh; 5: c; 8: d; 11: hardening;
    14: the mass that the input acts on.
    Mass: 0: 1/J, f_v, M_C, M_S, 1/omega_S; 5: f_d, M_G, c_g, G, k, phi_0; 11: the speed that counts as rest if the mass
    can stick, else -1.
    """
    p = np.zeros(15)
    p[:2] = plant.masses, 0.0 if plant.T_1 is None else 1.0 / plant.T_1
    p[2:5] = 2.0 * (plant.alpha or 0.0), plant.gap_at, plant.f_tanh
    p[5 : 5 + len(plant.c)] = plant.c
    p[8 : 8 + len(plant.d)] = plant.d
    p[11 : 11 + len(plant.hardening)] = plant.hardening
    p[14] = plant.actuator - 1
    rows = []
    for J, load, can_stick in zip(plant.J, plant.loads, plant.sticks, strict=True):
        still = STILL * load.breakaway / J * step if can_stick else -1.0
        friction = (load.f_v, load.M_C, load.M_S, 1.0 / load.fading, load.f_d)
        rows.append((1.0 / J, *friction, load.M_G, load.c_g, load.G, load.k, load.phi_0, still))
    return p, np.array(rows)


@_compile_cached
def _copy(source: Array, target: Array) -> None:
    """Copy in a loop: for ``target[:] = source``, numba compiles an error message with strings, for seconds."""
    for i in range(len(source)):
        target[i] = source[i]


@_compile_cached
def _write_sample(k: int, x: Array, mode: int, gap: float, states: Array, modes: Any, gaps: Array) -> None:
    _copy(x, states[k])
    modes[k], gaps[k] = mode, gap


@_compile_cached
def _state_rates(x: Array, mode: int, slide: Any, u: float, p: Array, loads: Array, out: Array) -> None:
    """Newton's law for every mass; x = (q, v, T), p and loads as packed by :func:`_pack`.

    Friction of a direction continues smoothly where a trial step passes rest.
    """
    n, gap_at = int(p[0]), int(p[3])
    driving, driven = u, int(p[14])
    if p[1] > 0.0:
        driving = x[2 * n]
        out[2 * n] = (u - driving) * p[1]
    torque = 0.0
    for i in range(n):
        a, v = loads[i], x[n + i]
        if i == driven:
            torque += driving
        torque += a[6] - a[1] * v
        if a[5] != 0.0:
            torque -= a[5] * abs(v)
        if a[7] != 0.0:
            torque -= a[7] * x[i]
        if a[8] != 0.0:
            torque -= a[8] * math.sin(a[9] * x[i] + a[10])
        if slide[i] != SMOOTH:
            torque -= slide[i] * (a[2] + a[3] * math.exp(-slide[i] * v * a[4]))
        elif a[2] != 0.0 or a[3] != 0.0:
            torque -= math.tanh(p[4] * v) * (a[2] + a[3] * math.exp(-abs(v) * a[4]))
        out[i] = v
        shaft = 0.0
        if i + 1 < n and not (i == gap_at and mode == GAP):
            twist = x[i] - x[i + 1]
            if i == gap_at and mode == BACK:
                twist += p[2]
            shaft = (p[5 + i] + p[11 + i] * twist * twist) * twist + p[8 + i] * (x[n + i] - x[n + i + 1])
        out[n + i] = 0.0 if slide[i] == STICK else (torque - shaft) * a[0]
        torque = shaft


@_compile_cached
def _rk4(
    x: Array, mode: int, slide: Any, h: float, u: float, du: float, p: Array, loads: Array, w: Array, out: Array
) -> None:
    """One step of length h from x to out; the input is u + du t. `w` is room for slopes."""
    m = len(x)
    _state_rates(x, mode, slide, u, p, loads, w[0])
    for i in range(m):
        w[4, i] = x[i] + 0.5 * h * w[0, i]
    _state_rates(w[4], mode, slide, u + 0.5 * h * du, p, loads, w[1])
    for i in range(m):
        w[4, i] = x[i] + 0.5 * h * w[1, i]
    _state_rates(w[4], mode, slide, u + 0.5 * h * du, p, loads, w[2])
    for i in range(m):
        w[4, i] = x[i] + h * w[2, i]
    _state_rates(w[4], mode, slide, u + h * du, p, loads, w[3])
    for i in range(m):
        out[i] = x[i] + h / 6.0 * (w[0, i] + 2.0 * (w[1, i] + w[2, i]) + w[3, i])


@_compile_cached
def _contact_guard(x: Array, mode: int, gap: float, p: Array) -> float:
    """Not negative while the mode lasts: torque in contact, distance to the nearer side in the gap."""
    n, k = int(p[0]), int(p[3])
    twist, rate = x[k] - x[k + 1], x[n + k] - x[n + k + 1]
    if mode == FRONT:
        return float(p[5 + k] * twist + p[8 + k] * rate)
    if mode == BACK:
        return float(-p[5 + k] * (twist + p[2]) - p[8 + k] * rate)
    return min(-gap, float(gap + p[2]))


@_compile_cached
def _fields_at_rest(
    x: Array, mode: int, slide: Any, i: int, u: float, p: Array, loads: Array, work: Array
) -> tuple[float, float]:
    """Accelerations of mass i at rest, if it slid forth and if it slid back."""
    now = slide[i]
    slide[i] = 1
    _state_rates(x, mode, slide, u, p, loads, work)
    slide[i] = now
    forth = work[int(p[0]) + i]
    return forth, forth + 2.0 * (loads[i, 2] + loads[i, 3]) * loads[i, 0]


@_compile_cached
def _friction_guard(x: Array, mode: int, slide: Any, i: int, u: float, p: Array, loads: Array, work: Array) -> float:
    """Not negative while mass i slides on, and while both fields hold it at rest."""
    if slide[i] != STICK:
        return float(slide[i] * x[int(p[0]) + i] + loads[i, 11])
    forth, back = _fields_at_rest(x, mode, slide, i, u, p, loads, work)
    return min(-forth, back)


@_compile_cached
def _set_directions(x: Array, mode: int, slide: Any, u: float, p: Array, loads: Array, work: Array) -> None:
    """Set the side to which each mass slides from here; a speed that counts as rest becomes zero."""
    n = int(p[0])
    for i in range(n):
        if loads[i, 11] < 0.0:
            slide[i] = SMOOTH
        elif abs(x[n + i]) > loads[i, 11]:
            slide[i] = 1 if x[n + i] > 0.0 else -1
        else:
            x[n + i] = 0.0
            slide[i] = STICK
    for i in range(n):
        if slide[i] == STICK:
            forth, back = _fields_at_rest(x, mode, slide, i, u, p, loads, work)
            slide[i] = 1 if forth >= 0.0 else -1 if back <= 0.0 else STICK


@_compile_cached
def _gap_after(x: Array, out: Array, mode: int, gap: float, tau: float, t: float, p: Array) -> float:
    """Lambda after a step of length t from x to out: in the gap it follows the twist less what tau relaxes.

    It is computed as a change, so that just after a side was left the distance to it has no rounding error.
    """
    if mode != GAP:
        return gap
    k = int(p[3])
    return float(gap + ((out[k] - out[k + 1]) - (x[k] - x[k + 1])) - tau * math.expm1(-p[5 + k] / p[8 + k] * t))


@_compile_cached
def _guard(
    event: int, x: Array, mode: int, gap: float, slide: Any, u: float, p: Array, loads: Array, work: Array
) -> float:
    """Guard of the event, CONTACT or that of a mass."""
    if event == CONTACT:
        return _contact_guard(x, mode, gap, p)
    return _friction_guard(x, mode, slide, event, u, p, loads, work)


@_compile_cached
def _until(
    event: int,
    x: Array,
    mode: int,
    gap: float,
    tau: float,
    slide: Any,
    h: float,
    u: float,
    du: float,
    p: Array,
    loads: Array,
    w: Array,
    out: Array,
) -> float:
    """Time in [0, h] at which the guard of an event passes zero (Illinois rule), with the state then in `out`."""
    a, ga = 0.0, _guard(event, x, mode, gap, slide, u, p, loads, w[0])
    b = h
    gb = _guard(event, out, mode, _gap_after(x, out, mode, gap, tau, h, p), slide, u + h * du, p, loads, w[0])
    if ga <= 0.0:
        _copy(x, out)
        return 0.0
    last = 0
    for _ in range(100):
        t = b - gb * (b - a) / (gb - ga)
        if not a < t < b:
            t = 0.5 * (a + b)
        _rk4(x, mode, slide, t, u, du, p, loads, w, out)
        g = _guard(event, out, mode, _gap_after(x, out, mode, gap, tau, t, p), slide, u + t * du, p, loads, w[0])
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
    _rk4(x, mode, slide, b, u, du, p, loads, w, out)
    return b


@_compile_cached
def _run_pieces(
    x: Array,
    mode: int,
    gap: float,
    p: Array,
    loads: Array,
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
    out, n, k = np.zeros(len(x)), int(p[0]), int(p[3])
    slide = np.full(n, SMOOTH)
    _write_sample(0, x, mode, gap, states, modes, gaps)
    tau = x[k] - x[k + 1] - gap if mode == GAP else 0.0
    sticks = False
    for i in range(n):
        sticks |= loads[i, 11] >= 0.0
    for piece in range(len(length)):
        count = max(1, math.ceil(length[piece] / step - 1e-9))
        h = length[piece] / count
        du = (end[piece] - start[piece]) / length[piece]
        for j in range(count):
            done = 0.0
            for attempt in range(MAX_SWITCHES_PER_STEP):
                left = h - done
                u = start[piece] + du * (j * h + done)
                if sticks:
                    _set_directions(x, mode, slide, u, p, loads, w[0])
                _rk4(x, mode, slide, left, u, du, p, loads, w, out)
                moved = _gap_after(x, out, mode, gap, tau, left, p)
                t, event = left, NO_EVENT
                watch = attempt < MAX_SWITCHES_PER_STEP - 1
                if watch and mode != STIFF and _contact_guard(out, mode, moved, p) < 0.0:
                    t, event = _until(CONTACT, x, mode, gap, tau, slide, t, u, du, p, loads, w, out), CONTACT
                    moved = _gap_after(x, out, mode, gap, tau, t, p)
                for i in range(n):
                    if not watch or slide[i] == SMOOTH:
                        continue
                    if _friction_guard(out, mode, slide, i, u + t * du, p, loads, w[0]) < 0.0:
                        t, event = _until(i, x, mode, gap, tau, slide, t, u, du, p, loads, w, out), i
                        moved = _gap_after(x, out, mode, gap, tau, t, p)
                gap = moved
                if mode == GAP:
                    tau *= math.exp(-p[5 + k] / p[8 + k] * t)
                _copy(out, x)
                done += t
                if event == NO_EVENT:
                    break
                if event >= 0:
                    x[n + event] = 0.0
                    continue
                if mode == GAP:
                    mode = FRONT if gap > -0.5 * p[2] else BACK
                    gap = 0.0 if mode == FRONT else -p[2]
                else:
                    mode = GAP
                    tau = x[k] - x[k + 1] - gap
        if sample[piece] >= 0:
            _write_sample(sample[piece], x, mode, gap, states, modes, gaps)


@_compile_cached
def _accelerations(states: Array, modes: Any, u: Array, p: Array, loads: Array, acceleration: Array) -> None:
    """Acceleration of mass 1 at every sample, from the right-hand side."""
    out, n = np.zeros(states.shape[1]), int(p[0])
    slide = np.full(n, SMOOTH)
    for k in range(len(states)):
        _set_directions(states[k], modes[k], slide, u[k], p, loads, out)
        _state_rates(states[k], modes[k], slide, u[k], p, loads, out)
        acceleration[k] = out[n]


def _initial_mode(plant: Plant, x: Array) -> tuple[Array, int, float]:
    """Split the initial state into (q, v, T), mode and lambda."""
    n = plant.masses
    if plant.alpha is None:
        return x, STIFF, 0.0
    gap, rest = float(x[2 * n]), np.delete(x, 2 * n)
    if plant.alpha == 0.0:
        return rest, STIFF, 0.0
    k = plant.gap_at
    pressing = plant.c[k] * (float(x[k] - x[k + 1]) - gap) + plant.d[k] * float(x[n + k] - x[n + k + 1])
    if gap == 0.0 and pressing >= 0.0:
        return rest, FRONT, gap
    if gap == -2.0 * plant.alpha and pressing <= 0.0:
        return rest, BACK, gap
    return rest, GAP, gap


def _integrate(plant: Plant, segments: Segments, x0: Array, step: float) -> Trajectory:
    """Integrate once with the given step."""
    p, loads = _pack(plant, step)
    x, mode, gap = _initial_mode(plant, x0)
    samples = len(segments.at_sample)
    states, gaps = np.zeros((samples, len(x))), np.zeros(samples)
    modes = np.zeros(samples, dtype=np.int64)
    s = segments
    _run_pieces(x.copy(), mode, gap, p, loads, s.length, s.start, s.end, s.sample, step, states, modes, gaps)
    acceleration = np.zeros(samples)
    _accelerations(states, modes, s.at_sample, p, loads, acceleration)
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
