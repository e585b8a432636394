"""The drive as a plan knows it: its structures with their values, sensors and noise, and what a torque would show."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import INERTIA, Scales
from brightgrey.estimation.noise.autoregression import Autoregression
from brightgrey.estimation.noise.whitening import whiten
from brightgrey.estimation.optimisation.least_squares import evaluate
from brightgrey.estimation.optimisation.torque_regression import with_regressed_sizes
from brightgrey.estimation.problem.initial_state import InitialState
from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH, friction_gain, friction_width_nuisance
from brightgrey.estimation.problem.parameter_space import ParameterSpace, parameter_space
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem, predict_many
from brightgrey.kit import StateSpace, Structure, assemble, slowest_resonance
from brightgrey.model.model import Model
from brightgrey.planning.alternatives import against_largest, share_that_matters, truth_between, with_free_width
from brightgrey.planning.position_loop import PositionLoop
from brightgrey.recordings import Recording, Signal
from brightgrey.search.undecided.question import Known, OpenQuestions, Question
from brightgrey.simulation import Settings

__all__ = ["PlannedDrive", "RigidDrive"]

_SHARPEST = 1e4  # of friction's sign over the largest speed; an exact sign has no slope to invert


@dataclass(frozen=True)
class RigidDrive:
    """Inverse dynamics of the drive with rigid shafts: the torque that leads it along a motion."""

    inertia: float  #: kg m² (kg).
    speeds: Array  #: rad/s (m/s), increasing.
    friction: Array  #: Torque at these speeds in N m (N), constant torques included.

    @classmethod
    def of(cls, system: StateSpace, inertias: Sequence[float], largest: float) -> RigidDrive:
        """Rigid drive with the friction of `system` up to a speed, rad/s (m/s)."""
        grid = np.linspace(-1.0, 1.0, 401)
        speeds = 1.5 * largest * np.sign(grid) * grid**2
        rows = [i for i, state in enumerate(system.states) if state.at_rest == "speed"]
        masses = np.asarray(inertias)
        torque = [-float(masses @ system.derivative(system.rest(speed=v), 0.0)[rows]) for v in speeds]
        return cls(float(masses.sum()), speeds, np.array(torque))

    def torque(self, velocity: Array, acceleration: Array, compensation: float) -> Array:
        """Torque in N m (N) for a motion, with a part of the friction compensated, and all of a load that falls."""
        friction = np.interp(velocity, self.speeds, self.friction) - self.hold
        moved = compensation * np.where(velocity == 0.0, 0.0, friction)
        return np.asarray(self.inertia * acceleration + moved + self.hold)

    def scaled(self, torque: Array, factor: float) -> Array:
        """Torque of a smaller motion; a load is held all the same."""
        return np.asarray(self.hold + factor * (torque - self.hold))

    @cached_property
    def hold(self) -> float:
        """Torque in N m (N) that holds the drive at standstill; 0 where friction does so, with half of it to spare."""
        near = np.abs(self.speeds) < 0.2 * self.speeds[-1]
        high, low = (float(part(self.friction[near])) for part in (np.max, np.min))
        load = 0.5 * (high + low)
        return load if abs(load) > 0.25 * (high - low) else 0.0

    @property
    def breakaway(self) -> float:
        """Largest friction near standstill in N m (N)."""
        near = np.abs(self.speeds) < 0.2 * self.speeds[-1]
        return float(np.abs(self.friction[near] - self.hold).max())


@dataclass(frozen=True)
class PlannedDrive:
    """Knowledge of a drive by a search, ready for simulations of new motions."""

    model: Model
    known: OpenQuestions
    gap: float = 0.0  #: Position of a truth in its gaps at the begin, in widths from the forward side: 0 to -1.
    loop: PositionLoop | None = None  #: None in open loop.
    #: Where truths lie between two tied structures: 1 is at the truth, 0 where its effects have the least size that
    #: matters.
    share: float = 0.5

    @cached_property
    def settings(self) -> Settings:
        """Of the simulation, level fast."""
        return replace(self.model.settings_si(), level="fast")

    def recording(self, torque: Array) -> Recording:
        """Recording of a torque in which nothing was measured: residuals of it are outputs."""
        outputs = self.model.outputs
        t = np.asarray(self.known.sampling_time * np.arange(torque.size), float)
        zero, one = np.zeros((len(outputs), torque.size)), np.ones(len(outputs))
        hold = self.model.settings.hold
        return Recording("plan", t, torque, zero, self.model.input, outputs, hold=hold, resolution=one)

    def problem(self, structure: Structure, recording: Recording) -> SimulationErrorProblem:
        """Weighted outputs of a structure that starts at rest, at the side of its gap that it was left at."""
        state = InitialState(0.0, 0.0, 0.0, ())
        weights = np.array([n.weight for n in self.known.noise])
        return SimulationErrorProblem(structure, (recording,), weights, (state,))

    @cached_property
    def _spaces(self) -> dict[int, tuple[Known, ParameterSpace]]:
        """Spaces so far, by the identity of what is known."""
        return {}

    def space(self, known: Known) -> ParameterSpace:
        """Scaled space of the parameters of a structure that the recordings say something of."""
        kept = self._spaces.get(id(known))
        if kept is None:
            kept = self._spaces[id(known)] = known, self._space_within(known, self.known.scales)
        return kept[1]

    def _space_within(self, known: Known, scales: Scales) -> ParameterSpace:
        """Space with the ranges that recordings of some scales give."""
        structure = Structure.parse(known.structure)
        fixed = {n: v for n, v in known.values.items() if n in structure.parameters and n not in known.names}
        bounds = {n: limits for n, limits in self.known.bounds.items() if n in known.names}
        width = (friction_width_nuisance(scales.speed),) if FRICTION_WIDTH in known.names else ()
        return parameter_space(structure, scales, bounds, fixed, width)

    def box(self, known: Known, scales: Scales) -> tuple[Array, Array]:
        """Bounds that recordings of some scales give, in the scaled space, shape (P,) each."""
        space, within = self.space(known), self._space_within(known, scales)
        return space.to_scaled(within.low), space.to_scaled(within.high)

    def truths(self, questions: Sequence[Question], torque: Array) -> list[Array]:
        """Whitened outputs of the truth of each question, shape (residuals,); those of one structure side by side."""
        alike: dict[tuple[str, ...], list[int]] = {}
        for k, q in enumerate(questions):
            alike.setdefault((q.truth, *sorted(q.values)), []).append(k)
        found: dict[int, Array] = {}
        for (structure, *names), numbers in alike.items():
            values = {n: np.array([questions[k].values[n] for k in numbers]) for n in names}
            parsed = Structure.parse(structure)
            gaps = self.begin_in_gaps(self.system(structure, values)) if parsed.has_hard_limit else {}
            values |= {n: np.full(len(numbers), share) for n, share in gaps.items()}
            y = self.problem(parsed, self.recording(torque)).residuals(values, self.settings)
            found |= dict(zip(numbers, self.whiten(y, torque.size).T, strict=True))
        return [found[k] for k in range(len(questions))]

    def start_by_torques(
        self, question: Question, shapes: Collection[str], torque: Array, scales: Scales, samples: int
    ) -> Array | None:
        """Parameters of a rival whose torques balance those of the truth.

        The best draw of its shapes is taken. Sizes balance the torques, and the others are those of the truth, or else
        of the recordings so far.

        Parameters
        ----------
        question : Question
        shapes : collection of str
            Parameters that are drawn.
        torque : ndarray, shape (samples,)
            Of the new motion, N m (N).
        scales : Scales
            Of the recordings that give the ranges.
        samples : int
            Number of draws.

        Returns
        -------
        ndarray, shape (P,), or None
            In the scaled space. None where no torque can be balanced, or the truth diverges.
        """
        rival, truth = (Structure.parse(name) for name in (question.rival.structure, question.truth))
        values = {n: np.array([v]) for n, v in question.values.items()}
        nothing, state = self.recording(torque), InitialState(0.0, 0.0)
        signal = Signal("speed", "velocity", "rad/s")  # of the truth it is known, whatever the sensor
        empty = (nothing, replace(nothing, y=nothing.y[:1], outputs=(signal,), resolution=np.ones(1)))
        shown = [predict_many(truth, values, r, self.settings, initial_state=state)[:, :, 0] for r in empty]
        if not all(np.isfinite(y).all() for y in shown):
            return None
        measured, speed = (self.problem(rival, replace(r, y=y)) for r, y in zip(empty, shown, strict=True))
        space = self._space_within(question.rival, scales)
        drawn = space.sample(samples, np.random.default_rng(0))
        own = {**question.rival.values, **question.values}
        for k, name in enumerate(space.names):
            drawn[k] = drawn[k] if name in shapes else own[name]
        found = with_regressed_sizes(speed, space, self.settings, space.clip(drawn))
        if found is None:
            return None
        costs = measured.costs(space.named(found), self.settings)
        return self.space(question.rival).to_scaled(found[:, np.argmin(costs)])

    def begin_in_gaps(self, system: StateSpace) -> dict[str, float]:
        """Position in each gap of a system at the begin, as the initial state names it."""
        limited = [system.state_names[e.limits.state] for e in system.elements if e.limits is not None]
        return {f"{name}(0)/width": self.gap for name in limited}

    @cached_property
    def asked(self) -> tuple[Question, ...]:
        """The open questions; the truths of tied structures lie between both."""
        return tuple(with_free_width(truth_between(q, share_that_matters(q, self.share))) for q in self.known.questions)

    @cached_property
    def against_largest(self) -> tuple[tuple[Question, ...], ...]:
        """Each of these against the largest structures that lack one of its effects."""
        shares = [share_that_matters(q, self.share) for q in self.known.questions]
        return tuple(
            tuple(map(with_free_width, against_largest(q, share))) for q, share in zip(self.asked, shares, strict=True)
        )

    def with_values(self, draw: Mapping[str, float], gap: float, share: float) -> PlannedDrive:
        """The same drive with other values, another position in its gaps at the begin, and other truths between ties.

        The values are those of the best structure. Tied structures keep theirs: each has an optimum of its own.
        """
        best, old = self.known.model.structure, self.known.model.values
        model = replace(self.known.model, values={**old, **draw})

        def moved(q: Question) -> Question:
            if q.kind != "size" or q.rival.structure != best:
                return q
            largest = (replace(r.known, values=_moved(r.known.values, old, draw)) for r in q.largest)
            return replace(
                q,
                rival=replace(q.rival, values=model.values),
                values=_moved(q.values, old, draw),
                largest=tuple(replace(r, known=k) for r, k in zip(q.largest, largest, strict=True)),
            )

        questions = tuple(map(moved, self.known.questions))
        return replace(self, known=replace(self.known, model=model, questions=questions), gap=gap, share=share)

    def outputs_and_jacobian(self, known: Known, theta: Array, torque: Array) -> tuple[Array, Array]:
        """Whitened outputs, shape (residuals,), and their Jacobian, shape (residuals, P), at scaled parameters."""
        problem, space = self.problem(Structure.parse(known.structure), self.recording(torque)), self.space(known)
        y, J = evaluate(problem, space, self.settings, theta)
        return self.whiten(y, torque.size), self.whiten(J, torque.size)

    def theta(self, known: Known) -> Array:
        """Estimates in the scaled space, shape (P,)."""
        return self.space(known).to_scaled(np.array([known.values[n] for n in known.names]))

    def steps_to_bounds(self, known: Known, scales: Scales) -> tuple[Array, Array]:
        """Least and largest step of each parameter from its estimate to its bounds, scaled, shape (P,) each."""
        theta, (low, high) = self.theta(known), self.box(known, scales)
        return np.minimum(low - theta, 0.0), np.maximum(high - theta, 0.0)

    def whiten(self, x: Array, samples: int) -> Array:
        """Whiten outputs by the noise of the recordings."""
        noise = self.known.noise
        models = [Autoregression(n.a, n.variance) for n in noise]
        return whiten(x, models, [samples] * len(noise))

    def draws(self, count: int, rng: np.random.Generator) -> dict[str, Array]:
        """Draws of the parameters of the best structure by the covariance of its estimates, each of shape (count,).

        Far along a direction that the recordings hardly know, a logarithm is no longer linear in the motion. A lag at
        its lower bound would be drawn ten thousand times as large. A small lag acts in proportion to itself, a stiff
        shaft to its inverse. So a step s of a logarithm becomes log(1 + s).
        """
        known, space = self.known.model, self.space(self.known.model)
        size, axes = np.linalg.eigh(np.array(known.information))
        spread = axes / np.sqrt(np.maximum(size, 1e-12 * size.max(initial=1e-300)))
        steps = rng.standard_normal((len(size), count))
        longest = np.abs(spread[space.log]).max(axis=0, initial=0.0)[:, None] * np.abs(steps)
        steps *= np.where(longest > 1e-6, np.log1p(longest) / np.maximum(longest, 1e-6), 1.0)
        theta = self.theta(known)[:, None] + spread @ steps
        low, high = space.box
        return space.named(space.from_scaled(np.clip(theta, low[:, None], high[:, None])))

    def system(self, structure: str, values: Mapping[str, Array | float], outputs: Sequence[str] = ()) -> StateSpace:
        """Assembled systems of parameter sets."""
        parsed, f_tanh = Structure.parse(structure), friction_gain(values, self.settings.f_tanh)
        return assemble(parsed, {n: values[n] for n in parsed.parameters}, f_tanh, list(outputs) or ["velocity"])

    @cached_property
    def rigid(self) -> RigidDrive:
        """The drive of the best structure with rigid shafts."""
        known = self.known.model
        structure = Structure.parse(known.structure)
        largest = self.known.reached["speed"]
        values = {FRICTION_WIDTH: largest / _SHARPEST, **known.values}
        system = self.system(known.structure, values)
        inertias = [known.values[n] for n, p in structure.parameters.items() if p.dimension == INERTIA]
        return RigidDrive.of(system, inertias, largest)

    @cached_property
    def resonance(self) -> float:
        """Slowest resonance in Hz, between one period in the recordings and ten samples; with one mass 100 samples."""
        known = self.known.model
        structure = Structure.parse(known.structure)
        if structure.masses < 2:
            return 0.01 / self.known.sampling_time
        slowest, fastest = 1.0 / self.known.reached["duration"], 0.1 / self.known.sampling_time
        return float(np.clip(slowest_resonance(structure, known.values) / (2.0 * np.pi), slowest, fastest))


def _moved(values: Mapping[str, float], estimates: Mapping[str, float], draw: Mapping[str, float]) -> dict[str, float]:
    """Values of a truth, moved as a draw moves the estimates; an inertia may be a part of an estimate."""
    factors = {n: draw[n] / estimates[n] for n in values if n in draw and estimates.get(n)}
    return {n: value * factors.get(n, 1.0) for n, value in values.items()}
