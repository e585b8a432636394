"""Ranges and starts of all parameters, from the declarations and the recording, overridden by the user."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brightgrey.arrays import Array
from brightgrey.effects import Scales, SearchHints
from brightgrey.errors import SettingsError, unknown_name
from brightgrey.estimation.problem.initial_state import InitialStateParameter
from brightgrey.kit import Structure
from brightgrey.numerics.sobol import sobol_points

__all__ = ["ParameterSpace", "parameter_space"]

_NEAR = 3.0  # a start near the declared one is within this factor of it
_NEAR_SHARE = 0.6  # of the starts, in each parameter
_AT_BOUND = 1e-4  # of the searched range


class Block(NamedTuple):
    """Parameters (rows) that are drawn together, and how; see `Effect`."""

    rows: tuple[int, ...]
    sample: Callable[[Scales, Array], Array]
    hints: SearchHints


@dataclass(frozen=True)
class ParameterSpace:
    """Free parameters in the scale they are searched in: logarithm, or value over the range's width.

    Attributes
    ----------
    names : tuple of str
        Free parameters.
    low, high, start : ndarray, shape (P,)
        SI values.
    log : bool ndarray, shape (P,)
    fixed : mapping of str to float
        The other parameters, SI.
    scales : Scales
        Of the recordings.
    blocks : tuple of Block
        Parameters that are drawn together.
    still : bool ndarray, shape (P,)
        Parameters that begin at their start in all candidates.
    """

    names: tuple[str, ...]
    low: Array
    high: Array
    start: Array
    log: NDArray[np.bool_]
    fixed: Mapping[str, float]
    scales: Scales
    blocks: tuple[Block, ...]
    not_sampled: NDArray[np.bool_]

    @cached_property
    def width(self) -> Array:
        """Unit of the searched scale for linear parameters, 1 for logarithmic ones and those without a choice."""
        return np.where(self.log | (self.high <= self.low), 1.0, self.high - self.low)

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Bounds in the searched scale, each of shape (P,)."""
        return self.to_scaled(self.low), self.to_scaled(self.high)

    def to_scaled(self, values: Array) -> Array:
        """From SI values, shape (P,) or (P, K), to the searched scale."""
        log, width = (a.reshape(-1, *(1,) * (np.ndim(values) - 1)) for a in (self.log, self.width))
        return np.where(log, np.log(np.where(log, values, 1.0)), values / width)

    def from_scaled(self, theta: Array) -> Array:
        """From the searched scale to SI values; shapes as in `inward`."""
        log, width = (a.reshape(-1, *(1,) * (np.ndim(theta) - 1)) for a in (self.log, self.width))
        low, high = (a.reshape(-1, *(1,) * (np.ndim(theta) - 1)) for a in (self.low, self.high))
        return np.clip(np.where(log, np.exp(np.where(log, theta, 0.0)), theta * width), low, high)

    def scale_derivative(self, values: Array) -> Array:
        """Change of SI `values`, shape (P,), per change in the searched scale."""
        return np.where(self.log, values, self.width)

    def active_bounds(self, values: Array) -> NDArray[np.int64]:
        """Which of SI `values`, shape (P,), have run to the low bound (-1) or the high one (1); 0 inside."""
        theta, (low, high) = self.to_scaled(values), self.box
        near = _AT_BOUND * (high - low)
        return np.where(theta - low <= near, -1, np.where(high - theta <= near, 1, 0))

    def named(self, values: Array) -> dict[str, Array]:
        """By name, free parameters of shape (P, K) and fixed ones, each of shape (K,)."""
        rest = {name: np.full(values.shape[1], value) for name, value in self.fixed.items()}
        return dict(zip(self.names, values, strict=True)) | rest

    def _alone(self, share: Array) -> Array:
        """Starts from points of the unit cube, each parameter on its own: more often near the declared start."""
        (low, high), start = self.box, self.to_scaled(self.start)
        reach = np.where(self.log, np.log(_NEAR), 0.5 * np.abs(start) + 0.02)
        near = (np.maximum(start - reach, low), np.minimum(start + reach, high))
        inner = share / _NEAR_SHARE
        outer = (share - _NEAR_SHARE) / (1.0 - _NEAR_SHARE)
        column = np.s_[:, None]
        theta = np.where(
            share < _NEAR_SHARE,
            near[0][column] + inner * (near[1] - near[0])[column],
            low[column] + outer * (high - low)[column],
        )
        return self.from_scaled(theta)

    def sample(self, count: int, rng: np.random.Generator) -> Array:
        """Space-filling starts in SI, shape (P, count), where effects declare them plausible."""
        share = sobol_points(len(self.names), int(np.ceil(np.log2(max(count, 2)))), rng)[:count].T
        values = self._alone(share)
        for block in self.blocks:
            rows = list(block.rows)
            drawn = block.sample(self.scales, share[rows])
            values[rows] = np.clip(drawn, self.low[rows, None], self.high[rows, None])
        values[self.not_sampled] = self.start[self.not_sampled, None]
        return values


def parameter_space(
    structure: Structure,
    scales: Scales,
    bounds: Mapping[str, tuple[float, float]],
    fixed: Mapping[str, float],
    unknown: Sequence[InitialStateParameter] = (),
) -> ParameterSpace:
    """Ranges and starts of the free parameters of `structure`.

    Parameters
    ----------
    structure : Structure
    scales : Scales
        Of the recordings.
    bounds : mapping of str to (low, high)
        SI; override the declared ranges.
    fixed : mapping of str to float
        SI; these are not searched.
    unknown : sequence of InitialStateParameter
        Parts of initial states that are searched for, too.

    Raises
    ------
    SettingsError
        For unknown parameters, low > high, or a range that its parameter's scale does not allow.
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
    log = np.array([declared[name].scale == "log" for name in names] + [False] * len(unknown), bool)
    table = np.array(ranges + [(part.low, part.high) for part in unknown]).reshape(-1, 2)
    starts += [part.start for part in unknown]
    names += tuple(part.name for part in unknown)
    blocks = tuple(_together(structure, names, bounds))
    still = np.array([False] * len(ranges) + [not part.drawn for part in unknown], bool)
    return ParameterSpace(names, table[:, 0], table[:, 1], np.array(starts), log, dict(fixed), scales, blocks, still)


def _together(
    structure: Structure, names: tuple[str, ...], bounds: Mapping[str, tuple[float, float]]
) -> Iterator[Block]:
    """Parameters that are drawn together: those of an effect that says how, unless the user decides on one."""
    for placed in structure.placed:
        own = [placed.parameter(q.symbol) for q in placed.effect.parameters]
        hints = placed.effect.search
        if hints.sample is not None and all(name in names and name not in bounds for name in own):
            yield Block(tuple(names.index(name) for name in own), hints.sample, hints)
