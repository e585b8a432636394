"""Parameter changes by simulation: factors on groups of a known drive's parameters, from one recording.

Each group that may have changed gets a free common factor. Every other parameter gets a factor with the model's
standard deviation as its prior. A simulation follows the contacts in a gap, which no filter with one state does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.noise.autoregression import noise_models
from brightgrey.estimation.optimisation.least_squares import fit_many, fit_to_convergence
from brightgrey.estimation.optimisation.multistart import multistart
from brightgrey.estimation.problem.initial_state import output_noise
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.estimation.uncertainty.covariance import gradient_covariance
from brightgrey.kit import Structure
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings

__all__ = ["ChangeEstimate", "ParameterGroup", "SimulatedChangeOptions", "estimate_changes"]


@dataclass(frozen=True)
class SimulatedChangeOptions:
    """Range and effort of the search."""

    max_factor: float = 5.0  #: Largest factor on a free group; its inverse is the smallest.
    max_prior_std: float = 5.0  #: Range of the other factors, in standard deviations of their prior.
    #: Of the multistart.
    starts: int = 8
    patience: int = 2
    restarts: int = 4  #: Optima from which a fit with one fixed factor starts.
    min_eigenvalue: float = 1e-10  #: Of the scaled information, over the largest one; smaller ones are raised to it.


SIMULATED_CHANGES = SimulatedChangeOptions()


class ParameterGroup(NamedTuple):
    """Parameters with a common factor, and the prior standard deviation of the factor's logarithm (inf: free)."""

    parameters: tuple[str, ...]
    prior_std: float

    @property
    def name(self) -> str:
        """Name of the factor."""
        return "factor of " + ", ".join(self.parameters)

    @property
    def free(self) -> bool:
        """True without prior knowledge."""
        return not np.isfinite(self.prior_std)


class ChangeEstimate(NamedTuple):
    """Estimated changes of the groups."""

    log_factors: Array  #: Shape (groups,).
    #: Standard deviations of the logarithms; very large where the recording does not determine a factor, shape
    #: (groups,).
    std: Array


def estimate_changes(
    structure: Structure,
    values: Mapping[str, float],
    groups: Sequence[ParameterGroup],
    recording: Recording,
    settings: Settings,
    *,
    min_change: float,
    options: SimulatedChangeOptions = SIMULATED_CHANGES,
) -> ChangeEstimate:
    """Fit the factors with which the model explains a recording best.

    Parameters
    ----------
    structure : Structure
    values : mapping of str to float
        The model's parameters, SI.
    groups : sequence of ParameterGroup
    recording : Recording
    settings : Settings
        Of the final fits; the multistart runs at the ``fast`` level.
    min_change : float
        Smallest logarithm of a factor that is of interest. Every free factor beyond it is fixed at this value and the
        rest is fitted again. The likelihood ratio then gives the standard deviation, because with a gap the quadratic
        approximation of the cost is often too narrow.
    options : SimulatedChangeOptions

    Returns
    -------
    ChangeEstimate
        The standard deviations allow for correlated residuals, as in
        :mod:`brightgrey.estimation.uncertainty.covariance`.
    """
    problem = _ProblemWithPrior.of(structure, [recording])
    space = _factor_space(values, groups, recording, problem, options)
    problem = replace(problem, prior_stds={group.name: group.prior_std for group in groups if not group.free})
    fast = replace(settings, level="fast")
    # the declared start is the healthy drive: as one that is given it is also descended from on the whole recording
    found = multistart(problem, space, fast, [{}], starts=options.starts, patience=options.patience, seed=0)
    optima = sorted(found.optima, key=lambda optimum: optimum.cost)[: options.restarts]
    problem = _reweight(problem, space, settings, optima[0].values)
    best = fit_to_convergence(problem, space, settings, optima[0].values)
    log_factors = space.to_scaled(best.values)
    white, std = _standard_deviations(problem, best.residual, best.jacobian, options.min_eigenvalue)
    for i, group in enumerate(groups):
        if group.free and abs(log_factors[i]) > min_change and np.isfinite(white[i]):
            starts = np.stack([best.values, *(optimum.values for optimum in optima)], axis=1)
            fixed, starts = _fix_factor(space, i, float(np.exp(np.copysign(min_change, log_factors[i]))), starts)
            cost = min(end.cost for end in fit_many(problem, fixed, settings, starts, cost_to_beat=np.inf))
            ratio = np.sqrt(max(cost - best.cost, 0.0)) * white[i] / std[i]
            std[i] = max(std[i], (abs(log_factors[i]) - min_change) / max(ratio, 1e-6))
    return ChangeEstimate(log_factors[: len(groups)], std[: len(groups)])


@dataclass(frozen=True)
class _FactorSpace(ParameterSpace):
    """Space of the factors; by name it also gives the parameters that follow from them."""

    model: Mapping[str, float] = field(default_factory=dict)
    groups: tuple[ParameterGroup, ...] = ()

    def named(self, values: Array) -> dict[str, Array]:
        given = super().named(values)
        own = {name: np.full(values.shape[1], value) for name, value in self.model.items()}
        for group in self.groups:
            for name in group.parameters:
                own[name] = own[name] * given[group.name]
        return given | own


def _factor_space(
    values: Mapping[str, float],
    groups: Sequence[ParameterGroup],
    recording: Recording,
    problem: SimulationErrorProblem,
    options: SimulatedChangeOptions,
) -> _FactorSpace:
    high = np.exp([min(options.max_prior_std * group.prior_std, np.log(options.max_factor)) for group in groups])
    unknown = problem.unknown_initial
    return _FactorSpace(
        names=(*(group.name for group in groups), *(part.name for part in unknown)),
        low=np.array([*(1.0 / high), *(part.low for part in unknown)]),
        high=np.array([*high, *(part.high for part in unknown)]),
        start=np.array([*np.ones(len(groups)), *(part.start for part in unknown)]),
        log=np.array([True] * len(groups) + [False] * len(unknown)),
        fixed={},
        scales=scales([recording]),
        blocks=(),
        not_sampled=np.array([not group.free for group in groups] + [not part.sampled for part in unknown]),
        model=values,
        groups=tuple(groups),
    )


def _fix_factor(space: _FactorSpace, i: int, value: float, starts: Array) -> tuple[_FactorSpace, Array]:
    """Space and starts, shape (P, S), with one factor fixed."""
    rest = np.arange(len(space.names)) != i
    names = tuple(name for name, keep in zip(space.names, rest, strict=True) if keep)
    smaller = replace(
        space,
        names=names,
        low=space.low[rest],
        high=space.high[rest],
        start=space.start[rest],
        log=space.log[rest],
        not_sampled=space.not_sampled[rest],
        fixed={space.names[i]: value},
    )
    return smaller, starts[rest]


@dataclass(frozen=True)
class _ProblemWithPrior(SimulationErrorProblem):
    """Problem with one more residual for each factor with a prior: its logarithm over the prior standard deviation."""

    prior_stds: Mapping[str, float] = field(default_factory=dict)

    def residuals(self, values: Mapping[str, Array], settings: Settings, *, group: int = 1) -> Array:
        simulated = super().residuals(values, settings, group=group)
        return np.concatenate([simulated, self._prior_residuals(values)])

    def normal_products(self, values: Mapping[str, Array], settings: Settings, per_step: Array) -> Array:
        total = super().normal_products(values, settings, per_step)
        r = self._prior_residuals(values).reshape(-1, *total.shape[:2])
        r[:, :, 1:] = (r[:, :, 1:] - r[:, :, :1]) * per_step
        return np.asarray(total + np.einsum("bsi,bsj->sij", r, r))

    def costs(self, values: Mapping[str, Array], settings: Settings, upper_limits: Array | None = None) -> Array:
        prior = np.square(self._prior_residuals(values)).sum(axis=0)
        limits = None if upper_limits is None else upper_limits - prior
        return np.asarray(super().costs(values, settings, limits) + prior)

    def _prior_residuals(self, values: Mapping[str, Array]) -> Array:
        sets = len(next(iter(values.values())))
        return np.array([np.log(values[name]) / std for name, std in self.prior_stds.items()]).reshape(-1, sets)


def _reweight(
    problem: _ProblemWithPrior, space: ParameterSpace, settings: Settings, values: Array
) -> _ProblemWithPrior:
    """Weigh the outputs by their residuals at `values`, which no change explains, or by the sensor noise if larger."""
    (recording,) = problem.recordings
    residual = problem.residuals(space.named(values[:, None]), settings)[: recording.y.size]
    rms = np.sqrt(np.mean(np.square(residual.reshape(recording.y.shape)), axis=1)) / problem.weights
    noise = np.maximum(rms, output_noise(recording))
    return replace(problem, weights=1.0 / np.where(noise > 0.0, noise, 1.0 / problem.weights))


def _standard_deviations(
    problem: _ProblemWithPrior, residual: Array, jacobian: Array, min_eigenvalue: float
) -> tuple[Array, Array]:
    """Standard deviations, shape (P,), for white residuals and for the residuals as they are."""
    (recording,) = problem.recordings
    n = recording.y.size
    norm = np.linalg.norm(jacobian, axis=0)
    scale = np.where(norm > 0.0, norm, 1.0)
    J = jacobian / scale
    data, prior = J[:n], J[n:]
    lengths = [recording.samples] * len(recording.y)
    scores = prior.T @ prior + gradient_covariance(noise_models(residual[:n], data, lengths), data, lengths)
    eigenvalues, vectors = np.linalg.eigh(J.T @ J)
    inverse = (vectors / np.maximum(eigenvalues, min_eigenvalue * max(eigenvalues[-1], 1.0))) @ vectors.T
    stds = (np.sqrt(np.diag(cov)) for cov in (inverse, inverse @ scores @ inverse))
    white, coloured = (np.where(norm > 0.0, std / scale, np.inf) for std in stds)
    return white, coloured
