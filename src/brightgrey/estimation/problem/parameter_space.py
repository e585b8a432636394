"""Free parameters of a fit: bounds, start values, scaling and samples.

Declarations and scales of the recording give bounds and start values; the user may override them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.effects import Scales, SearchHints
from brightgrey.errors import SettingsError, unknown_name
from brightgrey.estimation.problem.nuisance import Nuisance
from brightgrey.kit import Structure
from brightgrey.numerics.sobol import sobol_points

__all__ = ["Block", "ParameterSpace", "SpaceOptions", "parameter_space"]


@dataclass(frozen=True)
class SpaceOptions:
    """Tolerance and sampling of a parameter space."""

    #: A parameter closer to a bound than this part of its range counts as being at the bound.
    bound_tolerance: float = 1e-4
    near_factor: float = 3.0  #: Samples near the declared start value are within this factor of it.
    near_share: float = 0.6  #: Share of the samples, in each parameter, that are near the declared start value.


class Block(NamedTuple):
    """Parameters (rows of the space) that are sampled together, and the declared functions that do it; see `Effect`."""

    rows: tuple[int, ...]
    sample: Callable[[Scales, Array], Array]
    hints: SearchHints


@dataclass(frozen=True)
class ParameterSpace:
    """Free parameters and their transform to a scaled space: logarithm, or value over the width of the range."""

    names: tuple[str, ...]  #: Free parameters.
    #: Bounds and start values, SI, shape (P,).
    low: Array
    high: Array
    start: Array
    log: NDArray[np.bool_]  #: True for parameters whose scaled value is a logarithm, shape (P,).
    fixed: Mapping[str, float]  #: Parameters that are not estimated, SI.
    scales: Scales  #: Scales of the recordings.
    blocks: tuple[Block, ...]  #: Parameters that are sampled together.
    not_sampled: NDArray[np.bool_]  #: True for parameters that have their start value in all samples, shape (P,).
    periods: Mapping[str, float] = field(default_factory=dict)  #: Of parameters that repeat, SI, by name.
    options: SpaceOptions = field(default_factory=SpaceOptions)

    @cached_property
    def width(self) -> Array:
        """Unit of the scaled space for linear parameters, shape (P,); 1 for logarithmic ones and empty ranges."""
        return np.where(self.log | (self.high <= self.low), 1.0, self.high - self.low)

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Bounds in the scaled space, each of shape (P,)."""
        return self.to_scaled(self.low), self.to_scaled(self.high)

    def to_scaled(self, values: Array) -> Array:
        """Transform SI values, shape (P,) or (P, K), to the scaled space."""
        log, width = (a.reshape(-1, *(1,) * (np.ndim(values) - 1)) for a in (self.log, self.width))
        return np.where(log, np.log(np.where(log, values, 1.0)), values / width)

    def from_scaled(self, theta: Array) -> Array:
        """Transform from the scaled space, shape (P,) or (P, K), to SI values, clipped to the bounds."""
        log, width = (a.reshape(-1, *(1,) * (np.ndim(theta) - 1)) for a in (self.log, self.width))
        return self.clip(np.where(log, np.exp(np.where(log, theta, 0.0)), theta * width))

    def scale_derivative(self, values: Array) -> Array:
        """Derivative of SI `values`, shape (P,), by the scaled ones."""
        return np.where(self.log, values, self.width)

    def active_bounds(self, values: Array) -> NDArray[np.int64]:
        """Active bounds of SI `values`, shape (P,): -1 at the low bound, 1 at the high one, 0 inside."""
        theta, (low, high) = self.to_scaled(values), self.box
        near = self.options.bound_tolerance * (high - low)
        return np.where(theta - low <= near, -1, np.where(high - theta <= near, 1, 0))

    def named(self, values: Array) -> dict[str, Array]:
        """All parameters by name, each of shape (K,), from free ones, shape (P, K), and the fixed ones."""
        rest = {name: np.full(values.shape[1], value) for name, value in self.fixed.items()}
        return dict(zip(self.names, values, strict=True)) | rest

    def by_name(self, values: Array) -> dict[str, float]:
        """All parameters by name, from free ones, shape (P,), and the fixed ones."""
        return dict(zip(self.names, values.tolist(), strict=True)) | dict(self.fixed)

    def clip(self, values: Array) -> Array:
        """Clip SI values, shape (P,) or (P, K), to the bounds."""
        low, high = (a.reshape(-1, *(1,) * (np.ndim(values) - 1)) for a in (self.low, self.high))
        return np.clip(values, low, high)

    def recentred(self, theta: Array) -> Array:
        """Scaled values, shape (..., P), that mean the same and are no longer near the ends of their range.

        So no descent stays at a bound of an angle. What lies within three quarters of a period of the middle is left as
        it is: an angle near pi does not change its sign from fit to fit.
        """
        rows = [i for i, name in enumerate(self.names) if name in self.periods]
        period = np.array([self.periods[self.names[i]] for i in rows])
        middle = 0.5 * (self.low[rows] + self.high[rows])
        out = theta.copy()
        off = (theta[..., rows] * self.width[rows] - middle) / period
        out[..., rows] -= np.where(np.abs(off) > 0.75, np.round(off), 0.0) * period / self.width[rows]
        return out

    def fix(self, name: str, value: float) -> ParameterSpace:
        """Space without the free parameter `name`, which is fixed at `value`, SI, and is sampled with no others."""
        rest = [i for i, free in enumerate(self.names) if free != name]
        blocks = tuple(b._replace(rows=tuple(map(rest.index, b.rows))) for b in self.blocks if set(b.rows) <= set(rest))
        parts = {key: getattr(self, key)[rest] for key in ("low", "high", "start", "log", "not_sampled")}
        names, fixed = tuple(self.names[i] for i in rest), {**self.fixed, name: value}
        return replace(self, names=names, fixed=fixed, blocks=blocks, **parts)

    def _independent_samples(self, share: Array) -> Array:
        """Samples from points of the unit cube, each parameter on its own: more often near the declared start."""
        (low, high), start = self.box, self.to_scaled(self.start)
        near_share = self.options.near_share
        reach = np.where(self.log, np.log(self.options.near_factor), 0.5 * np.abs(start) + 0.02)
        near = (np.maximum(start - reach, low), np.minimum(start + reach, high))
        inner = share / near_share
        outer = (share - near_share) / (1.0 - near_share)
        column = np.s_[:, None]
        theta = np.where(
            share < near_share,
            near[0][column] + inner * (near[1] - near[0])[column],
            low[column] + outer * (high - low)[column],
        )
        return self.from_scaled(theta)

    def sample(self, count: int, rng: np.random.Generator) -> Array:
        """Sample starts in SI, shape (P, count), by a Sobol sequence, where effects declare them plausible."""
        share = sobol_points(len(self.names), int(np.ceil(np.log2(max(count, 2)))), rng)[:count].T
        values = self._independent_samples(share)
        for block in self.blocks:
            rows = list(block.rows)
            values[rows] = block.sample(self.scales, share[rows])
        values = self.clip(values)
        values[self.not_sampled] = self.start[self.not_sampled, None]
        return values


def parameter_space(
    structure: Structure,
    scales: Scales,
    bounds: Mapping[str, tuple[float, float]],
    fixed: Mapping[str, float],
    nuisances: Sequence[Nuisance] = (),
) -> ParameterSpace:
    """Bounds and start values of the free parameters of `structure`.

    Parameters
    ----------
    structure : Structure
    scales : Scales
        Scales of the recordings.
    bounds : mapping of str to (low, high)
        Bounds in SI that replace the declared ones.
    fixed : mapping of str to float
        Values in SI of parameters that are not estimated.
    nuisances : sequence of Nuisance
        Estimated, too.

    Raises
    ------
    SettingsError
        For an unknown parameter, low > high, or a bound that is not positive although the parameter has to be.
    """
    declared = structure.parameters
    for name in (*bounds, *fixed):
        if name not in declared:
            raise SettingsError(unknown_name(f"parameter of '{structure}'", name, declared))
    names = tuple(name for name in declared if name not in fixed)
    ranges, starts = [], []
    for name in names:
        parameter = declared[name]
        low, high = bounds.get(name, parameter.bounds(scales))
        if not low <= high:
            raise SettingsError(f"bound of {name}: low {low:g} is above high {high:g}")
        if parameter.scale == "log" and low <= 0.0:
            raise SettingsError(f"bound of {name}: low {low:g} has to be positive")
        ranges.append((low, high))
        starts.append(float(np.clip(parameter.start(scales), low, high)))
    widths = {name: high - low for name, (low, high) in zip(names, ranges, strict=True)}
    periods = {n: declared[n].period for n, width in widths.items() if 2.0 * declared[n].period <= width < np.inf}
    log = np.array([declared[name].scale == "log" for name in names] + [part.log for part in nuisances], bool)
    table = np.array(ranges + [(part.low, part.high) for part in nuisances]).reshape(-1, 2)
    starts += [part.start for part in nuisances]
    names += tuple(part.name for part in nuisances)
    blocks = tuple(_blocks(structure, names, bounds))
    not_sampled = np.array([False] * len(ranges) + [not part.sampled for part in nuisances], bool)
    start = np.array(starts)
    return ParameterSpace(
        names, table[:, 0], table[:, 1], start, log, dict(fixed), scales, blocks, not_sampled, periods
    )


def _blocks(structure: Structure, names: tuple[str, ...], bounds: Mapping[str, tuple[float, float]]) -> Iterator[Block]:
    """Parameters that are sampled together: those of an effect that declares it, unless the user bounds one of them."""
    for placed in structure.placed:
        own = [placed.parameter(q.symbol) for q in placed.effect.parameters]
        hints = placed.effect.search
        if hints.sample is not None and all(name in names and name not in bounds for name in own):
            yield Block(tuple(names.index(name) for name in own), hints.sample, hints)
