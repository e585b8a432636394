"""Commands ``analyse``, ``control`` and ``watch``: analysis, control design and fault detection with a model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from brightgrey.cli.options.common import Json, Quiet, Step, Time, Unit
from brightgrey.errors import SettingsError
from brightgrey.option_texts import number, units

__all__ = ["analyse", "control", "watch"]

ModelFile = Annotated[Path, typer.Argument(metavar="MODEL", help="model.json of an identification.")]
CONTROLLER = "'NUMERATOR / DENOMINATOR', coefficients in falling powers of s, e.g. '0.5 10 / 1 0'"


def analyse(
    model: ModelFile,
    speed: Annotated[
        float | None,
        typer.Option("--speed", metavar="X", help="Speed of the motion. Default: half of the recording's largest."),
    ] = None,
    contact: Annotated[
        str,
        typer.Option("--contact", metavar="forward|backward|gap", help="Side on which a gap is closed, or open."),
    ] = "forward",
    position: Annotated[
        float, typer.Option("--position", metavar="X", help="Position of mass 1, where a load depends on it.")
    ] = 0.0,
    controller: Annotated[
        str | None,
        typer.Option("--controller", metavar="N/D", help=f"Controller on the first output: {CONTROLLER}."),
    ] = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Linearise a model in steady motion: poles, resonances, controllability, observability, stability margins.

    Poles are in 1/s. The controller of --controller has SI units.
    """
    coefficients = _controller(controller) if controller else None
    from brightgrey.cli.terminal import control as show_work
    from brightgrey.model.model import load_model

    loaded = load_model(model)
    from brightgrey.api.control import analyse as run
    from brightgrey.control.linear.margins import Compensator

    found = run(loaded, speed=speed, contact=contact, position=position)
    margins = found.margins(Compensator.of(*coefficients)) if coefficients else None
    show_work.show_analysis(found, margins, quiet=quiet, json=json)


def control(
    model: ModelFile,
    torque: Annotated[float, typer.Option("--torque", metavar="X", help="Largest torque, in the input's unit.")],
    dt: Annotated[
        float | None,
        typer.Option("--dt", metavar="S", help="Sampling time of the controller in s. Default: the recording's."),
    ] = None,
    computing: Annotated[
        float, typer.Option("--computing", metavar="S", help="Time from sampling to output in s.")
    ] = 0.0,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Suggest gains of a cascade, P position and PI speed control, and of a state feedback with integral action.

    Gains are in the units of the recording.
    """
    from brightgrey.cli.terminal import control as show_work
    from brightgrey.cli.terminal import results as show
    from brightgrey.model.model import load_model

    loaded = load_model(model)
    from brightgrey.api.control import design

    with show.working("designing", silent=quiet or json):
        found = design(loaded, torque=torque, sampling_time=dt, computing_time=computing)
    show_work.show_design(found, quiet=quiet, json=json)


def watch(
    model: ModelFile,
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Recording to look for faults in.")],
    baseline: Annotated[
        Path,
        typer.Option(
            "--baseline", metavar="FILE", help="Recording without fault, best the one the model was identified from."
        ),
    ],
    min_change: Annotated[
        float, typer.Option("--min-change", metavar="X", help="Smallest relative change to report.")
    ] = 0.1,
    confidence: Annotated[
        float, typer.Option("--confidence", metavar="P", help="Probability at which a change is reported.")
    ] = 0.99,
    time: Time = None,
    dt: Step = None,
    unit: Unit = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Look for faults in a new recording: friction or backlash that has grown, a load that has changed."""
    given = units(unit or ())
    from brightgrey.cli.terminal import control as show_work
    from brightgrey.cli.terminal import results as show
    from brightgrey.model.model import load_model

    loaded = load_model(model)
    from brightgrey.api.fault_detection import watch as run
    from brightgrey.api.simulation import read_for

    before, now = (read_for(loaded, f, time=time, dt=dt, units=given) for f in (baseline, recording))
    with show.working("looking for faults", silent=quiet or json):
        found = run(loaded, now, baseline=before, min_change=min_change, confidence=confidence)
    show_work.show_watch(found, quiet=quiet, json=json)


def _controller(text: str) -> tuple[list[float], list[float]]:
    """Numerator and denominator of ``--controller``."""
    top, slash, bottom = text.partition("/")
    parts = [part.replace(",", " ").split() for part in (top, bottom)]
    if not slash or not all(parts):
        raise SettingsError(f"--controller '{text}' is no transfer function; write {CONTROLLER}")
    first, second = ([number("--controller", value, CONTROLLER) for value in part] for part in parts)
    return first, second
