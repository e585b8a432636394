"""What has changed of a known drive, by simulation: factors on groups of its parameters, from one recording.

The drive's model is known up to the doubt it came with, so little is searched: a common factor for each group that may
have changed freely, and one for every other doubt, held near 1. A simulation follows the contacts in a gap, which no
filter with one state does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.least_squares import fit_many, fit_to_convergence
from brightgrey.estimation.optimisation.multistart import multistart
from brightgrey.estimation.problem.initial_state import output_noise
from brightgrey.estimation.problem.parameter_space import ParameterSpace
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.estimation.uncertainty.covariance import gradient_covariance, noise_models
from brightgrey.kit import Structure
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings

__all__ = ["ChangeEstimate", "ParameterGroup", "estimate_changes"]

_MOST = 5.0  # factor that is looked for, to either side
_DOUBTS = 5.0  # standard deviations that what is known may be off
_STARTS, _PATIENCE = 8, 2
_RIVALS = 4  # ends from which a held factor is fitted
_SINGULAR = 1e-10  # of the information with normed parameters, whose diagonal is 1


class ParameterGroup(NamedTuple):
    """Parameters that are multiplied by a common factor, and the standard deviation of its logarithm beforehand.

    An infinite one says that nothing is known.
    """

    parameters: tuple[str, ...]
    prior_std: float

    @property
    def name(self) -> str:
        """The factor's."""
        return "factor of " + ", ".join(self.parameters)

    @property
    def free(self) -> bool:
        """Whether nothing is known beforehand."""
        return not np.isfinite(self.prior_std)


class ChangeEstimate(NamedTuple):
    """What a recording says of the changes.

    Attributes
    ----------
    size : ndarray, shape (changes,)
        Logarithms of the factors.
    std : ndarray, shape (changes,)
        Their standard deviations; very large where nothing is said.
    """

    log_factors: Array
    std: Array


def estimate_changes(
    structure: Structure,
    values: Mapping[str, float],
    changes: Sequence[ParameterGroup],
    recording: Recording,
    settings: Settings,
    *,
    min_change: float,
) -> ChangeEstimate:
    """Find the factors with which the model explains a recording best.

    Parameters
    ----------
    structure : Structure
    values : mapping of str to float
        The model's parameters, SI.
    changes : sequence of ParameterGroup
    recording : Recording
    settings : Settings
        Of the last descents; the search goes at the ``fast`` level.
    matters : float
        Logarithm of a factor. A free change that comes out larger is held at this size, all else is fitted anew, and
        what that costs (the likelihood ratio) decides how sure it is: through a gap the quadratic picture of the cost
        is often too narrow.

    Returns
    -------
    ChangeEstimate
        The standard deviations allow for autocorrelated residuals, as in
        :mod:`brightgrey.estimation.uncertainty.covariance`.
    """
    problem = _ProblemWithPrior.of(structure, [recording])
    search = _factor_space(values, changes, recording, problem)
    problem = replace(problem, prior_stds={c.name: c.prior_std for c in changes if not c.free})
    fast = replace(settings, level="fast")
    found = multistart(problem, search, fast, [{}], starts=_STARTS, patience=_PATIENCE, seed=0)
    ends = sorted(found.ends, key=lambda end: end.cost)[:_RIVALS]
    problem = _reweight(problem, search, settings, ends[0].values)
    last = fit_to_convergence(problem, search, settings, ends[0].values)
    size = search.to_scaled(last.values)
    white, std = _standard_deviations(problem, last.residual, last.jacobian)
    for i, change in enumerate(changes):
        if change.free and abs(size[i]) > min_change and np.isfinite(white[i]):
            begins = np.stack([last.values, *(end.values for end in ends)], axis=1)
            held, begins = _fix_factor(search, i, float(np.exp(np.copysign(min_change, size[i]))), begins)
            least = min(end.cost for end in fit_many(problem, held, settings, begins, cost_to_beat=np.inf))
            ratio = np.sqrt(max(least - last.cost, 0.0)) * white[i] / std[i]
            std[i] = max(std[i], (abs(size[i]) - min_change) / max(ratio, 1e-6))
    return ChangeEstimate(size[: len(changes)], std[: len(changes)])


@dataclass(frozen=True)
class _FactorSpace(ParameterSpace):
    """Search of factors; by name it gives the parameters that they lead to, too."""

    model: Mapping[str, float] = field(default_factory=dict)
    changes: tuple[ParameterGroup, ...] = ()

    def named(self, values: Array) -> dict[str, Array]:
        given = super().named(values)
        own = {name: np.full(values.shape[1], value) for name, value in self.model.items()}
        for change in self.changes:
            for name in change.parameters:
                own[name] = own[name] * given[change.name]
        return given | own


def _factor_space(
    values: Mapping[str, float],
    changes: Sequence[ParameterGroup],
    recording: Recording,
    problem: SimulationErrorProblem,
) -> _FactorSpace:
    reach = np.exp([min(_DOUBTS * change.prior_std, np.log(_MOST)) for change in changes])
    unknown = problem.unknown_initial
    return _FactorSpace(
        names=(*(change.name for change in changes), *(part.name for part in unknown)),
        low=np.array([*(1.0 / reach), *(part.low for part in unknown)]),
        high=np.array([*reach, *(part.high for part in unknown)]),
        start=np.array([*np.ones(len(changes)), *(part.start for part in unknown)]),
        log=np.array([True] * len(changes) + [False] * len(unknown)),
        fixed={},
        scales=scales([recording]),
        blocks=(),
        not_sampled=np.array([not change.free for change in changes] + [not part.drawn for part in unknown]),
        model=values,
        changes=tuple(changes),
    )


def _fix_factor(search: _FactorSpace, i: int, value: float, begins: Array) -> tuple[_FactorSpace, Array]:
    """Search and starts, shape (P, S), with one factor fixed."""
    rest = np.arange(len(search.names)) != i
    part = {name: getattr(search, name)[rest] for name in ("low", "high", "start", "log", "not_sampled")}
    names = tuple(name for name, stays in zip(search.names, rest, strict=True) if stays)
    return replace(search, names=names, fixed={search.names[i]: value}, **part), begins[rest]


@dataclass(frozen=True)
class _ProblemWithPrior(SimulationErrorProblem):
    """Problem with one more residual for each factor of which something is known: its logarithm over that doubt."""

    prior_stds: Mapping[str, float] = field(default_factory=dict)

    def residuals(self, values: Mapping[str, Array], settings: Settings, *, group: int = 1) -> Array:
        apart = super().residuals(values, settings, group=group)
        return np.concatenate([apart, self._prior_residuals(values)])

    def normal_products(self, values: Mapping[str, Array], settings: Settings, per_step: Array) -> Array:
        total = super().normal_products(values, settings, per_step)
        r = self._prior_residuals(values).reshape(-1, *total.shape[:2])
        r[:, :, 1:] = (r[:, :, 1:] - r[:, :, :1]) * per_step
        return np.asarray(total + np.einsum("bsi,bsj->sij", r, r))

    def costs(self, values: Mapping[str, Array], settings: Settings, upper_limits: Array | None = None) -> Array:
        more = np.square(self._prior_residuals(values)).sum(axis=0)
        return np.asarray(super().costs(values, settings, None if upper_limits is None else upper_limits - more) + more)

    def _prior_residuals(self, values: Mapping[str, Array]) -> Array:
        sets = len(next(iter(values.values())))
        return np.array([np.log(values[name]) / std for name, std in self.prior_stds.items()]).reshape(-1, sets)


def _reweight(
    problem: _ProblemWithPrior, search: ParameterSpace, settings: Settings, values: Array
) -> _ProblemWithPrior:
    """The same with the residuals at `values` for noise, which is what no change explains; at least the sensor's."""
    (recording,) = problem.recordings
    residual = problem.residuals(search.named(values[:, None]), settings)[: recording.y.size]
    size = np.sqrt(np.mean(np.square(residual.reshape(recording.y.shape)), axis=1)) / problem.weights
    noise = np.maximum(size, output_noise(recording))
    return replace(problem, weights=1.0 / np.where(noise > 0.0, noise, 1.0 / problem.weights))


def _standard_deviations(problem: _ProblemWithPrior, residual: Array, jacobian: Array) -> tuple[Array, Array]:
    """Standard deviations, shape (P,), if residuals were white, and as they are; very large where nothing is told."""
    (recording,) = problem.recordings
    n = recording.y.size
    scale = np.linalg.norm(jacobian, axis=0)
    J = jacobian / np.where(scale > 0.0, scale, 1.0)
    data, known = J[:n], J[n:]
    lengths = [recording.samples] * len(recording.y)
    meat = known.T @ known + gradient_covariance(noise_models(residual[:n], data, lengths), data, lengths)
    size, base = np.linalg.eigh(J.T @ J)
    inverse = (base / np.maximum(size, _SINGULAR * max(size[-1], 1.0))) @ base.T
    stds = (np.sqrt(np.diag(cov)) for cov in (inverse, inverse @ meat @ inverse))
    white, coloured = (np.where(scale > 0.0, std / np.where(scale > 0.0, scale, 1.0), np.inf) for std in stds)
    return white, coloured
