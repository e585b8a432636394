"""Design of the next motion from the folder of an identification."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from brightgrey.api.control import cascade_models, total_inertia
from brightgrey.arguments import checked_arguments
from brightgrey.control.design.cascade import design_cascade, position_loop_margins
from brightgrey.errors import SettingsError, one_of
from brightgrey.model.model import Model, load_model
from brightgrey.planning.design import PLANNING_EFFORT, PlanningEffort, design_motion
from brightgrey.planning.drive import PlannedDrive
from brightgrey.planning.limits import MachineLimits
from brightgrey.planning.plan import Plan
from brightgrey.planning.position_loop import PositionLoop
from brightgrey.runs.blas_threads import one_blas_thread
from brightgrey.search.undecided.question import UNDECIDED_FILE, OpenQuestions, Question
from brightgrey.simulation import shared_cores

__all__ = ["plan"]

_LEAST_SAMPLES = 200
_MOST_SAMPLES = 50_000


@one_blas_thread()
@checked_arguments
def plan(
    run: str | Path,
    *,
    limits: Mapping[str, float] | None = None,
    loop: Literal["open", "closed"] | None = None,
    controller: Mapping[str, float] | None = None,
    decide: Sequence[str] = (),
    seconds: float | None = None,
    seed: int = 0,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
    effort: PlanningEffort = PLANNING_EFFORT,
) -> Plan:
    """Design the motion that decides what the recordings of an identification left undecided.

    Parameters
    ----------
    run : str or Path
        Folder that :func:`identify` wrote after a search.
    limits : mapping of str to float, optional
        ``torque``, ``rms_torque``, ``speed``, ``acceleration``, ``jerk``, ``travel``, ``twist`` in the units of the
        recording. What is not given is what the recordings reached; the twist is not limited then.
    loop : {'open', 'closed'}, optional
        The plan is a torque, or a setpoint for the drive's P control of position around PI control of speed. Closed if
        `controller` is given, open else.
    controller : mapping of str to float, optional
        Gains of the drive's controller in closed loop: ``position_gain`` in 1/s, ``speed_gain`` in torque per speed in
        the units of the recording, ``reset_time`` in s. By default they are designed for the model, as
        :func:`brightgrey.design` does.
    decide : sequence of str
        Effects that are to be decided; all open ones by default.
    seconds : float, optional
        Length of the motion in s; that of the longest recording by default.
    seed : int
        Seed of all random draws. The same seed gives the same plan.
    workers : int
        Threads to simulate on.
    progress : callable, optional
        Called as ``progress(done, total)`` after every motion that was tried.
    effort : PlanningEffort
        Number of motions that are tried, and of draws that have to keep the limits.

    Returns
    -------
    Plan

    Raises
    ------
    SettingsError
        If `run` holds no result of a search, for an unknown limit, gain or effect, if the drive is unstable with the
        gains, or if no motion keeps the limits.

    Notes
    -----
    In closed loop the setpoint is the motion that the identified drive makes with the feed-forward torque. The
    controller then has little to do, and the torque is recorded that decides.

    Examples
    --------
    >>> found = plan("out", limits={"torque": 6.0})  # doctest: +SKIP
    >>> print(found.sentences()[0])  # doctest: +SKIP
    Backlash: power 0.12 → 0.97
    """
    model, known = _read_run(Path(run))
    asked = _questions_for(known, decide)
    found = MachineLimits.of(known.reached, limits or {}, model.units)
    length = known.reached["duration"] if seconds is None else seconds
    samples = length / known.sampling_time
    if not _LEAST_SAMPLES <= samples <= _MOST_SAMPLES:
        raise SettingsError(
            f"a motion of {length:g} s has {samples:.0f} samples; {_LEAST_SAMPLES} to {_MOST_SAMPLES:,} are allowed"
        )
    drive = PlannedDrive(model, replace(known, questions=asked), loop=_loop_of(model, loop, controller))
    with shared_cores(workers):
        design = design_motion(drive, found, length, seed, progress or (lambda done, total: None), effort)
    return Plan(drive, found, dict(limits or {}), design, seed, gains_given=controller is not None)


def _loop_of(model: Model, loop: str | None, controller: Mapping[str, float] | None) -> PositionLoop | None:
    """Controller of the drive, by its gains or designed for the model; None in open loop."""
    if loop is not None:
        one_of("loop", loop, ("open", "closed"))
    if loop == "open" or (loop is None and controller is None):
        return None
    analyses = cascade_models(model)
    if controller is None:
        found = design_cascade(analyses, total_inertia(analyses[0]), model.settings.sampling_time)
        return PositionLoop(found.position_gain, found.speed_gain, found.reset_time)
    given = PositionLoop.of(controller, model.units)
    for a in analyses:
        if not position_loop_margins(a, given.position_gain, given.speed_gain, given.reset_time, 0.0)[0].stable:
            raise SettingsError(
                "the identified drive is unstable with these gains of the controller; look at their units: "
                + ", ".join(f"{name} in {unit}" for name, (_, unit) in given.shown(model.units).items())
            )
    return given


def _read_run(folder: Path) -> tuple[Model, OpenQuestions]:
    model = load_model(folder / "model.json")
    try:
        text = (folder / UNDECIDED_FILE).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise SettingsError(
            f"'{folder}' has no {UNDECIDED_FILE}: identify without --structure writes it, with its search to the end"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"cannot read '{folder / UNDECIDED_FILE}': {error}") from None
    try:
        known = OpenQuestions.parse(text)
    except SettingsError as error:
        raise SettingsError(f"'{folder / UNDECIDED_FILE}': {error}") from None
    if known.model.structure != str(model.structure) or len(known.noise) != len(model.outputs):
        raise SettingsError(f"'{folder}': {UNDECIDED_FILE} and model.json are not of one run; identify again")
    return model, known


def _questions_for(known: OpenQuestions, decide: Sequence[str]) -> tuple[Question, ...]:
    """Questions that were asked for."""
    open_ones = sorted({e for q in known.questions for e in q.effects})
    for effect in decide:
        if effect in known.not_asked:
            raise SettingsError(f"no motion is designed for '{effect}': {known.not_asked[effect]}")
        if not open_ones:
            raise SettingsError(f"'{effect}' is not open: the recordings have decided all effects")
        one_of("open effect", effect, open_ones)
    return tuple(q for q in known.questions if not decide or set(q.effects) & set(decide))
