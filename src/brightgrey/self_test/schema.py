"""Parts of selftest.json, one class per object in it (docs/reference/selftest-json.md is the page for readers)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Literal

from pydantic import ConfigDict, Field

from brightgrey.model.schema import Part, ValuePart
from brightgrey.numerics.proportions import wilson_interval
from brightgrey.self_test.simulated_drives import DriveKind

__all__ = ["SELF_TEST_FILE", "CountPart", "NoisePart", "RecoveredPart", "SelfTest", "SimulatedDrivePart"]

SELF_TEST_FILE = "selftest.json"


class CountPart(Part):
    """Count of `hits` among `of`, with the 95 % Wilson interval of the share; it is 0 to 1 of nothing."""

    hits: int
    of: int
    ci95: tuple[float, float]

    @classmethod
    def counted(cls, hits: int, of: int) -> CountPart:
        """Part with its interval."""
        return cls(hits=hits, of=of, ci95=wilson_interval(hits, of) if of else (0.0, 1.0))

    def __str__(self) -> str:
        low, high = (100.0 * end for end in self.ci95)
        return f"{self.hits} of {self.of} ({low:.0f} to {high:.0f} %)"


class NoisePart(Part):
    """Noise that one output of one recording was simulated with: standard deviation, order of its autoregression, step.

    std is that of the residual, which is noise and rounding together.
    """

    recording: str
    output: str
    unit: str
    std: float
    order: int
    resolution: float


class RecoveredPart(Part):
    """One parameter in the draws whose structure was found again.

    covered counts the 95 % intervals that hold the simulated value. mean_error and spread are the mean and the standard
    deviation of (estimate - value) / standard deviation: 0 and 1 if the intervals are right. spread is null with less
    than two draws.
    """

    value: float
    unit: str
    covered: CountPart
    mean_error: float | None
    spread: float | None


class SimulatedDrivePart(Part):
    """One simulated drive; `found_again` counts its structure as the best one, `among_minimal` as a minimal one.

    noticed counts the draws that refute the found model, which lacks `effect`; it is null for other kinds. verdicts
    counts the verdicts on every effect, structures the best structures. failed counts draws without any result.
    """

    kind: DriveKind
    structure: str
    effect: str | None
    size: Mapping[str, ValuePart]
    found_again: CountPart
    among_minimal: CountPart
    noticed: CountPart | None
    failed: int
    structures: Mapping[str, int]
    verdicts: Mapping[str, Mapping[str, int]]
    parameters: Mapping[str, RecoveredPart]


class SelfTest(Part):
    """Self-test of an identification: how often its result comes out again from simulated recordings.

    stable counts the draws of the found model in which the verdict on an effect is that of the recording. drives has
    the found model first.
    """

    model_config = ConfigDict(serialize_by_alias=True)

    schema_version: Literal["brightgrey/selftest/1"] = Field(alias="schema", default="brightgrey/selftest/1")
    structure: str
    draws: int
    fast: bool
    found_only: bool = False
    seed: int
    noise: tuple[NoisePart, ...]
    verdicts: Mapping[str, str]
    stable: Mapping[str, CountPart]
    drives: tuple[SimulatedDrivePart, ...]
    sentences: tuple[str, ...]
    version: str

    @property
    def found(self) -> SimulatedDrivePart:
        """The drive with the found model."""
        return self.drives[0]

    def text(self) -> str:
        """Text of selftest.json: the same run, draws and seed give the same bytes."""
        return json.dumps(self.model_dump(mode="json"), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
