"""One repetition of a self-test: a drive is simulated, measured, and identified as the recordings were."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from brightgrey import estimation
from brightgrey.errors import BrightgreyError
from brightgrey.estimation.optimisation.least_squares import OptimumWithJacobian
from brightgrey.estimation.problem.initial_state import Initial
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH, friction_width_nuisance
from brightgrey.estimation.uncertainty.estimates import Estimate, estimates_of
from brightgrey.kit import Grammar, Structure
from brightgrey.recordings import Recording
from brightgrey.search import IdentificationTask
from brightgrey.search.decision import decide_structures
from brightgrey.search.fitting.refined_fit import accurate, residual_and_jacobian
from brightgrey.search.parallel import InlineExecutor, Stopped
from brightgrey.self_test.sensor_noise import SensorNoise
from brightgrey.self_test.simulated_drives import SimulatedDrive, measured

__all__ = ["Repetition", "Request", "repeat"]


@dataclass(frozen=True)
class _Policy:
    """Effort of the last fit, as of an identification."""

    patience: int = 8  #: Of the multistart of a given structure.
    patience_beside_optimum: int = 0  #: After a search, which has made multistarts itself.


POLICY = _Policy()


@dataclass(frozen=True)
class Request:
    """Identification that is made again and again, as it was made of the recordings."""

    task: IdentificationTask  #: On the recordings themselves.
    grammar: Grammar | None  #: None if the structure was given.
    require: tuple[str, ...]
    exclude: tuple[str, ...]
    how: Literal["border", "exhaustive"]
    initial: Initial
    level: Literal["accurate", "fast"]
    seed: int
    #: Optima at which a fast repetition begins, without a search for others; None for a whole identification.
    optima: Mapping[Structure, Mapping[str, float]] | None = None
    offered: tuple[str, ...] = ()  #: Effects beyond the first ones of the grammar that were offered when it found them.


@dataclass(frozen=True)
class Repetition:
    """Result of one repetition."""

    structure: str = ""  #: Best one.
    minimal: tuple[str, ...] = ()  #: Structures that fit equally well, the best first.
    verdicts: Mapping[str, str] = field(default_factory=dict)  #: By effect.
    #: By parameter of the best structure: value, standard deviation, low and high end of the 95 % interval, SI. Null
    #: where they are unknown.
    estimates: Mapping[str, tuple[float, float | None, float | None, float | None]] = field(default_factory=dict)
    error: str = ""  #: Reason why nothing was identified.

    @classmethod
    def of(cls, plain: Mapping[str, Any]) -> Repetition:
        """Repetition from its fields as plain data."""
        estimates = {name: tuple(numbers) for name, numbers in plain["estimates"].items()}
        return cls(**{**plain, "minimal": tuple(plain["minimal"]), "estimates": estimates})


def repeat(
    request: Request,
    drive: SimulatedDrive,
    noises: Sequence[SensorNoise],
    seeds: Sequence[int],
    stopped: Callable[[], bool] = lambda: False,
) -> Repetition:
    """Measure a simulated drive once, and identify it.

    Parameters
    ----------
    request : Request
    drive : SimulatedDrive
    noises : sequence of SensorNoise
        One for each output of each recording.
    seeds : sequence of int
        Of the noise.
    stopped : callable
        Asked before each fit of a search.

    Raises
    ------
    Stopped
        If `stopped` returns True.
    """
    recordings = measured(request.task, drive, noises, np.random.default_rng(list(seeds)))
    if request.optima is not None and drive.without is not None:
        request = _between(request, drive, drive.without)
    try:
        return _identified(request, drive.structure, recordings, stopped)
    except BrightgreyError as error:
        return Repetition(error=str(error))


def _between(request: Request, drive: SimulatedDrive, without: Structure) -> Request:
    """Request that decides only between a structure with an effect and that without it."""
    assert request.grammar is not None
    present = dict.fromkeys(str(p) for p in (*without.placed, *drive.structure.placed))
    most = drive.structure.masses
    left_out = [p for p in request.grammar.whole.placed if str(p) not in present and not p.effect.masses]
    beyond = [p for p in request.grammar.whole.placed if p.effect.masses > most]
    return replace(
        request,
        require=tuple(map(str, without.placed)),
        exclude=tuple(map(str, (*left_out, *beyond))),
        optima={
            structure: {n: v for n, v in drive.values.items() if n in structure.parameters or n == FRICTION_WIDTH}
            for structure in (without, drive.structure)
        },
        offered=tuple(present),
    )


def _identified(
    request: Request, structure: Structure, recordings: tuple[Recording, ...], stopped: Callable[[], bool]
) -> Repetition:
    """Identify simulated recordings."""
    task = _task_on(request.task, recordings)
    verdicts: dict[str, str] = {}
    minimal: tuple[Structure, ...] = (structure,)
    starts: Sequence[Mapping[str, float]] = [request.optima[structure]] if request.optima else []
    if request.grammar is not None:
        decision = decide_structures(
            task,
            request.grammar,
            require=request.require,
            exclude=request.exclude,
            how=request.how,
            optima=request.optima,
            offered=request.offered,
            ask=False,
            seed=request.seed,
            executor=InlineExecutor(stopped),
        )
        if decision.evidence is None:
            raise Stopped
        verdicts = {card.effect: card.verdict for card in decision.evidence.cards}
        minimal = tuple(refined.structure for refined in decision.evidence.minimal)
        structure, starts = decision.best.structure, decision.starts
    if stopped():
        raise Stopped
    if request.optima is not None and request.grammar is not None:
        estimates = _estimates_at(task, structure, starts[0])
    else:
        estimates = _final_estimates(request, task, structure, starts)
    return Repetition(
        str(structure),
        tuple(map(str, minimal)),
        verdicts,
        {name: _numbers(estimates[name]) for name in structure.parameters if name not in task.fixed},
    )


def _task_on(task: IdentificationTask, recordings: tuple[Recording, ...]) -> IdentificationTask:
    """Task on other recordings, with their own scales as an identification takes them."""
    known = estimation.scales(recordings)
    width = task.friction_width
    settings = estimation.settings_for(recordings, known, None if width else task.settings.f_tanh)
    return replace(
        task,
        recordings=recordings,
        scales=known,
        settings=settings,
        friction_width=friction_width_nuisance(known.speed) if width else None,
        exact_friction=False,  # a search finds that itself
    )


def _final_estimates(
    request: Request, task: IdentificationTask, structure: Structure, starts: Sequence[Mapping[str, float]]
) -> Mapping[str, Estimate]:
    """Estimates by the fit that ends an identification."""
    fit = estimation.fit(
        structure,
        task.recordings,
        bounds=task.bounds_of(structure),
        fixed=task.fixed_of(structure),
        f_tanh=None if task.friction_width else task.settings.f_tanh,
        start=starts,
        patience=POLICY.patience_beside_optimum if starts else POLICY.patience,
        seed=request.seed,
        level=request.level,
        initial=request.initial,
        per_recording=task.per_recording,
    )
    return fit.estimates


def _estimates_at(
    task: IdentificationTask, structure: Structure, values: Mapping[str, float]
) -> Mapping[str, Estimate]:
    """Estimates at an optimum that is known."""
    task = task.with_friction_of(values)
    problem, space = task.problem_and_space(structure)
    residual, jacobian, _ = residual_and_jacobian(task, structure, values)
    point = np.array([values.get(n, v) for n, v in zip(space.names, space.start, strict=True)])
    best = OptimumWithJacobian(point, float(residual @ residual), True, 0, 0, residual, jacobian)
    return estimates_of(problem, space, accurate(task).settings, best).by_name


def _numbers(estimate: Estimate) -> tuple[float, float | None, float | None, float | None]:
    std, low, high = (float(x) if np.isfinite(x) else None for x in (estimate.std, *estimate.ci95))
    return estimate.value, std, low, high
