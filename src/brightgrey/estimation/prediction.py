"""Prediction of a recording by a structure with known parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.optimisation.least_squares import fit_many
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem, predict_many
from brightgrey.kit import Structure
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings

__all__ = ["predict"]


@dataclass(frozen=True)
class PredictionOptions:
    """Effort of a prediction."""

    initial_state_rounds: int = 30  #: Rounds that estimate the initial state of a recording for known parameters.


PREDICTION_DEFAULTS = PredictionOptions()


def predict(
    structure: Structure,
    values: Mapping[str, float],
    recording: Recording,
    settings: Settings,
    initial: Mapping[str, float] | None = None,
) -> Array:
    """Simulate `structure` with the input of a recording.

    Parameters
    ----------
    structure : Structure
    values : mapping of str to float
        SI.
    recording : Recording
        Gives the input, the outputs and, if `initial` is not given, the initial state.
    settings : Settings
    initial : mapping of str to float, optional
        Initial state by state name, SI. If it is not given and the recording begins in motion, it is estimated from the
        recording within the noise of the first samples, as in a fit.

    Returns
    -------
    ndarray, shape (outputs, samples)
        SI; not-a-number from the sample on at which the simulation diverged.
    """
    if initial is None:
        initial = _estimated_initial_state(structure, values, recording, settings)
    arrays = {name: np.array([value]) for name, value in values.items()}
    return predict_many(structure, arrays, recording, settings, initial=initial)[:, :, 0]


def _estimated_initial_state(
    structure: Structure, values: Mapping[str, float], recording: Recording, settings: Settings
) -> Mapping[str, float] | None:
    """Initial state of a recording for known parameters; None if it begins at rest."""
    problem = SimulationErrorProblem.of(structure, [recording])
    if not problem.unknown_initial:
        return None
    own = {name: values[name] for name in structure.parameters}
    space = parameter_space(structure, scales([recording]), {}, own, problem.unknown_initial)
    rounds = PREDICTION_DEFAULTS.initial_state_rounds
    (end,) = fit_many(problem, space, settings, space.start[:, None], limit=rounds)
    return problem.states(space.by_name(end.values), settings.f_tanh)[0]
