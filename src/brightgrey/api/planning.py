"""Design of the next motion from the folder of an identification."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from brightgrey.arguments import checked_arguments
from brightgrey.errors import SettingsError, one_of
from brightgrey.model.model import Model, load_model
from brightgrey.planning.design import design_motion
from brightgrey.planning.drive import PlannedDrive
from brightgrey.planning.limits import MachineLimits
from brightgrey.planning.plan import Plan
from brightgrey.runs.blas_threads import one_blas_thread
from brightgrey.search.undecided.question import UNDECIDED_FILE, OpenQuestions, Question

__all__ = ["plan"]

_LEAST_SAMPLES = 200
_MOST_SAMPLES = 50_000


@one_blas_thread()
@checked_arguments
def plan(
    run: str | Path,
    *,
    limits: Mapping[str, float] | None = None,
    decide: Sequence[str] = (),
    seconds: float | None = None,
    seed: int = 0,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Plan:
    """Design the motion that decides what the recordings of an identification left undecided.

    Parameters
    ----------
    run : str or Path
        Folder that :func:`identify` wrote after a search.
    limits : mapping of str to float, optional
        ``torque``, ``rms_torque``, ``speed``, ``acceleration``, ``jerk``, ``travel``, ``twist`` in the units of the
        recording. What is not given is what the recordings reached; the twist is not limited then.
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

    Returns
    -------
    Plan

    Raises
    ------
    SettingsError
        If `run` holds no result of a search, for an unknown limit or effect, or if no motion keeps the limits.

    Notes
    -----
    The torque is for open loop. The setpoints in the plan are the motion that the identified drive then makes.

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
    drive = PlannedDrive(model, replace(known, questions=asked), workers)
    return Plan(
        drive,
        found,
        dict(limits or {}),
        design_motion(drive, found, length, seed, progress or (lambda done, total: None)),
        seed,
    )


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
