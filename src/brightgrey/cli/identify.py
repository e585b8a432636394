"""``brightgrey identify``: from recordings to a model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from brightgrey.cli import options
from brightgrey.cli.options import Json, Quiet, Seed, Step, Time, Unit, Workers
from brightgrey.errors import SettingsError

__all__ = ["identify"]

Recordings = Annotated[list[Path], typer.Argument(metavar="RECORDING…", help="CSV or MAT files, one or more.")]
Input = Annotated[str, typer.Option("--input", metavar="NAME", help="Column of the input: torque, force, voltage …")]
Output = Annotated[
    list[str],
    typer.Option(
        "--output",
        metavar="NAME[:KIND]",
        help="Measured column; KIND is position, velocity, velocity-differenced (made by differencing an "
        "encoder) or acceleration. May be repeated.",
    ),
]
StructureOption = Annotated[
    str | None,
    typer.Option("--structure", metavar="EFFECT+…", help="Effects in the model; 'brightgrey effects' lists them."),
]
Gain = Annotated[
    float,
    typer.Option("--input-gain", metavar="X", help="Recorded input times X stands in the input's unit."),
]
Window = Annotated[str | None, typer.Option("--window", metavar="A:B", help="Use only the time from A to B in s.")]
Decimate = Annotated[int, typer.Option("--decimate", min=1, metavar="N", help="Use every Nth sample.")]
Hold = Annotated[
    str, typer.Option("--hold", metavar="linear|zoh", help="Input between samples: straight lines, or held.")
]
Bound = Annotated[
    list[str] | None,
    typer.Option(
        "--bound",
        metavar="NAME=LOW:HIGH",
        help="Range of a parameter in the recording's units, instead of the one found in the recording; also "
        "'NAME=50%:200% of VALUE' around an assumed value. May be repeated.",
    ),
]
Fix = Annotated[
    list[str] | None,
    typer.Option("--fix", metavar="NAME=VALUE", help="Do not estimate this parameter. May be repeated."),
]
Sharpness = Annotated[
    float | None,
    typer.Option(
        "--f-tanh",
        metavar="X",
        help="Gain of the smoothed sign of friction per unit of speed. Default: 100 over the largest speed.",
    ),
]
Start = Annotated[
    Path | None,
    typer.Option("--start", metavar="MODEL", help="A model.json; the estimation starts there, too."),
]
Test = Annotated[
    Path | None,
    typer.Option("--test-recording", metavar="FILE", help="Predict this recording with the model, too."),
]
Begin = Annotated[
    str,
    typer.Option(
        "--initial",
        metavar="auto|rest|samples|estimated",
        help="State before the first sample: at rest, moving as the first samples say, or estimated within what "
        "their noise leaves open. auto is rest, or estimated if the first samples clearly move.",
    ),
]
Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")]


def identify(
    recordings: Recordings,
    input: Input,
    output: Output,
    structure: StructureOption = None,
    time: Time = None,
    dt: Step = None,
    input_gain: Gain = 1.0,
    unit: Unit = None,
    window: Window = None,
    decimate: Decimate = 1,
    hold: Hold = "linear",
    bound: Bound = None,
    fix: Fix = None,
    f_tanh: Sharpness = None,
    start: Start = None,
    test_recording: Test = None,
    initial: Begin = "auto",
    seed: Seed = 0,
    workers: Workers = 1,
    out: Out = Path("out"),
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Estimate the parameters of a structure from recordings.

    Writes report.html, model.json, ranking.csv and fit.png to DIR.

    All values, in and out, stand in the recording's units.
    """
    ranges, constants = options.bounds(bound or ()), options.fixed(fix or ())
    units, part = options.units(unit or ()), options.window(window)
    from brightgrey.cli import show
    from brightgrey.export.files import check_folder
    from brightgrey.recordings.recording import check_hold

    check_folder(out)
    chosen = _structure(structure)
    held = check_hold(hold)
    from brightgrey import api
    from brightgrey.estimation.onset import check_initial

    begin = check_initial(initial)

    def read(file: Path) -> api.Recording:
        return api.read_recording(
            file,
            input=input,
            outputs=output,
            time=time,
            dt=dt,
            input_gain=input_gain,
            units=units,
            window=part,
            decimate=decimate,
            hold=held,
        )

    with show.working(f"estimating the parameters of {structure}", silent=quiet or json):
        result = api.identify(
            [read(file) for file in recordings],
            chosen,
            bounds=ranges,
            fixed=constants,
            f_tanh=f_tanh,
            start=api.Model.load(start) if start else None,
            test=read(test_recording) if test_recording else None,
            initial=begin,
            seed=seed,
            workers=workers,
        )
        result.write(out)
    show.result(result, out, quiet=quiet, json=json)


def _structure(text: str | None) -> str:
    """Refuse what is no structure before any file is read."""
    from brightgrey.kit import PAPER

    if text is None:
        smallest = next(PAPER.structures())
        raise SettingsError(
            f"option --structure is needed, for example --structure {smallest}; 'brightgrey effects' lists the effects"
        )
    return str(PAPER.parse(text))
