"""Open questions as data: undecided.json, schema ``brightgrey/undecided/2``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Self

from brightgrey.effects import Scales
from brightgrey.errors import SettingsError

__all__ = ["UNDECIDED_FILE", "UNDECIDED_SCHEMA", "Known", "LargestRival", "OpenQuestions", "OutputNoise", "Question"]

UNDECIDED_SCHEMA = "brightgrey/undecided/2"
UNDECIDED_FILE = "undecided.json"


@dataclass(frozen=True)
class Known:
    """Knowledge of a structure near its optimum: whitened normal equations, noise of variance 1."""

    structure: str
    values: Mapping[str, float]  #: SI; all parameters, and the width of friction's reversal if it is estimated.
    names: tuple[str, ...]  #: Parameters of the normal equations, in the scaled space of the search.
    information: tuple[tuple[float, ...], ...]  #: J' J of the whitened outputs, shape (P, P).


@dataclass(frozen=True)
class LargestRival:
    """Largest structure that lacks one effect of a truth: unless it is refuted, that effect is not needed.

    Its changes are those from the truth to it, and from the question's own rival to it.
    """

    known: Known
    gradients: tuple[
        tuple[float, ...], tuple[float, ...]
    ]  #: Of half its whitened cost under each change, shape (2, P).
    deviances: tuple[tuple[float, float], tuple[float, float]]  #: Products of the whitened changes, shape (2, 2).


@dataclass(frozen=True)
class Question:
    """A truth that the recordings cannot tell from a rival."""

    effects: tuple[str, ...]  #: Effects by which the two differ.
    kind: str  #: 'size': an effect of a size that matters, or none. 'tied': two minimal structures.
    truth: str
    values: Mapping[str, float]  #: Of the truth, SI.
    rival: Known
    gradient: tuple[float, ...]  #: Of half the rival's whitened cost under the truth, in the recordings, shape (P,).
    deviance: float  #: Whitened sum of squares between truth and rival in the recordings.
    parameters: int  #: Degrees of freedom of the test.
    critical: float  #: Deviance that has to be exceeded by chance; what matters materially comes on top.
    #: Part of its own effects from which on all have a size that matters; truths between tied structures begin there.
    least_share: float = 0.0
    largest: tuple[LargestRival, ...] = ()  #: Largest structures that lack one of the effects which the rival lacks.


@dataclass(frozen=True)
class OutputNoise:
    """Noise of one output: an autoregression in units of the weighted output."""

    weight: float  #: Weight of the output in the cost, 1/SI.
    a: tuple[float, ...]
    variance: float


@dataclass(frozen=True)
class OpenQuestions:
    """All that a plan needs of a search; SI throughout."""

    schema: str
    sampling_time: float
    samples: int  #: Of all recordings.
    deviance: float  #: Of the best structure.
    material_growth: float  #: Part of the deviance that does not matter.
    error_floor: float  #: Deviance that errors of simulation and sensor may cause in these recordings.
    noise: tuple[OutputNoise, ...]  #: One per output.
    model: Known  #: The best structure.
    questions: tuple[Question, ...]
    not_asked: Mapping[str, str]  #: Undecided effects that no motion is designed for, with the reason.
    reached: Mapping[str, float]  #: Largest torque, speed and so on of the recordings; see `brightgrey plan`.
    scales: Scales  #: Of the recordings; they give the ranges of parameters.
    bounds: Mapping[str, tuple[float, float]]  #: Ranges that the user gave, SI.

    def text(self) -> str:
        """Text of undecided.json."""
        return json.dumps(asdict(self), indent=1, allow_nan=False) + "\n"

    @classmethod
    def parse(cls, text: str) -> Self:
        """Questions from the text of undecided.json.

        Raises
        ------
        SettingsError
            If it is not such a text.
        """
        try:
            data = json.loads(text)
            schema = data["schema"]
            if schema == UNDECIDED_SCHEMA:
                data["scales"] = Scales(**{name: float(size) for name, size in data["scales"].items()})
                data["bounds"] = {name: (float(low), float(high)) for name, (low, high) in data["bounds"].items()}
                data["noise"] = tuple(OutputNoise(**{**n, "a": tuple(n["a"])}) for n in data["noise"])
                data["model"] = _known(data["model"])
                data["questions"] = tuple(_question(q) for q in data["questions"])
                return cls(**data)
        except (KeyError, TypeError, AttributeError, ValueError) as why:
            raise SettingsError(f"this is no result of a search: {type(why).__name__} {why}") from None
        raise SettingsError(f"schema is '{schema}'; this version reads '{UNDECIDED_SCHEMA}': identify again")


def _known(data: dict[str, Any]) -> Known:
    return Known(**{**data, "names": tuple(data["names"]), "information": tuple(map(tuple, data["information"]))})


def _question(data: dict[str, Any]) -> Question:
    lists = {"effects": tuple(data["effects"]), "gradient": tuple(data["gradient"])}
    largest = tuple(map(_largest, data.get("largest", ())))
    return Question(**{**data, **lists, "rival": _known(data["rival"]), "largest": largest})


def _largest(data: dict[str, Any]) -> LargestRival:
    first, second = map(tuple, data["gradients"])
    (a, b), (c, d) = data["deviances"]
    return LargestRival(_known(data["known"]), (first, second), ((a, b), (c, d)))
