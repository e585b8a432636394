"""Masses in a row, coupled by springs and dampers: what the four multiple-mass effects share.

Paper section 2.1 and eq. (1), (7), (8). The motor's torque and the sensor are at mass 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects.declaration import Dimension, Draft, Effect, Fault, Modelica, Parameter, Scales, State, Values

__all__ = ["mass_chain"]


INERTIA = Dimension(input=1, motion=-1, time=2)
STIFFNESS = Dimension(input=1, motion=-1, time=0)
DAMPING = Dimension(input=1, motion=-1, time=1)
POSITION = Dimension(input=0, motion=1, time=0)
SPEED = Dimension(input=0, motion=1, time=-1)


_TOTAL = 1.5  # either way: how far the torque balance may be off
_DIVISION = 30.0  # either way: a mass against all behind it
_LOOSE = 0.3  # of Nyquist's frequency
_LEAST_DAMPED = 5e-3  # damping ratio; up to 1
_STIFFER = 10.0  # range of a new shaft's frequency
_PARTS, _RATIOS = (0.05, 0.2, 0.5, 0.8, 0.95), (1e-3, 3e-2)  # of a new shaft: inertia before it, damping ratios


def slowest(scales: Scales) -> float:
    """Lowest angular frequency in rad/s worth looking for: two periods in the recording."""
    return 2.0 * np.pi * 2.0 / scales.duration


def fastest(scales: Scales) -> float:
    """Highest angular frequency in rad/s that samples can show: Nyquist's."""
    return np.pi / scales.interval


def inertia_name(i: int, masses: int) -> Parameter:
    """Moment of inertia of mass i; alone it is the total inertia, else anything below about it.

    The last mass carries the load.
    """
    low = 0.2 if masses == 1 else 0.001
    return Parameter(
        f"J{i}",
        INERTIA,
        f"moment of inertia of mass {i} (mass, in a linear axis)",
        bounds=lambda s: (low * s.inertia, 5.0 * s.inertia),
        start=lambda s: s.inertia / masses,
        fault=Fault("load", grows=False) if i == masses else None,
    )


def stiffness_name(k: int, masses: int) -> Parameter:
    """Spring constant of shaft k: resonances between two periods per recording and Nyquist's frequency."""
    return Parameter(
        f"c{k}",
        STIFFNESS,
        f"spring constant between mass {k} and {k + 1}",
        bounds=lambda s: (0.01 * s.inertia * slowest(s) ** 2, 0.5 * s.inertia * fastest(s) ** 2),
        start=lambda s: s.inertia / (2.0 * masses) * slowest(s) * fastest(s),
    )


def damping_name(k: int, masses: int) -> Parameter:
    """Damper constant of shaft k: from a ringing of hundreds of periods to an overdamped shaft."""
    return Parameter(
        f"d{k}",
        DAMPING,
        f"damper constant between mass {k} and {k + 1}",
        bounds=lambda s: (1e-4 * s.inertia * slowest(s), 0.5 * s.inertia * fastest(s)),
        start=lambda s: 0.1 * s.inertia / (2.0 * masses) * np.sqrt(slowest(s) * fastest(s)),
    )


def _stamp(draft: Draft, masses: int, values: Values) -> Draft:
    """Fill A and B of an empty draft by eq. (7) and (8); M is diagonal, C and D tridiagonal."""
    J = [values[f"J{i + 1}"] for i in range(masses)]
    batch = np.broadcast_shapes(*(np.shape(v) for v in values.values()))
    A = np.zeros((2 * masses, 2 * masses, *batch))
    B = np.zeros((2 * masses, masses, *batch))
    for i in range(masses):
        A[i, masses + i] = 1.0
        B[masses + i, i] = 1.0 / J[i]
    for k in range(masses - 1):
        for block, constant in ((0, values[f"c{k + 1}"]), (masses, values[f"d{k + 1}"])):
            for i, j in ((k, k + 1), (k + 1, k)):
                A[masses + i, block + i] -= constant / J[i]
                A[masses + i, block + j] += constant / J[i]
    states = tuple(State(f"q{i + 1}", POSITION, "position") for i in range(masses))
    states += tuple(State(f"v{i + 1}", SPEED, "speed") for i in range(masses))
    return Draft(states, masses, A, B, draft.elements, draft.dead_time)


def _spread(scales: Scales, share: Array, masses: int) -> Array:
    """Plausible ladders: what a recording shows are total inertia, resonances and their damping, not each constant.

    The total inertia comes from the torque balance; it is divided mass by mass; each shaft's resonance is that of
    all inertia before it against all behind it, uniform in the logarithm over the visible frequencies.
    """
    total = scales.inertia * _TOTAL ** (2.0 * share[0] - 1.0)
    part = 1.0 / (1.0 + _DIVISION ** (1.0 - 2.0 * share[1:masses]))
    left = np.cumprod(np.concatenate([np.ones_like(share[:1]), 1.0 - part]), axis=0)
    J = total * left * np.concatenate([part, np.ones_like(share[:1])])
    behind = total * left[1:]
    reduced = (total - behind) * behind / total
    turning = slowest(scales) * (fastest(scales) / slowest(scales)) ** share[masses : 2 * masses - 1]
    ratio = _LEAST_DAMPED * (1.0 / _LEAST_DAMPED) ** share[2 * masses - 1 :]
    return np.concatenate([J, reduced * turning**2, 2.0 * ratio * reduced * turning])


def _noticeable(scales: Scales, values: Values, masses: int) -> Mapping[str, float]:
    """A tenth of the last inertia of the shorter ladder comes loose, and rings below a third of Nyquist's frequency."""
    last = values[f"J{masses - 1}"]
    loose, rest = 0.1 * last, 0.9 * last
    turning = _LOOSE * fastest(scales)
    reduced = loose * rest / last
    return {
        f"J{masses - 1}": rest,
        f"J{masses}": loose,
        f"c{masses - 1}": reduced * turning**2,
        f"d{masses - 1}": 0.04 * reduced * turning,
    }


def _regroup(values: Array, share: Array, turning: Array, masses: int) -> Array:
    """Two neighbours become one mass, and one of the masses becomes two behind a shaft that rings at `turning`.

    A recording shows resonances, not which shaft each belongs to: the same ones appear in several orders. Where
    `turning` is not a number, the new shaft is stiff.
    """
    out = values.copy()
    for k, draw in enumerate(share.T):
        J, c, d = (values[part, k].tolist() for part in _parts(masses))
        stiff = _STIFFER ** (draw[-1] - 0.3) * np.sqrt(max(c) / min(J))
        ringing = turning[k] if np.isfinite(turning[k]) else stiff
        merged, split = (min(int(part * (masses - 1)), masses - 2) for part in draw[:2])
        out[:, k] = _moved(J, c, d, merged, split, 0.05 + 0.9 * draw[2], _LEAST_DAMPED ** draw[3], ringing)
    return out


def _fewer(values: Mapping[str, float], masses: int) -> Mapping[str, float]:
    """Neighbours that move together the most become one mass until `masses` are left.

    These are those whose shaft would ring the fastest, c (1/J + 1/J').
    """
    present = sum(symbol.startswith("J") for symbol in values)
    J = [values[f"J{i}"] for i in range(1, present + 1)]
    c, d = ([values[f"{symbol}{k}"] for k in range(1, present)] for symbol in "cd")
    while len(J) > masses:
        k = max(range(len(c)), key=lambda k: c[k] * (1.0 / J[k] + 1.0 / J[k + 1]))
        _join(J, c, d, k)
    named = (("J", J), ("c", c), ("d", d))
    return {f"{symbol}{i}": value for symbol, row in named for i, value in enumerate(row, 1)}


def _ways(values: Array, turning: Array, masses: int) -> Array:
    """Each pair of neighbours merged and each mass split, with inertia and damping on a grid."""
    J, c, d = (values[part].tolist() for part in _parts(masses))
    pairs = range(masses - 1)
    ways = list(product(pairs, pairs, _PARTS, _RATIOS))
    table = [[_moved([*J], [*c], [*d], *way, ringing) for way in ways] for ringing in turning.tolist()]
    return np.moveaxis(np.array(table), 2, 0)


def _moved(
    J: list[float], c: list[float], d: list[float], merged: int, split: int, part: float, ratio: float, ringing: float
) -> list[float]:
    """Values with a shaft less behind one mass and a new one in another, which has `part` of its inertia before it."""
    _join(J, c, d, merged)
    reduced = J[split] * part * (1.0 - part)
    J[split : split + 1] = [J[split] * part, J[split] * (1.0 - part)]
    c.insert(split, reduced * ringing**2)
    d.insert(split, 2.0 * ratio * reduced * ringing)
    return [*J, *c, *d]


def _join(J: list[float], c: list[float], d: list[float], k: int) -> None:
    """Make one mass of the k-th and the next."""
    J[k : k + 2] = [J[k] + J[k + 1]]
    del c[k], d[k]


def _parts(masses: int) -> tuple[slice, slice, slice]:
    """Where inertias, springs and dampers stand among the parameters."""
    return slice(masses), slice(masses, 2 * masses - 1), slice(2 * masses - 1, None)


def _drawing(masses: int) -> Modelica:
    """Masses and shafts in a row, the motor's torque on the first."""
    starts = "$q(start = start_q{0}, fixed = true), $v(start = start_v{0}, fixed = true)"
    components = [("$library.Sources.$Force", "motor", "")]
    components += [
        ("$library.Components.$Mass", f"mass{i}", f"$m = $J{i}, {starts.format(i)}") for i in range(1, masses + 1)
    ]
    equations = ["connect(motor.flange, mass1.flange_a)"]
    for k in range(1, masses):
        components.append(("$library.Components.SpringDamper", f"shaft{k}", f"c = $c{k}, d = $d{k}"))
        equations.append(f"connect(mass{k}.flange_b, shaft{k}.flange_a)")
        equations.append(f"connect(shaft{k}.flange_b, mass{k + 1}.flange_a)")
    return Modelica(components=tuple(components), equations=tuple(equations))


def mass_chain(name: str, masses: int) -> Effect:
    """Multiple-mass effect with `masses` masses."""

    def stamp(draft: Draft, place: int, values: Values) -> Draft:
        return _stamp(draft, masses, values)

    shafts: Any = range(1, masses)
    parameters = (
        *(inertia_name(i, masses) for i in range(1, masses + 1)),
        *(stiffness_name(k, masses) for k in shafts),
        *(damping_name(k, masses) for k in shafts),
    )
    coupled = "" if masses == 1 else ", coupled in a row by springs and dampers"
    return Effect(
        name=name,
        number=masses,
        title=f"{name.split('_')[0].capitalize()}-mass system",
        about=f"{masses} inert mass{'es' if masses > 1 else ''}{coupled}; motor and sensor at mass 1.",
        equation="M q'' + D q' + C q = F" if masses > 1 else "J1 q'' = F",
        source="paper eq. (1), (7), (8)",
        stage="masses",
        where="drive",
        parameters=parameters,
        stamp=stamp,
        masses=masses,
        memory=True,
        spread=lambda scales, share: _spread(scales, share, masses),
        noticeable=(lambda scales, values: _noticeable(scales, values, masses)) if masses > 1 else None,
        regroup=(lambda values, share, turning: _regroup(values, share, turning, masses)) if masses > 1 else None,
        fewer=_fewer if masses > 1 else None,
        ways=(lambda values, turning: _ways(values, turning, masses)) if masses > 1 else None,
        modelica=_drawing(masses),
    )
