"""Record of an identification, run.json: its recordings, its request, and the optima that it found."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, Field, ValidationError

from brightgrey.errors import SettingsError, printable
from brightgrey.model.schema import Part
from brightgrey.recordings import Recording

__all__ = ["RUN_FILE", "FittedPart", "RecordingPart", "RunRecord", "load_run_record"]

RUN_FILE = "run.json"


class RecordingPart(Part):
    """Recording of an identification; path and sha256 are null for arrays in memory.

    options are the arguments of `read_recording` that are not its defaults.
    """

    name: str
    path: str | None
    sha256: str | None
    options: Mapping[str, Any]

    @classmethod
    def of(cls, recording: Recording) -> RecordingPart:
        """Part of a recording."""
        s = recording.source
        return cls(
            name=recording.name,
            path=None if s is None else printable(s.path),
            sha256=None if s is None else s.sha256,
            options={} if s is None else s.options,
        )


class FittedPart(Part):
    """Structure that was fitted, with its best values in SI, nuisances included; status as in ranking.csv."""

    structure: str
    status: str
    values: Mapping[str, float]


class RunRecord(Part):
    """Record of an identification: enough to make it again, and to begin again at its optima.

    Bounds, fixed values and f_tanh are in SI; f_tanh is null where the width of friction's reversal was estimated.
    search is null where the structure was given. fits has the best structure first.
    """

    model_config = ConfigDict(serialize_by_alias=True)

    schema_version: Literal["brightgrey/run-record/1"] = Field(alias="schema", default="brightgrey/run-record/1")
    recordings: tuple[RecordingPart, ...]
    search: Literal["auto", "exhaustive", "genetic"] | None
    grammar: str | None
    require: tuple[str, ...]
    exclude: tuple[str, ...]
    bounds: Mapping[str, tuple[float, float]]
    fixed: Mapping[str, float]
    f_tanh: float | None
    per_recording: tuple[str, ...] = ()
    initial: Literal["auto", "rest", "samples", "estimated"]
    level: Literal["accurate", "fast"]
    seed: int
    fits: tuple[FittedPart, ...]

    def text(self) -> str:
        """Text of run.json; floats read back exactly."""
        return json.dumps(self.model_dump(mode="json"), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def load_run_record(folder: str | Path) -> RunRecord:
    """Read the run.json of a folder that `identify` has written.

    Raises
    ------
    SettingsError
        If there is none, or if it cannot be read.
    """
    file = Path(folder) / RUN_FILE
    if not Path(folder).is_dir():
        raise SettingsError(f"there is no folder '{folder}'; name the folder of an identification")
    try:
        return RunRecord.model_validate(json.loads(file.read_text(encoding="utf-8")))
    except FileNotFoundError:
        raise SettingsError(
            f"'{folder}' has no {RUN_FILE}; name a folder that this version of 'brightgrey identify' has written"
        ) from None
    except OSError as error:
        raise SettingsError(f"cannot read '{file}': {error.strerror}") from None
    except ValidationError as error:
        found = error.errors(include_url=False)[0]
        place = ".".join(map(str, found["loc"]))
        raise SettingsError(f"'{file}': field '{place}': {found['msg'][:1].lower()}{found['msg'][1:]}") from None
    except ValueError as error:  # JSON or UTF-8
        raise SettingsError(f"'{file}' is not JSON: {error}") from None
