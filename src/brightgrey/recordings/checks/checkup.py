"""All checks of a recording, and what they say together."""

from __future__ import annotations

import html
import importlib
import pkgutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from brightgrey.arguments import checked_arguments
from brightgrey.errors import RecordingError
from brightgrey.notebook_html import table
from brightgrey.recordings.checks import library
from brightgrey.recordings.checks.check import GRADES, Check, CheckResult, Grade, mind
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.recording import Recording

__all__ = ["Checkup", "all_checks", "check"]


@cache
def all_checks() -> tuple[Check, ...]:
    """Every check of the folder ``library``, by name."""
    modules = [importlib.import_module(f"{library.__name__}.{m.name}") for m in pkgutil.iter_modules(library.__path__)]
    return tuple(sorted((module.CHECK for module in modules), key=lambda check: check.name))


@dataclass(frozen=True)
class Checkup:
    """Results of all checks, by :func:`check`.

    Attributes
    ----------
    results : tuple of CheckResult
        The gravest first.
    """

    results: tuple[CheckResult, ...]

    def of_grade(self, *grades: Grade) -> tuple[CheckResult, ...]:
        """Results of these grades."""
        return tuple(result for result in self.results if result.grade in grades)

    @property
    def grade(self) -> Grade:
        """The gravest grade of all."""
        return self.results[0].grade if self.results else "passed"

    def remedies(self) -> dict[str, Any]:
        """Changes of options that mend what can be mended; for each column that of the gravest result."""
        together: dict[str, Any] = {}
        for result in self.results:
            for name, change in result.remedy.items():
                if not isinstance(change, list):
                    together.setdefault(name, change)
                    continue
                known = {_column(text) for text in together.setdefault(name, [])}
                together[name] += [text for text in change if _column(text) not in known]
        return together

    def refuse(self) -> None:
        """Raise RecordingError if a check says stop."""
        stops = self.of_grade("stop")
        if stops:
            more = f" (and {len(stops) - 1} more: brightgrey check)" if len(stops) > 1 else ""
            raise RecordingError(f"{stops[0].text}{more}; --no-check goes on all the same")

    def _repr_html_(self) -> str:
        rows = [(r.recording, r.check, r.grade, r.figure, html.escape(r.sentence)) for r in self.results]
        return table(("Recording", "Check", "Grade", "Figure", "What to do"), rows)


@checked_arguments
def check(recordings: Recording | Sequence[Recording]) -> Checkup:
    """Check recordings before they are used: signs, factors, clocks, repeated samples, limits, motion.

    Parameters
    ----------
    recordings : Recording or sequence of Recording

    Returns
    -------
    Checkup
        A notebook shows it as a table. Each result has a grade (``stop``, ``mind``, ``note`` or ``passed``), a figure,
        a sentence, and the options of :func:`read_recording` that mend it.

    Examples
    --------
    >>> found = check(read_recording("axis.csv", input="torque", outputs="velocity"))  # doctest: +SKIP
    >>> found.refuse()  # raises RecordingError if there is a fault that makes an identification meaningless
    ... # doctest: +SKIP
    """
    several = (recordings,) if isinstance(recordings, Recording) else tuple(recordings)
    results = []
    for recording in several:
        examined = Examined(recording)
        for one in all_checks():
            results += [replace(r, check=one.name, recording=recording.name) for r in one.run(examined)]
    results += _given_twice(several)
    return Checkup(tuple(sorted(results, key=lambda r: GRADES.index(r.grade))))


def _column(remedy: str) -> str:
    """Column of ``column=number`` or ``column:kind``."""
    return remedy.rpartition("=")[0] or remedy.rpartition(":")[0]


def _given_twice(several: Sequence[Recording]) -> list[CheckResult]:
    """Recordings with the samples of an earlier one."""
    first: dict[bytes, str] = {}
    found = []
    for recording in several:
        samples = recording.u.tobytes() + recording.y.tobytes()
        if samples in first:
            sentence = f"it has the samples of '{first[samples]}': the same recording twice tells nothing new"
            result = mind(f"{recording.samples} equal samples", f"{sentence}; leave one out")
            found.append(replace(result, check="same recording", recording=recording.name))
        first.setdefault(samples, recording.name)
    return found
