"""Document of a project: what the user has chosen in each stage, frozen; a change gives a new document."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

__all__ = [
    "MASS_EFFECTS",
    "AxisChoice",
    "CheckDecision",
    "KnownParameter",
    "ProjectDocument",
    "RunEntry",
    "SearchChoice",
    "StoredRecording",
    "digest_of_recordings",
    "digest_of_search",
]

MASS_EFFECTS = {1: "one_mass", 2: "two_mass", 3: "three_mass", 4: "four_mass"}
"""Effect that brings so many masses."""
RecordingUse = Literal["train", "test", "unused"]


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class KnownParameter(_Frozen):
    """Value or range of a parameter, as it was typed, in the recording's units."""

    name: str
    low: str = ""
    high: str = ""  #: Empty for a value that is known.


class AxisChoice(_Frozen):
    """Choices before the first recording."""

    confirmed: bool = False  #: The user has gone on from this stage.
    motion: Literal["rotary", "linear"] = "rotary"
    least_masses: int = Field(default=1, ge=1, le=4)
    most_masses: int = Field(default=4, ge=1, le=4)
    certain: tuple[str, ...] = ()  #: Effects that the drive has for sure.
    absent: tuple[str, ...] = ()  #: Effects that it certainly lacks.
    known: tuple[KnownParameter, ...] = ()
    limits: Mapping[str, str] = Field(default_factory=dict)  #: Of the machine, as typed, in the recording's units.

    @property
    def usable_limits(self) -> dict[str, float]:
        """Limits whose text is a number above 0, in the recording's units."""
        found = {}
        for name, text in self.limits.items():
            try:
                value = float(text)
            except ValueError:
                continue
            if 0.0 < value < float("inf"):
                found[name] = value
        return found

    @property
    def required(self) -> tuple[str, ...]:
        """Effects that every structure has, for ``--require``; masses count cumulatively."""
        return (*((MASS_EFFECTS[self.least_masses],) if self.least_masses > 1 else ()), *self.certain)

    @property
    def excluded(self) -> tuple[str, ...]:
        """Effects that no structure has, for ``--exclude``."""
        beyond = MASS_EFFECTS.get(self.most_masses + 1)
        return (*((beyond,) if beyond else ()), *self.absent)


class StoredRecording(_Frozen):
    """A recording in the workspace. Its file has a random name; the name that it came with is only shown."""

    file: str
    label: str
    sha256: str
    size: int  #: Bytes.
    use: RecordingUse = "train"
    options: Mapping[str, Any] = Field(default_factory=dict)  #: As a recording.toml has them.


class CheckDecision(_Frozen):
    """Outcome of the checks, and of which recordings it was."""

    digest: str = ""
    grade: Literal["", "stop", "mind", "note", "passed"] = ""
    override: bool = False  #: Go on where a check says stop.


class SearchChoice(_Frozen):
    """Kind of the search."""

    grammar: Literal["drive", "paper"] = "drive"
    seed: int = Field(default=0, ge=0)
    per_recording: str = ""  #: Names of the parameters that may differ between recordings, with commas.


class RunEntry(_Frozen):
    """An identification: its folder below `runs`, its arguments, and what is wanted of it."""

    name: str
    digest: str
    arguments: tuple[str, ...]
    wanted: Literal["running", "paused"] = "running"


class ProjectDocument(_Frozen):
    """Everything that was chosen in a project."""

    schema_version: Literal["brightgrey/project/1"] = "brightgrey/project/1"
    name: str  #: Of the folder: letters, digits and hyphens.
    title: str
    drive: AxisChoice = AxisChoice()
    recordings: tuple[StoredRecording, ...] = ()
    check: CheckDecision = CheckDecision()
    search: SearchChoice = SearchChoice()
    runs: tuple[RunEntry, ...] = ()  #: The oldest first.

    def with_recording(self, file: str, **changes: Any) -> ProjectDocument:
        """Document with changes of the recording whose file is called so."""
        changed = (r.model_copy(update=changes) if r.file == file else r for r in self.recordings)
        return self.model_copy(update={"recordings": tuple(changed)})

    def with_run(self, name: str, **changes: Any) -> ProjectDocument:
        """Document with changes of one run."""
        changed = (r.model_copy(update=changes) if r.name == name else r for r in self.runs)
        return self.model_copy(update={"runs": tuple(changed)})

    def of_use(self, use: RecordingUse) -> tuple[StoredRecording, ...]:
        """Recordings that are used so."""
        return tuple(r for r in self.recordings if r.use == use)


def digest_of_recordings(document: ProjectDocument) -> str:
    """Digest of all that the checks depend on."""
    used = [r for r in document.recordings if r.use != "unused"]
    return _digest([[r.file, r.sha256, r.use, dict(r.options)] for r in used])


def digest_of_search(document: ProjectDocument) -> str:
    """Digest of all that an identification depends on."""
    drive = document.drive.model_dump(mode="json", exclude={"confirmed", "limits", "motion"})
    search = {name: value for name, value in document.search.model_dump().items() if value != ""}
    return _digest([digest_of_recordings(document), drive, search, document.check.override])


def _digest(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]
