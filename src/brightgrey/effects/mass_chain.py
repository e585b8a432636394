"""Masses in a row, coupled by springs and dampers: the declaration that the four multiple-mass effects share.

Paper section 2.1 and eq. (1), (7), (8).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, product

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects.effect import Effect, Fault, Parameter, SearchHints
from brightgrey.effects.modelica import Modelica
from brightgrey.effects.quantities import DAMPING, INERTIA, STIFFNESS, Scales
from brightgrey.effects.symbol import Stroke, Symbol
from brightgrey.effects.system import Draft, Values

__all__ = ["ChainHeuristics", "mass_chain"]


@dataclass(frozen=True)
class ChainHeuristics:
    """Tuned numbers by which plausible chains of masses are drawn. Frequencies are those of the undamped shaft.

    Attributes
    ----------
    total_factor : float
        The total inertia lies within this factor of the torque balance's.
    division_factor : float
        The inertia of a mass lies within this factor of that of all masses behind it.
    min_damping_ratio : float
        Least damping ratio of a shaft; the largest is 1.
    stiff_range : float
        Range of frequencies, as a ratio, from which a new stiff shaft is drawn.
    grid_parts : tuple of float
        Grid for a mass that is split: share of its inertia before the new shaft.
    grid_damping_ratios : tuple of float
        Grid for the damping ratio of the new shaft.
    softest_shaft : float
        Least spring constant, in parts of that with which the whole inertia swings twice in the recording.
    relevant_part : float
        Least share of the last inertia that matters for control if it comes loose.
    relevant_frequency : float
        Frequency at which that part resonates, as a share of Nyquist's frequency.
    relevant_damping_ratio : float
        Damping ratio of that resonance.
    """

    total_factor: float = 1.5
    division_factor: float = 30.0
    min_damping_ratio: float = 5e-3
    stiff_range: float = 10.0
    grid_parts: tuple[float, ...] = (0.05, 0.2, 0.5, 0.8, 0.95)
    grid_damping_ratios: tuple[float, ...] = (1e-3, 3e-2)
    softest_shaft: float = 0.05
    relevant_part: float = 0.1
    relevant_frequency: float = 0.3
    relevant_damping_ratio: float = 0.02


CHAIN_HEURISTICS = ChainHeuristics()


def mass_chain(name: str, masses: int) -> Effect:
    """Declare the multiple-mass effect with `masses` masses."""
    shafts = range(1, masses)
    parameters = (
        *(_inertia(i, masses) for i in range(1, masses + 1)),
        *(_stiffness(k, masses) for k in shafts),
        *(_damping(k, masses) for k in shafts),
    )
    hints = SearchHints(sample=partial(_sample_chains, masses=masses))
    if masses > 1:
        hints = SearchHints(
            sample=hints.sample,
            perturb=partial(_perturb_chains, masses=masses),
            enumerate=partial(_enumerate_chains, masses=masses),
            merge=_merge_masses,
        )
    coupled = "" if masses == 1 else ", coupled in a row by springs and dampers"
    return Effect(
        name=name,
        number=masses,
        title=f"{name.split('_')[0].capitalize()}-mass system",
        words=("one mass", "a second mass", "a third mass", "a fourth mass")[masses - 1],
        about=(
            f"{masses} inert mass{'es' if masses > 1 else ''}{coupled}. Input and sensors are at mass 1 unless the "
            "recording says otherwise."
        ),
        matters=(
            "the load or the structure resonates within the bandwidth of the speed loop"
            if masses > 1
            else "always; it is enough where every resonance lies far above the bandwidth of the loops"
        ),
        confused_with=(
            "fewer masses with friction at the load, with a gap, or with dead time; a slow drift, where a shaft is soft"
            if masses > 1
            else "an unknown gain of the input, which scales inertia and all torques alike"
        ),
        equation="M q'' + D q' + C q = F" if masses > 1 else "J1 q'' = F",
        source="paper eq. (1), (7), (8)",
        stage="masses",
        where="drive",
        parameters=parameters,
        stamp=partial(_stamp_chain, masses=masses),
        masses=masses,
        relevant_size=partial(_split_last_mass, masses=masses) if masses > 1 else None,
        search=hints,
        symbols=_chain_symbols(masses),
        modelica=_draw_chain(masses),
    )


def _slowest(scales: Scales) -> float:
    """Lowest angular frequency in rad/s worth looking for: two periods in the recording."""
    return 2.0 * np.pi * 2.0 / scales.duration


def _softest(scales: Scales) -> float:
    """Least spring constant of a shaft: with it the whole inertia swings half a period in the recording."""
    return CHAIN_HEURISTICS.softest_shaft * scales.inertia * _slowest(scales) ** 2


def _fastest(scales: Scales) -> float:
    """Highest angular frequency in rad/s that samples can show: Nyquist's."""
    return np.pi / scales.interval


def _inertia(i: int, masses: int) -> Parameter:
    """Moment of inertia of mass i: about the total inertia if it is alone, otherwise anything below that.

    The last mass carries the load. On a soft shaft the motor moves alone, and the loads may be far heavier than the
    inertia that the motion shows.
    """
    low = 0.2 if masses == 1 else 0.001
    high = 5.0 if i == 1 else 50.0
    return Parameter(
        f"J{i}",
        INERTIA,
        f"inertia of mass {i}",
        bounds=lambda s: (low * s.inertia / s.inertia_factor, high * s.inertia),
        start=lambda s: s.inertia / masses,
        fault=Fault("load", grows=False) if i == masses else None,
    )


def _stiffness(k: int, masses: int) -> Parameter:
    """Spring constant of shaft k: from one that would follow any drift, if it were softer, to Nyquist's frequency."""
    return Parameter(
        f"c{k}",
        STIFFNESS,
        f"spring constant between mass {k} and {k + 1}",
        bounds=lambda s: (_softest(s), 0.5 * s.inertia * _fastest(s) ** 2),
        start=lambda s: s.inertia / (2.0 * masses) * _slowest(s) * _fastest(s),
    )


def _damping(k: int, masses: int) -> Parameter:
    """Damper constant of shaft k: from a ringing of hundreds of periods to an overdamped shaft."""
    return Parameter(
        f"d{k}",
        DAMPING,
        f"damper constant between mass {k} and {k + 1}",
        bounds=lambda s: (1e-4 * s.inertia * _slowest(s), 0.5 * s.inertia * _fastest(s)),
        start=lambda s: 0.1 * s.inertia / (2.0 * masses) * np.sqrt(_slowest(s) * _fastest(s)),
    )


def _stamp_chain(draft: Draft, place: int, values: Values, *, masses: int) -> Draft:
    """Fill the empty draft with the chain of masses (eq. 7, 8)."""
    J = [values[f"J{i}"] for i in range(1, masses + 1)]
    c, d = ([values[f"{symbol}{k}"] for k in range(1, masses)] for symbol in "cd")
    return Draft.mass_chain(J, c, d)


def _sample_chains(scales: Scales, share: Array, *, masses: int) -> Array:
    """Draw plausible chains. A recording shows total inertia, resonances and their damping, not each constant.

    The total inertia comes from the torque balance and is divided mass by mass. The resonance of each shaft is that
    of all inertia before it against all behind it, uniform in the logarithm over the visible frequencies.
    """
    factor = CHAIN_HEURISTICS.total_factor
    total = scales.inertia / (factor * scales.inertia_factor) * (scales.inertia_factor * factor**2) ** share[0]
    part = 1.0 / (1.0 + CHAIN_HEURISTICS.division_factor ** (1.0 - 2.0 * share[1:masses]))
    left = np.cumprod(np.concatenate([np.ones_like(share[:1]), 1.0 - part]), axis=0)
    J = total * left * np.concatenate([part, np.ones_like(share[:1])])
    behind = total * left[1:]
    reduced = (total - behind) * behind / total
    omega = _slowest(scales) * (_fastest(scales) / _slowest(scales)) ** share[masses : 2 * masses - 1]
    least = CHAIN_HEURISTICS.min_damping_ratio
    ratio = least * (1.0 / least) ** share[2 * masses - 1 :]
    c = np.maximum(reduced * omega**2, _softest(scales))
    return np.concatenate([J, c, 2.0 * ratio * reduced * omega])


def _split_last_mass(scales: Scales, values: Values, place: int, *, masses: int) -> Mapping[str, float]:
    """Split the last mass of the shorter chain: a part comes loose and resonates below Nyquist's frequency."""
    last = values[f"J{masses - 1}"]
    loose, rest = CHAIN_HEURISTICS.relevant_part * last, (1.0 - CHAIN_HEURISTICS.relevant_part) * last
    omega = CHAIN_HEURISTICS.relevant_frequency * _fastest(scales)
    reduced = loose * rest / last
    return {
        f"J{masses - 1}": rest,
        f"J{masses}": loose,
        f"c{masses - 1}": reduced * omega**2,
        f"d{masses - 1}": 2.0 * CHAIN_HEURISTICS.relevant_damping_ratio * reduced * omega,
    }


def _perturb_chains(values: Array, share: Array, omega: Array, *, masses: int) -> Array:
    """Join two neighbours and split one of the masses behind a new shaft that resonates at `omega`.

    A recording shows resonances, not the shafts that they belong to: the same ones appear in several orders. Where
    `omega` is not a number, the new shaft is stiff.
    """
    out = values.copy()
    for k, draw in enumerate(share.T):
        J, c, d = (values[rows, k].tolist() for rows in _rows(masses))
        stiff = CHAIN_HEURISTICS.stiff_range ** (draw[-1] - 0.3) * np.sqrt(max(c) / min(J))
        resonance = omega[k] if np.isfinite(omega[k]) else stiff
        joined, split = (min(int(part * (masses - 1)), masses - 2) for part in draw[:2])
        ratio = CHAIN_HEURISTICS.min_damping_ratio ** draw[3]
        out[:, k] = _join_and_split(J, c, d, joined, split, 0.05 + 0.9 * draw[2], ratio, resonance)
    return out


def _enumerate_chains(values: Array, omega: Array, *, masses: int) -> Array:
    """Join each pair of neighbours and split each mass, with inertia and damping on a grid."""
    J, c, d = (values[rows].tolist() for rows in _rows(masses))
    pairs = range(masses - 1)
    choices = list(product(pairs, pairs, CHAIN_HEURISTICS.grid_parts, CHAIN_HEURISTICS.grid_damping_ratios))
    table = [
        [_join_and_split([*J], [*c], [*d], *choice, resonance) for choice in choices] for resonance in omega.tolist()
    ]
    return np.moveaxis(np.array(table), 2, 0)


def _merge_masses(values: Mapping[str, float], masses: int) -> list[Mapping[str, float]]:
    """Join neighbours until `masses` are left, in every way, the last ones last.

    Which shaft is rigid is not told by its resonance: that of a light mass is fast, and yet shows.
    """
    present = sum(symbol.startswith("J") for symbol in values)
    found: list[Mapping[str, float]] = []
    for rigid in combinations(range(present - 1), present - masses):
        J = [values[f"J{i}"] for i in range(1, present + 1)]
        c, d = ([values[f"{symbol}{k}"] for k in range(1, present)] for symbol in "cd")
        for k in reversed(rigid):
            _join_masses(J, c, d, k)
        named = (("J", J), ("c", c), ("d", d))
        found.append({f"{symbol}{i}": value for symbol, row in named for i, value in enumerate(row, 1)})
    return found


def _join_and_split(
    J: list[float], c: list[float], d: list[float], joined: int, split: int, part: float, ratio: float, omega: float
) -> list[float]:
    """Remove the shaft behind one mass and put a new one into another, with `part` of its inertia before the shaft."""
    _join_masses(J, c, d, joined)
    reduced = J[split] * part * (1.0 - part)
    J[split : split + 1] = [J[split] * part, J[split] * (1.0 - part)]
    c.insert(split, reduced * omega**2)
    d.insert(split, 2.0 * ratio * reduced * omega)
    return [*J, *c, *d]


def _join_masses(J: list[float], c: list[float], d: list[float], k: int) -> None:
    """Make one mass of the k-th and the next, in place."""
    J[k : k + 2] = [J[k] + J[k + 1]]
    del c[k], d[k]


def _rows(masses: int) -> tuple[slice, slice, slice]:
    """Rows of inertias, springs and dampers among the parameters."""
    return slice(masses), slice(masses, 2 * masses - 1), slice(2 * masses - 1, None)


def _chain_symbols(masses: int) -> tuple[Symbol, ...]:
    """Discs (boxes, in a linear axis), and a spring beside a dashpot between them."""
    box: Stroke = ((0.0, 0.0), (44.0, 0.0), (44.0, 44.0), (0.0, 44.0), (0.0, 0.0))
    coil: Stroke = tuple((10.0 + 5.5 * i, 1.0 if i % 2 else 15.0) for i in range(1, 8))
    zigzag: Stroke = ((0.0, 8.0), (10.0, 8.0), *coil, (54.0, 8.0), (64.0, 8.0))
    pot: Stroke = ((44.0, 1.0), (24.0, 1.0), (24.0, 15.0), (44.0, 15.0))
    rod: Stroke = ((36.0, 8.0), (64.0, 8.0))
    dashpot: tuple[Stroke, ...] = (((0.0, 8.0), (24.0, 8.0)), pot, ((36.0, 3.0), (36.0, 13.0)), rod)
    found: list[Symbol] = []
    for i in range(1, masses + 1):
        linear = Symbol("body", 44.0, 44.0, (box,), letters=str(i), shows=(f"J{i}",), place=i, motion="linear")
        found += [replace(linear, lines=(), circles=((22.0, 22.0, 22.0),), motion="rotary"), linear]
    for k in range(1, masses):
        found.append(Symbol("spring", 64.0, 16.0, (zigzag,), shows=(f"c{k}",), place=k))
        found.append(Symbol("damper", 64.0, 16.0, dashpot, shows=(f"d{k}",), place=k))
    return tuple(found)


def _draw_chain(masses: int) -> Modelica:
    """Draw masses and shafts in a row, and the motor's torque, which the export connects to the driven mass."""
    starts = "$q(start = start_q{0}, fixed = true), $v(start = start_v{0}, fixed = true)"
    components = [("$library.Sources.$Force", "motor", "")]
    components += [
        ("$library.Components.$Mass", f"mass{i}", f"$m = $J{i}, {starts.format(i)}") for i in range(1, masses + 1)
    ]
    equations = []
    for k in range(1, masses):
        components.append(("$library.Components.SpringDamper", f"shaft{k}", f"c = $c{k}, d = $d{k}"))
        equations.append(f"connect(mass{k}.flange_b, shaft{k}.flange_a)")
        equations.append(f"connect(shaft{k}.flange_b, mass{k + 1}.flange_a)")
    return Modelica(components=tuple(components), equations=tuple(equations))
