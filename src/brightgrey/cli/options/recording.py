"""Options that say what the columns of a recording mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from brightgrey.cli.options.common import Step, Time, Unit, numbers, pairs, units, window
from brightgrey.cli.options.groups import RECORDING
from brightgrey.errors import SettingsError

if TYPE_CHECKING:
    from brightgrey.recordings import Recording

__all__ = ["RecordingOptions", "RequiredRecordingOptions"]

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
    """Options that say what is in a file; input and output may come from elsewhere."""

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

    def check(self) -> None:
        """Refuse texts that cannot be read (SettingsError), before any file is opened."""
        from brightgrey.recordings.recording import check_hold
        from brightgrey.recordings.units.drive_scales import DriveScales

        units(self.unit or ())
        DriveScales(**_scales(asdict(self)))
        window(self.window)
        check_hold(self.hold)

    def read(self, path: Path, instead: Mapping[str, Any] | None = None) -> Recording:
        """Read a recording.

        Parameters
        ----------
        path : Path
        instead : mapping of str to object, optional
            Options of this recording that replace those of the command line.

        Raises
        ------
        BrightgreyError
            If the file, a column or an option cannot be used.
        """
        from brightgrey.recordings import read_recording
        from brightgrey.recordings.recording import check_hold

        given = {**asdict(self), **(instead or {})}
        for name in ("input", "output"):
            if not given[name]:
                raise SettingsError(f"{path}: neither the manifest nor --{name} says which column is the {name}")
        return read_recording(
            path,
            input=given["input"],
            outputs=given["output"],
            time=given["time"],
            dt=given["dt"],
            input_gain=given["input_gain"],
            units=units(given["unit"] or ()),
            window=window(given["window"]),
            decimate=given["decimate"],
            hold=check_hold(given["hold"]),
            **_scales(given),
        )


def _scales(given: Mapping[str, Any]) -> dict[str, Any]:
    """Units of drives, as arguments of `read_recording`."""
    return {
        "rated": pairs("--rated", given["rated"] or (), "NAME=VALUE with a unit, like 'torque=9.84 mN m'"),
        "counts": numbers("--counts", given["counts"] or (), "COLUMN=N, increments per turn"),
        "gear": numbers("--gear", given["gear"] or (), "COLUMN=RATIO"),
        "torque_constant": given["torque_constant"],
    }


@dataclass(frozen=True, kw_only=True)
class RequiredRecordingOptions(RecordingOptions):
    """The same where only the command line can name input and output."""

    input: Annotated[str, InputOption] = field()  # without a default, unlike that of the other class
    output: Annotated[list[str], OutputOption] = field()
