"""What a check is, and what it says about a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from brightgrey.recordings.checks.examined import Examined

__all__ = ["GRADES", "Check", "CheckResult", "Grade", "mind", "note", "passed", "stop"]

Grade = Literal["stop", "mind", "note", "passed"]
GRADES: tuple[Grade, ...] = ("stop", "mind", "note", "passed")
"""The gravest first: *stop* ends an identification, *mind* is likely to be a fault, *note* is good to know."""


@dataclass(frozen=True)
class CheckResult:
    """Answer of one check about one recording.

    Attributes
    ----------
    grade : {'stop', 'mind', 'note', 'passed'}
    figure : str
        What was measured, with unit.
    threshold : str
        From where on it is said, and why there; empty for a fact that needs none.
    sentence : str
        What is wrong, and what to do; empty if nothing is.
    remedy : mapping of str to object
        Changes of the options of the command line that mend it: a number multiplies the one that was given, a list
        holds ``column=factor``, ``column=shift`` or ``column:kind``. Empty if none does.
    check : str
        Name of the check.
    recording : str
        Name of the recording.
    """

    grade: Grade
    figure: str
    threshold: str = ""
    sentence: str = ""
    remedy: Mapping[str, Any] = field(default_factory=dict)
    check: str = ""
    recording: str = ""

    @property
    def text(self) -> str:
        """Recording and sentence."""
        return f"{self.recording}: {self.sentence}"


def passed(figure: str, threshold: str = "") -> CheckResult:
    """Nothing is wrong."""
    return CheckResult("passed", figure, threshold)


def note(figure: str, sentence: str, threshold: str = "", **remedy: Any) -> CheckResult:
    """Something that is good to know."""
    return CheckResult("note", figure, threshold, sentence, remedy)


def mind(figure: str, sentence: str, threshold: str = "", **remedy: Any) -> CheckResult:
    """Something that is likely to be a fault of the recording."""
    return CheckResult("mind", figure, threshold, sentence, remedy)


def stop(figure: str, sentence: str, threshold: str = "", **remedy: Any) -> CheckResult:
    """A fault that makes an identification meaningless."""
    return CheckResult("stop", figure, threshold, sentence, remedy)


@dataclass(frozen=True)
class Check:
    """A check: its name, the question that it answers, and the function that answers it.

    Attributes
    ----------
    name : str
    question : str
        One sentence with a question mark, for the help page.
    run : callable
        Takes an `Examined` recording and yields a result for each thing that it looks at; none where the question
        does not arise.
    """

    name: str
    question: str
    run: Callable[[Examined], Iterable[CheckResult]]
