"""Task of a search: recordings, and ranges of the parameters of all structures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import Parameter, Scales
from brightgrey.errors import one_of
from brightgrey.estimation.noise.error_floor import error_variances
from brightgrey.estimation.problem.decimation import decimated_together
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH, Nuisance
from brightgrey.estimation.problem.parameter_space import ParameterSpace, parameter_space
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem, predict_many
from brightgrey.kit import Grammar, Placed, Structure
from brightgrey.recordings import Recording
from brightgrey.search.criteria import Misfit
from brightgrey.simulation import Settings

__all__ = ["FAST_LEVEL_ACCURACY", "IdentificationTask"]

FAST_LEVEL_ACCURACY = 3e-4
"""Accuracy of the simulation at level ``fast``, that of searches; few of a hundred drives are worse."""


@dataclass(frozen=True)
class IdentificationTask:
    """Recordings, scales and limits that all structures of a search share."""

    recordings: tuple[Recording, ...]  #: Of one drive, with the same outputs.
    scales: Scales  #: Scales of the recordings; they give the ranges that `bounds` does not name.
    settings: Settings  #: Of the simulation.
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)  #: SI, by parameter name.
    fixed: Mapping[str, float] = field(default_factory=dict)  #: SI; these are not estimated.
    #: SI; standard start of parameters, instead of the one found in the recordings.
    start: Mapping[str, float] = field(default_factory=dict)
    friction_width: Nuisance | None = None  #: None if the settings give it.
    exact_friction: bool = False  #: Friction reverses at once: its width is 0 in all structures.
    drift: bool = False  #: Long recordings have a drift each, a nuisance.
    per_recording: tuple[str, ...] = ()  #: Parameters that may differ between the recordings.

    def check(self, grammar: Grammar) -> None:
        """Refuse bounds and values of parameters that no structure of `grammar` has (SettingsError)."""
        for name in (*self.bounds, *self.fixed):
            one_of("parameter", name, sorted(grammar.parameters))

    def space(self, structure: Structure, *, nuisances: bool = False) -> ParameterSpace:
        """Ranges of the free parameters of `structure`; with `nuisances` those of the nuisances, too."""
        return self.problem_and_space(structure)[1] if nuisances else self._space(structure, ())

    def problem_and_space(self, structure: Structure) -> tuple[SimulationErrorProblem, ParameterSpace]:
        """Residuals of `structure`, and ranges of its free parameters and of the nuisances."""
        problem = self.problem(structure)
        return problem, self._space(structure, problem.nuisances)

    def _space(self, structure: Structure, nuisances: Sequence[Nuisance]) -> ParameterSpace:
        limits, constants = self.bounds_of(structure), self.fixed_of(structure)
        space = parameter_space(structure, self.scales, limits, constants, nuisances)
        return space.fix(FRICTION_WIDTH, 0.0) if self.exact_friction and FRICTION_WIDTH in space.names else space

    def with_friction_of(self, *optima: Mapping[str, float]) -> IdentificationTask:
        """Task with exact friction if one of several optima has it."""
        exact = any(values.get(FRICTION_WIDTH) == 0.0 for values in optima)
        return replace(self, exact_friction=self.exact_friction or exact)

    def decimated(self) -> IdentificationTask:
        """Task with every k-th sample, for the largest k that all recordings allow."""
        return replace(self, recordings=decimated_together(self.recordings, self.scales.inertia))

    def bounds_of(self, structure: Structure) -> dict[str, tuple[float, float]]:
        """Those of `bounds` that `structure` has."""
        return {name: limits for name, limits in self.bounds.items() if name in structure.parameters}

    def fixed_of(self, structure: Structure) -> dict[str, float]:
        """Those of `fixed` that `structure` has."""
        return {name: value for name, value in self.fixed.items() if name in structure.parameters}

    def problem(self, structure: Structure) -> SimulationErrorProblem:
        """Residuals of `structure`, weighted by the noise of each output; made once for each structure."""
        if structure not in self._problems:
            self._problems[structure] = SimulationErrorProblem.of(
                structure,
                self.recordings,
                friction_width=self.friction_width,
                drift=self.drift,
                per_recording=self.per_recording,
            )
        return self._problems[structure]

    @cached_property
    def _problems(self) -> dict[Structure, SimulationErrorProblem]:
        return {}

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_problems"}

    def default_start(self, structure: Structure) -> dict[str, float]:
        """Start values, SI, of all parameters of `structure` that depend on nothing else."""
        space = self.space(structure)
        found = dict(zip(space.names, space.start.tolist(), strict=True)) | dict(space.fixed)
        return found | {name: value for name, value in self.start.items() if name in space.names}

    def draw(self, placed: Placed, rng: np.random.Generator) -> tuple[tuple[str, float], ...]:
        """Random values of a submodel's parameters within their ranges, by symbol.

        Uniform in the scale that is searched: the logarithm of what is always positive.
        """
        return tuple((q.symbol, self._draw(placed.parameter(q.symbol), q, rng)) for q in placed.effect.parameters)

    def _draw(self, name: str, declared: Parameter, rng: np.random.Generator) -> float:
        share = float(rng.random())  # drawn also where it is not needed: fixing a value must not change the others
        if name in self.fixed:
            return self.fixed[name]
        low, high = self.bounds.get(name) or declared.bounds(self.scales)
        if declared.scale == "log":
            return float(np.clip(low * (high / low) ** share, low, high))
        return low + share * (high - low)

    def weights(self, structure: Structure) -> Array:
        """Weights of the outputs' residuals in a misfit, shape (outputs,): 1 over the noise if there are several."""
        several = len(self.recordings[0].outputs) > 1
        return self.problem(structure).weights if several else np.ones(1)

    def error_floor(self, weights: Array, share: float) -> Array:
        """Weighted sum of squares of errors whose RMS is `share` of the output's standard deviation.

        Shapes (outputs,) of the weights and (recordings, outputs) of the result.
        """
        samples = np.array([[r.samples] for r in self.recordings])
        return np.asarray(samples * error_variances(self.recordings, weights, share))

    def misfits(self, structure: Structure, values: Mapping[str, Array]) -> list[Misfit]:
        """Misfit of each of K parameter sets; `values` holds arrays of shape (K,), SI.

        Unknown parts of initial states that `values` lack are taken from the first samples, and a width of friction's
        reversal that they lack from the settings.
        """
        outputs = len(self.recordings[0].outputs)
        rss: Array = np.zeros((outputs, 1))
        least, spread = np.zeros(outputs), np.zeros(outputs)
        problem = self.problem(structure)
        known = all(part.name in values for part in problem.unknown_initial)
        onsets = problem.initial_states if known else (None,) * len(self.recordings)
        for r, onset in zip(self.recordings, onsets, strict=True):
            y = predict_many(structure, values, r, self.settings, initial_state=onset)
            apart = np.moveaxis(y, 1, 2) - r.y[:, None, :]
            square = np.square(np.ascontiguousarray(apart)).sum(
                axis=2
            )  # one after the other: no set sees its neighbours
            rss = rss + np.where(np.isfinite(square), square, np.inf)
            least += r.samples * r.resolution**2 / 12.0
            spread += np.square(r.y - r.y.mean(axis=1, keepdims=True)).sum(axis=1)
        weights = self.weights(structure)
        rss = rss * weights[:, None] ** 2
        floor, about = (tuple((a * weights**2).tolist()) for a in (least, spread))
        samples = sum(r.samples for r in self.recordings)
        return [Misfit(tuple(column), floor, samples, about) for column in rss.T.tolist()]

    def misfit(self, structure: Structure, values: Mapping[str, float]) -> Misfit:
        """Misfit of one parameter set; what `values`, SI, hold beside parameters and nuisances of the task is left."""
        names = (*structure.parameters, *(part.name for part in self.problem(structure).nuisances))
        return self.misfits(structure, {n: np.array([values[n]]) for n in names if n in values})[0]

    def arrays(self, space: ParameterSpace, values: Array) -> dict[str, Array]:
        """Parameter sets by name; `values`, shape (P, K), SI, holds the free ones."""
        count = values.shape[1]
        held = {name: np.full(count, value) for name, value in space.fixed.items()}
        return dict(zip(space.names, values, strict=True)) | held

    def clip_starts(self, space: ParameterSpace, starts: Sequence[tuple[tuple[str, float], ...]]) -> Array:
        """Starts within the ranges, shape (P, K), SI; nuisances that they lack have their own start."""
        own = dict(zip(space.names, space.start.tolist(), strict=True))
        table = np.array([[{**own, **dict(start)}[name] for name in space.names] for start in starts])
        table = table.T.reshape(-1, len(starts))
        return np.asarray(np.clip(table, space.low[:, None], space.high[:, None]))
