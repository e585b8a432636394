"""Start points whose sizes balance the torques: a regression for each sample, without a simulation.

The torques of most effects are linear in one parameter, their size: Coulomb friction in its torque, the inertia in
itself. For given other parameters (the speed at which Stribeck friction fades, the period of a position-dependent load,
the dead time) the sizes follow from the measured motion by linear regression. So is the inverse dynamic model of robots
identified (Gautier, Khalil 1988, doi:10.1109/CDC.1988.194724). Then only the other parameters have to be sampled,
which is variable projection (Golub, Pereyra 1973, doi:10.1137/0710036) on the equation error.

A load that is a sine of the position may have many periods over the travel. Draws hardly meet the right number of them.
Its wave number and phase are taken from the spectrum, over the position, of the torque that the other terms leave
(Lomb 1976, doi:10.1007/BF00648343).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.options import TORQUE_REGRESSION_DEFAULTS, TorqueRegressionOptions
from brightgrey.estimation.problem.nuisance import friction_gain
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.estimation.problem.torque_balance import inertias, lags_of, rigid_torque, sizes_of, torque_kinds
from brightgrey.kit import Structure, slowest_resonance
from brightgrey.numerics.bounded_least_squares import bounded_least_squares
from brightgrey.recordings import Recording
from brightgrey.recordings.checks.examined import Examined, SmoothedMotion
from brightgrey.recordings.units.signals import KINDS
from brightgrey.simulation import Settings

__all__ = ["with_regressed_sizes", "with_waves"]


def with_regressed_sizes(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    samples: Array,
    options: TorqueRegressionOptions = TORQUE_REGRESSION_DEFAULTS,
) -> Array | None:
    """Replace the sizes of samples by those that balance the torques of a rigid drive.

    Parameters
    ----------
    problem : SimulationErrorProblem
    space : ParameterSpace
    settings : Settings
        Its gain of the sign of friction holds where the width of the reversal is not among the parameters.
    samples : ndarray, shape (P, K)
        SI.
    options : TorqueRegressionOptions

    Returns
    -------
    ndarray, shape (P, K), or None
        SI, within the bounds. Inertias keep their ratios, and so do sizes of one kind at several masses. None if no
        size is free, or if the first output of a recording has no sign, is an acceleration, or does not move.
    """
    examined = [e for e in map(_motion_of, problem.recordings) if e is not None]
    free = [names for names in _sizes_by_kind(problem.structure) if set(names) <= set(space.names)]
    if len(examined) < len(problem.recordings) or not samples.size or not free:
        return None
    values, out = space.named(samples), samples.copy()
    for widths, which in _by_width(problem.structure, values, examined, options).items():
        part = {name: value[which] for name, value in values.items()}
        motions = [e.motion_smoothed(0, width) for e, width in zip(examined, widths, strict=True)]
        f_tanh = _sign_gains(part, settings, len(which))
        sizes = _regressed_sizes(problem.structure, space, motions, part, f_tanh, options)
        out[np.ix_([space.names.index(name) for name in sizes], which)] = list(sizes.values())
    return space.clip(out)


def with_waves(
    problem: SimulationErrorProblem,
    space: ParameterSpace,
    settings: Settings,
    samples: Array,
    options: TorqueRegressionOptions = TORQUE_REGRESSION_DEFAULTS,
) -> Array:
    """Take wave numbers and phases of position-dependent loads from the spectrum of the torque over the position.

    Parameters
    ----------
    problem : SimulationErrorProblem
    space : ParameterSpace
    settings : Settings
        Its gain of the sign of friction holds where the width of the reversal is not among the parameters.
    samples : ndarray, shape (P, K)
        SI. The highest peaks go to them in turn.
    options : TorqueRegressionOptions

    Returns
    -------
    ndarray, shape (P, K)
        SI, within the bounds. As they were for structures without such a load, and where the motion is not known.
    """
    out, structure = samples.copy(), problem.structure
    waves = [(g, wave) for g in torque_kinds(structure) if (wave := g[0].effect.search.wave) is not None]
    examined = [e for e in map(_motion_of, problem.recordings) if e is not None] if waves else []
    if not (examined and out.size) or len(examined) < len(problem.recordings):
        return out
    first = space.named(samples[:, :1])
    f_tanh = _sign_gains(first, settings, 1)
    ((widths, _),) = _by_width(structure, first, examined, options).items()
    motions = [e.motion_smoothed(0, width) for e, width in zip(examined, widths, strict=True)]
    fastest = max(float(np.abs(motion.velocity).max()) for motion in motions)
    highest = 0.5 * np.pi / (fastest * max(r.dt for r in problem.recordings))  # four samples per period
    for group, symbols in waves:
        rows = [[p.parameter(symbol) for p in group] for symbol in symbols]
        if not {name for names in rows for name in names} <= set(space.names):
            continue
        others = Structure(tuple(p for p in structure.placed if p not in group))
        number = space.names.index(rows[0][0])
        limits = float(space.low[number]), min(float(space.high[number]), highest)
        peaks = _wave_peaks(others, motions, first, f_tanh, limits, options)
        for k, peak in enumerate(peaks):
            for names, value in zip(rows, peak, strict=True):
                out[np.ix_([space.names.index(n) for n in names], range(k, out.shape[1], len(peaks)))] = value
    return space.clip(out)


def _sign_gains(values: Mapping[str, Array], settings: Settings, count: int) -> Array:
    """Gains of friction's sign, shape (K,), none sharper than that of the settings: the motion is measured."""
    return np.broadcast_to(np.minimum(friction_gain(values, settings.f_tanh), settings.f_tanh), count)


@lru_cache(maxsize=8)
def _motion_of(recording: Recording) -> Examined | None:
    """Recording for the regression; None if its first output does not show the motion."""
    signal, examined = recording.outputs[0], Examined(recording)
    return None if signal.kind == "speed" or KINDS[signal.kind] > 1 or not examined.moves else examined


def _sizes_by_kind(structure: Structure) -> list[tuple[str, ...]]:
    """Names of the sizes of each kind of torque, inertias first."""
    return [inertias(structure), *(sizes_of(group) for group in torque_kinds(structure))]


def _by_width(
    structure: Structure, values: Mapping[str, Array], examined: Sequence[Examined], options: TorqueRegressionOptions
) -> dict[tuple[float, ...], list[int]]:
    """Samples by the widths of the kernels, one per recording, above which noise is gone and their drive is rigid."""
    least = [motion.width if (motion := e.motion()) else e.widths[0] for e in examined]
    found: dict[tuple[float, ...], list[int]] = {}
    for k in range(len(next(iter(values.values())))):
        resonance = slowest_resonance(structure, {name: float(value[k]) for name, value in values.items()})
        rigid = options.smoothing * 2.0 * np.pi / max(resonance, 1e-300)
        wanted = [max(width, rigid / e.dt) for width, e in zip(least, examined, strict=True)]
        widths = [next((w for w in e.widths if w >= x), e.widths[-1]) for x, e in zip(wanted, examined, strict=True)]
        found.setdefault(tuple(widths), []).append(k)
    return found


def _regressed_sizes(
    structure: Structure,
    space: ParameterSpace,
    motions: Sequence[SmoothedMotion],
    values: Mapping[str, Array],
    f_tanh: Array,
    options: TorqueRegressionOptions,
) -> dict[str, Array]:
    """Regressed sizes by name, each of shape (K,), of K samples whose parameters are `values`."""
    kinds = _sizes_by_kind(structure)
    shares = {name: share for names in kinds for name, share in _parts_of_sum(names, values).items()}
    parts = [_torque_rows(structure, motion, {**values, **shares}, f_tanh, options) for motion in motions]
    u, terms = (np.concatenate(rows, axis=1) for rows in zip(*parts, strict=True))
    free = [set(names) <= set(space.names) for names in kinds]
    for i, names in enumerate(kinds):
        if not free[i]:
            u = u - np.sum([values[name] for name in names], axis=0)[:, None] * terms[:, :, i]
    terms, kinds = terms[:, :, free], [names for names, is_free in zip(kinds, free, strict=True) if is_free]
    effort, rms = (np.sqrt(np.mean(np.square(x), axis=1)) for x in (u, terms))
    unit = np.where(rms > 0.0, rms, 1.0)
    positive = np.array([bool(space.log[space.names.index(names[0])]) for names in kinds])
    q, r = np.linalg.qr(terms / unit[:, None, :])
    wanted = np.einsum("knt,kn->kt", q, u)
    none = np.full(len(kinds), np.inf)
    low = np.where(positive, options.least_torque * effort[:, None], -np.inf)
    found = np.array([bounded_least_squares(*args, none) for args in zip(r, wanted, low, strict=True)]) / unit
    return {name: shares[name] * found[:, i] for i, names in enumerate(kinds) for name in names}


def _wave_peaks(
    others: Structure,
    motions: Sequence[SmoothedMotion],
    values: Mapping[str, Array],
    f_tanh: Array,
    limits: tuple[float, float],
    options: TorqueRegressionOptions,
) -> list[tuple[float, float]]:
    """Wave number and phase at the highest peaks of the spectrum, over the position, of what other torques leave."""
    finer = replace(options, rows=options.wave_rows)
    parts = [_torque_rows(others, motion, values, f_tanh, finer) for motion in motions]
    u, terms = (np.concatenate(rows, axis=1)[0] for rows in zip(*parts, strict=True))
    q = np.concatenate([motion.position[_thinned(motion, finer)] for motion in motions])
    numbers, sine, cosine, gain = _position_spectrum(q, u, np.linalg.qr(terms)[0], limits, options)
    padded = np.pad(gain, 1, constant_values=-np.inf)
    peaks = np.flatnonzero((gain >= padded[:-2]) & (gain > padded[2:]))
    order = peaks[np.argsort(-gain[peaks], kind="stable")][: options.waves]
    best = [k for k in order if gain[k] >= options.wave_share * gain[order[0]]]
    return [(float(numbers[k]), float(np.arctan2(cosine[k], sine[k]))) for k in best]


def _position_spectrum(
    q: Array, u: Array, basis: Array, limits: tuple[float, float], options: TorqueRegressionOptions
) -> Array:
    """Wave numbers, sizes of sine and cosine of the position, and what both explain beyond an orthonormal `basis`.

    Shape (4, wave numbers).
    """
    left = u - basis @ (basis.T @ u)
    step = options.wave_step * 2.0 * np.pi / np.ptp(q)
    numbers = np.arange(max(step, limits[0]), limits[1], step)
    turned = np.exp(1j * np.outer(step * np.arange(min(options.wave_block, len(numbers))), q))
    parts = [np.empty((3, 0))]
    for k in range(0, len(numbers), options.wave_block):
        wave = turned[: len(numbers) - k] * np.exp(1j * numbers[k] * q)
        known, along, twice = wave @ basis, wave @ left, np.square(wave).sum(axis=1)
        cc = 0.5 * (q.size + twice.real) - np.square(known.real).sum(axis=1)
        ss = 0.5 * (q.size - twice.real) - np.square(known.imag).sum(axis=1)
        sc = 0.5 * twice.imag - (known.real * known.imag).sum(axis=1)
        clear = np.maximum(ss * cc - sc * sc, 1e-9 * q.size**2)  # slow waves are a part of a constant and a slope
        sine = (along.imag * cc - along.real * sc) / clear
        cosine = (along.real * ss - along.imag * sc) / clear
        parts.append(np.array([sine, cosine, sine * along.imag + cosine * along.real]))
    return np.concatenate([numbers[None, :], np.concatenate(parts, axis=1)])


def _thinned(motion: SmoothedMotion, options: TorqueRegressionOptions) -> slice:
    """Samples that are enough."""
    return slice(None, None, max(1, motion.t.size // options.rows))


def _parts_of_sum(names: Sequence[str], values: Mapping[str, Array]) -> dict[str, Array]:
    """Parts of the sizes of one kind in their sum, each of shape (K,); equal parts if all are zero."""
    sizes = np.abs([values[name] for name in names])
    total = sizes.sum(axis=0)
    parts = np.divide(sizes, total, out=np.full(sizes.shape, 1.0 / len(names)), where=total > 0.0)
    return dict(zip(names, parts, strict=True))


def _torque_rows(
    structure: Structure,
    motion: SmoothedMotion,
    values: Mapping[str, Array],
    f_tanh: Array,
    options: TorqueRegressionOptions,
) -> tuple[Array, Array]:
    """Delayed input, shape (K, n), and inertial and opposing torques for sizes of sum 1, shape (K, n, terms)."""
    thin = _thinned(motion, options)
    t, q, v, a = (x[thin] for x in (motion.t, motion.position, motion.velocity, motion.acceleration))
    count = len(f_tanh)
    lags = np.sum([values[name] for name in lags_of(structure)] or [np.zeros(count)], axis=0)
    u = np.array([np.interp(t - lag, motion.t, motion.u) for lag in lags])
    lanes = {name: np.repeat(value, t.size) for name, value in values.items()}
    gain, moving = np.repeat(f_tanh, t.size), (np.tile(q, count), np.tile(v, count))
    kinds = torque_kinds(structure)
    torques = [-rigid_torque(structure, group, lanes, *moving, gain).reshape(count, -1) for group in kinds]
    return u, np.stack([np.tile(a, (count, 1)), *torques], axis=-1)
