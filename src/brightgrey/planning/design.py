"""Search for the motion that decides most: every family is sampled, and the best ones are optimised."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import compress

import numpy as np
from scipy.optimize import Bounds, differential_evolution

from brightgrey.arrays import Array
from brightgrey.errors import SettingsError
from brightgrey.numerics.proportions import wilson_interval
from brightgrey.numerics.sobol import sobol_points
from brightgrey.planning.drive import PlannedDrive
from brightgrey.planning.envelope import Envelope, MotionCommand, command_of, envelope, recorded_torque
from brightgrey.planning.families import families
from brightgrey.planning.families.family import Family, Setting
from brightgrey.planning.limits import MachineLimits
from brightgrey.planning.score import Score, mean_powers, score
from brightgrey.search.policy import SELECTION

__all__ = ["PLANNING_EFFORT", "Designed", "PlanningEffort", "TriedMotion", "design_motion", "torque_of"]


@dataclass(frozen=True)
class PlanningEffort:
    """Effort of the search for a motion, and its safety."""

    samples_log2: int = 6  #: Each family begins with 2 to this power motions.
    optimised: int = 3  #: Families that are optimised, those with the best motions.
    generations: int = 30  #: Of differential evolution.
    population: int = 16  #: Motions of a generation.
    finalists: int = 20  #: Motions whose rivals are refitted, the best first.
    search_draws: int = 8  #: Parameter sets whose limits are watched in the search.
    scalings: int = 4  #: Times that a torque is tried, scaled down between them where it exceeds a limit,
    below: float = 0.985  #: to this part of the limit: friction makes the reaction uneven.
    final_draws: int = 1000  #: Parameter sets whose limits are watched in the end,
    kept: float = 0.99  #: and share of them that has to keep the limits, at the lower end of its interval.
    shrink: float = 0.97  #: Factor of the torque where the final check fails,
    shrinks: int = 6  #: and how often it is tried.
    #: Motions of each family that are sampled where a limit is doubled, as a power of two; None: no limit is.
    relaxed_log2: int | None = 4
    hopeless: float = 0.1  #: Power below which a question is given up, so that the motion serves the others.
    out_of_limits: float = 1e3  #: Loss of a motion beyond its limits, far above any score.


PLANNING_EFFORT = PlanningEffort()


@dataclass(frozen=True)
class TriedMotion:
    """A motion that was tried."""

    family: Family
    numbers: tuple[float, ...]
    torque: Array  #: Torque in open loop, feed-forward in closed loop; N m (N), shape (samples,).
    loss: float  #: Less is better.
    excess: float  #: Over the limits; 0 if they are kept.
    tightest: str  #: Limit that is used most.


@dataclass(frozen=True)
class Designed:
    """The motion that was found."""

    candidate: TriedMotion
    score: Score  #: With rivals that are refitted.
    envelope: Envelope  #: Of all draws.
    families: tuple[tuple[str, float | None], ...]  #: Smallest power of each family's best motion; None: none allowed.
    tried: int
    powers: tuple[float, ...]  #: Of each question, averaged over draws and positions in the gap.
    #: Where a question stays open: smallest power of the recorded and a new motion when one limit is doubled.
    relaxed: tuple[tuple[str, float], ...]


def torque_of(drive: PlannedDrive, family: Family, numbers: Array, setting: Setting) -> Array:
    """Torque of a motion of a family, shape (samples,), rounded to what a file holds."""
    shape = family.make(np.clip(numbers, 0.0, 1.0), setting)
    torque = drive.rigid.torque(shape.motion.velocity, shape.motion.acceleration, shape.compensation) + shape.torque
    high = setting.limits.torque
    step = (1.0 - 1e-3) * setting.limits.jerk * drive.rigid.inertia * setting.dt  # rounding takes the rest
    return np.round(_with_limited_slope(np.clip(torque, -high, high), step) / high, 6) * high


def _with_limited_slope(torque: Array, step: float) -> Array:
    """Torque that changes by no more than `step` per sample: it follows the wanted one, as a drive's own limiter."""
    if np.abs(np.diff(torque)).max(initial=0.0) <= step:
        return torque
    out, now = np.empty_like(torque), float(torque[0])
    for k, wanted in enumerate(torque.tolist()):
        now = min(max(wanted, now - step), now + step)
        out[k] = now
    return out


class _Search:
    """Motions that have been tried, with their scores."""

    def __init__(
        self,
        drive: PlannedDrive,
        setting: Setting,
        seed: int,
        tell: Callable[[int, int], None],
        effort: PlanningEffort,
        known: Mapping[bytes, Score] | None = None,
    ) -> None:
        self.drive, self.setting, self.tell, self.effort = drive, setting, tell, effort
        self.scores: dict[bytes, Score] = dict(known or {})  # by the torque
        self.draws = drive.draws(effort.search_draws, np.random.default_rng([seed, 1]))
        self.done: list[TriedMotion] = []
        sampled = len(families()) * 2**effort.samples_log2
        self.total = sampled + effort.optimised * effort.population * effort.generations + effort.finalists

    def loss(self, numbers: Array, family: Family) -> float:
        """Loss of a motion; one beyond the limits is the worse the further it is beyond them."""
        command, found = self._within_limits(torque_of(self.drive, family, numbers, self.setting))
        excess, value = found.excess(), None
        if excess == 0.0:
            key = command.torque.tobytes()
            scored = self.scores.get(key) or score(self.drive, recorded_torque(self.drive, command))
            if scored is not None:
                self.scores[key], value = scored, -scored.value
        loss = self.effort.out_of_limits * (1.0 + min(excess, 1e3)) if value is None else value
        entry = TriedMotion(family, tuple(np.asarray(numbers).tolist()), command.torque, loss, excess, found.tightest())
        self.done.append(entry)
        self.tell(len(self.done), max(self.total, len(self.done)))
        return loss

    def run(self, rng: np.random.Generator) -> list[TriedMotion]:
        """Sample every family and optimise the best ones; the allowed motions, the best first.

        Raises
        ------
        SettingsError
            If none is allowed.
        """
        for family in families():
            for numbers in sobol_points(family.numbers, self.effort.samples_log2, rng):
                self.loss(numbers, family)
        ranked = sorted(families(), key=lambda f: self.best_of(f).loss)
        for family in ranked[: self.effort.optimised]:
            self.optimise(family, rng)
        allowed = sorted((c for c in self.done if c.excess == 0.0), key=lambda c: c.loss)
        if not allowed:
            raise SettingsError(_in_the_way(self.done))
        return allowed

    def _within_limits(self, torque: Array) -> tuple[MotionCommand, Envelope]:
        """Command of a torque, scaled down where a limit is exceeded, and what the draws of the drive do with it."""
        structure, limits = self.drive.known.model.structure, self.setting.limits
        for _ in range(self.effort.scalings):
            command = command_of(self.drive, torque)
            found = envelope(self.drive, structure, self.draws, command, limits)
            use = max(float(part.max()) for part in found.use.values())
            if use <= 1.0 or not np.isfinite(use):
                break
            torque = self.drive.rigid.scaled(torque, self.effort.below / use)
        return command, found

    def best_of(self, family: Family) -> TriedMotion:
        """Best motion of a family."""
        return min((c for c in self.done if c.family is family), key=lambda c: c.loss)

    def optimise(self, family: Family, rng: np.random.Generator) -> None:
        """Optimise a family from its best motions by differential evolution (Storn and Price 1997)."""
        own = sorted((c for c in self.done if c.family is family), key=lambda c: c.loss)[: self.effort.population]
        differential_evolution(
            self.loss,
            Bounds(np.zeros(family.numbers), np.ones(family.numbers)),
            args=(family,),
            init=np.array([c.numbers for c in own]),
            maxiter=self.effort.generations - 1,
            mutation=(0.4, 0.9),
            recombination=0.8,
            polish=False,
            tol=0.0,
            rng=rng,
        )


def setting_of(drive: PlannedDrive, limits: MachineLimits, seconds: float) -> Setting:
    """Setting of the families."""
    rigid = drive.rigid
    acceleration = min(limits.acceleration, limits.torque / rigid.inertia)
    samples = round(seconds / drive.known.sampling_time)
    return Setting(drive.known.sampling_time, samples, limits, drive.resonance, rigid.breakaway, acceleration)


def design_motion(
    drive: PlannedDrive,
    limits: MachineLimits,
    seconds: float,
    seed: int,
    tell: Callable[[int, int], None] = lambda done, total: None,
    effort: PlanningEffort = PLANNING_EFFORT,
) -> Designed:
    """Search for the motion within the limits that decides most; what none decides is given up, for the parameters.

    Raises
    ------
    SettingsError
        If no motion keeps the limits; the message names the one that is in the way.
    """
    setting, asked, scores = setting_of(drive, limits, seconds), drive, dict[bytes, Score]()
    while True:
        search = _Search(asked, setting, seed, tell, effort, scores)
        found = _final(search, search.run(np.random.default_rng([seed, 2])), seed)
        found = replace(found, powers=tuple(mean_powers(drive, found.candidate.torque, seed)))
        powers = dict(zip(map(id, drive.known.questions), found.powers, strict=True))
        hopeful = [powers[id(q)] >= effort.hopeless for q in asked.known.questions]
        if all(hopeful):
            break
        # the others would take the motion from what it can show
        asked = replace(asked, known=replace(asked.known, questions=tuple(compress(asked.known.questions, hopeful))))
        scores = {key: replace(s, answers=tuple(compress(s.answers, hopeful))) for key, s in search.scores.items()}
    if min(found.powers, default=1.0) >= SELECTION.min_power or effort.relaxed_log2 is None:
        return found
    return replace(found, relaxed=tuple(_relaxed(drive, limits, seconds, seed, tell, effort, effort.relaxed_log2)))


def _relaxed(
    drive: PlannedDrive,
    limits: MachineLimits,
    seconds: float,
    seed: int,
    tell: Callable[[int, int], None],
    effort: PlanningEffort,
    samples_log2: int,
) -> Iterator[tuple[str, float]]:
    """Smallest power with each limit doubled, and with twice the time: by sampling only."""
    finite = [f.name for f in fields(limits) if np.isfinite(getattr(limits, f.name))]
    for name in (*finite, "seconds"):
        wider = limits if name == "seconds" else replace(limits, **{name: 2.0 * getattr(limits, name)})
        time = 2.0 * seconds if name == "seconds" else seconds
        search = _Search(drive, setting_of(drive, wider, time), seed, tell, effort)
        search.total = len(families()) * 2**samples_log2
        rng = np.random.default_rng([seed, 2])
        for family in families():
            for numbers in sobol_points(family.numbers, samples_log2, rng):
                search.loss(numbers, family)
        best = min(search.done, key=lambda c: c.loss)
        yield name, _smallest_power(drive, best) or 0.0


def _in_the_way(done: Sequence[TriedMotion]) -> str:
    nearest = min(done, key=lambda c: c.excess)
    if nearest.tightest == "rest":
        return (
            f"no motion keeps the limits; the drive does not come to rest after the nearest one, "
            f"{nearest.family.name}: give more time, or plan in closed loop"
        )
    return (
        f"no motion keeps the limits; the nearest one, {nearest.family.name}, exceeds one by "
        f"{100.0 * nearest.excess:.0f} %: raise the limit of {nearest.tightest}"
    )


def _final(search: _Search, allowed: Sequence[TriedMotion], seed: int) -> Designed:
    """The finalist with the best score, its rivals refitted, that keeps the limits for nearly all draws."""
    drive, limits, effort = search.drive, search.setting.limits, search.effort
    draws = drive.draws(effort.final_draws, np.random.default_rng([seed, 3]))
    leaders = [c for k, c in enumerate(allowed) if c.family not in [other.family for other in allowed[:k]]]
    # what is linear in the search may be far from it: every family has its best motion tried
    finalists = list({c.torque.tobytes(): c for c in (*leaders, *allowed)}.values())[: effort.finalists]
    scored = []
    for k, finalist in enumerate(finalists):
        search.tell(len(search.done) + k, max(search.total, len(search.done) + k))
        found = score(drive, recorded_torque(drive, command_of(drive, finalist.torque)), refit=True)
        scored += [(finalist, found)] if found is not None else []
    scored.sort(key=lambda pair: -pair[1].value)
    powers = tuple((family.name, _smallest_power(drive, search.best_of(family))) for family in families())
    kept = None
    for candidate, known in scored:
        for turn in range(effort.shrinks):
            torque = drive.rigid.scaled(candidate.torque, effort.shrink**turn) if turn else candidate.torque
            command = command_of(drive, torque)
            kept, surely = _limits_kept(drive, draws, command, limits, effort)
            final: Score | None = known
            if turn or not surely:
                final = score(drive, recorded_torque(drive, command), refit=True) if surely else None
            if final is not None:
                shown = TriedMotion(candidate.family, candidate.numbers, torque, -final.value, 0.0, kept.tightest())
                return Designed(shown, final, kept, powers, len(search.done), (), ())
    name = kept.tightest() if kept is not None else "torque"
    remedy = "give more time" if name == "rest" else f"raise the limit of {name}"
    raise SettingsError(f"no motion keeps the limits for 99 % of the draws of the parameters: {remedy}")


def _limits_kept(
    drive: PlannedDrive,
    draws: Mapping[str, Array],
    command: MotionCommand,
    limits: MachineLimits,
    effort: PlanningEffort,
) -> tuple[Envelope, bool]:
    """Envelope of all draws, or of the first ones if they fail already; and if the limits are surely kept.

    The first motion that passes is taken. So the share has to be above that wanted by its confidence interval: of
    several motions that are tried with the same draws, the luckiest would pass else.
    """
    structure = drive.known.model.structure
    for count in (effort.final_draws // 10, effort.final_draws):
        seen = envelope(drive, structure, {name: values[:count] for name, values in draws.items()}, command, limits)
        failed = round((1.0 - seen.share_kept()) * count)
        if wilson_interval(effort.final_draws - failed, effort.final_draws)[0] < effort.kept:
            return seen, False
    return seen, True


def _smallest_power(drive: PlannedDrive, motion: TriedMotion) -> float | None:
    """Smallest power of a motion; None if it exceeds a limit or cannot be simulated."""
    found = score(drive, recorded_torque(drive, command_of(drive, motion.torque))) if motion.excess == 0.0 else None
    return min((a.power for a in found.answers), default=0.0) if found else None
