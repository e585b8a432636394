"""Options that say what the columns of a recording mean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from brightgrey.cli.options.common import Step, Time, Unit
from brightgrey.cli.options.groups import RECORDING
from brightgrey.errors import SettingsError
from brightgrey.option_texts import reading_arguments

if TYPE_CHECKING:
    from brightgrey.recordings import Recording

__all__ = ["RecordingOptions"]

InputOption = typer.Option(
    "--input", metavar="NAME", help="Column of the input: torque, force, current, voltage.", show_default=False
)
OutputOption = typer.Option(
    "--output",
    metavar="NAME[:KIND[@MASS]]",
    help="Column of a measured motion. KIND is position, velocity, velocity-differenced (computed from the differences "
    "of an encoder), speed (a magnitude without sign) or acceleration. velocity@2 is measured at the second mass. "
    "Repeat for more outputs.",
    show_default=False,
)


@dataclass(frozen=True, kw_only=True)
class RecordingOptions:
    """Options that say what is in a file; a recording.toml or a manifest may say it, too."""

    input: Annotated[str | None, InputOption] = None
    output: Annotated[list[str] | None, OutputOption] = None
    time: Time = None
    unit: Unit = None
    dt: Step = None
    input_gain: Annotated[
        float,
        typer.Option(
            "--input-gain",
            metavar="X",
            help="Factor from the recorded input to its unit.",
            rich_help_panel=RECORDING,
        ),
    ] = 1.0
    actuator: Annotated[
        int,
        typer.Option(
            "--actuator",
            min=1,
            metavar="MASS",
            help="Mass that the input acts on, for a given structure. A search needs it at mass 1.",
            rich_help_panel=RECORDING,
        ),
    ] = 1
    window: Annotated[
        str | None,
        typer.Option("--window", metavar="A:B", help="Use only the time from A to B in s.", rich_help_panel=RECORDING),
    ] = None
    decimate: Annotated[
        int, typer.Option("--decimate", min=1, metavar="N", help="Use every Nth sample.", rich_help_panel=RECORDING)
    ] = 1
    hold: Annotated[
        str,
        typer.Option(
            "--hold",
            metavar="NAME",
            help="Input between the samples: linear (interpolated) or zoh (zero-order hold).",
            rich_help_panel=RECORDING,
        ),
    ] = "linear"

    rated: Annotated[
        list[str] | None,
        typer.Option(
            "--rated",
            metavar="NAME=VALUE",
            help="What 100 % are, for columns in %: 'torque=9.84 mN m'. NAME is a column, or torque, current, speed "
            "and the like. Repeat for more.",
            rich_help_panel=RECORDING,
        ),
    ] = None
    counts: Annotated[
        list[str] | None,
        typer.Option(
            "--counts",
            metavar="COLUMN=N",
            help="Increments per turn of a column that counts them. Repeat for more.",
            rich_help_panel=RECORDING,
        ),
    ] = None
    gear: Annotated[
        list[str] | None,
        typer.Option(
            "--gear",
            metavar="COLUMN=RATIO",
            help="Factor of an output, e.g. from an angle at the load to one at the motor. Repeat for more.",
            rich_help_panel=RECORDING,
        ),
    ] = None
    torque_constant: Annotated[
        str | None,
        typer.Option(
            "--torque-constant",
            metavar="VALUE",
            help="Torque per current of an input in A: '0.05 N m/A'.",
            rich_help_panel=RECORDING,
        ),
    ] = None

    shift: Annotated[
        list[str] | None,
        typer.Option(
            "--shift",
            metavar="COLUMN=S",
            help="Time in s that is added to the time stamps of a column whose clock is off. Repeat for more.",
            rich_help_panel=RECORDING,
        ),
    ] = None

    beside: Annotated[
        list[str] | None,
        typer.Option(
            "--beside",
            metavar="FILE",
            help="Further file with channels of this recording; its columns are called FILE.COLUMN, with the name of "
            "the file without its ending. Repeat for more.",
            rich_help_panel=RECORDING,
        ),
    ] = None

    def given(self) -> dict[str, Any]:
        """Options that are not the defaults, as a recording.toml has them."""
        return {f.name: v for f in fields(self) if (v := getattr(self, f.name)) is not None and v != f.default}

    def check(self) -> None:
        """Refuse texts that cannot be read (SettingsError), before any file is opened."""
        from brightgrey.recordings.recording import check_hold
        from brightgrey.recordings.units.drive_scales import DriveScales

        arguments = reading_arguments(asdict(self))
        DriveScales(**{name: arguments[name] for name in SCALES if name in arguments})
        check_hold(self.hold)

    def read(self, path: Path, instead: Mapping[str, Any] | None = None) -> Recording:
        """Read one recording.

        Parameters
        ----------
        path : Path
            A recording, or a recording.toml that names one.
        instead : mapping of str to object, optional
            Options of this recording that replace those of the command line.

        Raises
        ------
        BrightgreyError
            If the file, a column or an option cannot be used.
        """
        found = self.read_all([path], instead, stretches=False)
        if len(found) > 1:
            raise SettingsError(f"{path} names {len(found)} recordings; one is wanted here")
        return found[0]

    def read_all(
        self, paths: Sequence[Path], instead: Mapping[str, Any] | None = None, *, stretches: bool = True
    ) -> list[Recording]:
        """Read recordings, and all that a recording.toml names; options of the command line replace those in it.

        With `stretches` each stretch between holes in the time is a recording of its own.

        Raises
        ------
        BrightgreyError
            If a file, a column or an option cannot be used.
        """
        from brightgrey.recordings import read_recording, read_stretches
        from brightgrey.recordings.recording_toml import is_recording_toml, read_recordings

        recordings: list[Recording] = []
        if Path("+") in paths:
            raise SettingsError("'+' is no recording; a structure with blanks needs quotes: 'one_mass + coulomb'")
        for path in paths:
            if is_recording_toml(path):
                recordings += read_recordings(path, {**self.given(), **(instead or {})}, stretches=stretches)
                continue
            options = {**asdict(self), **(instead or {})}
            for name in ("input", "output"):
                if not options[name]:
                    raise SettingsError(
                        f"{path}: --{name} is missing: which column is it? 'brightgrey inspect {path}' suggests one"
                    )
            arguments = reading_arguments(options)
            recordings += read_stretches(path, **arguments) if stretches else [read_recording(path, **arguments)]
        return recordings


SCALES = ("rated", "counts", "gear", "torque_constant")
"""Options that give the units of drives."""
