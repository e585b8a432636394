"""``brightgrey plan``: the motion to record next."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from brightgrey.cli.options.common import CORES, Json, OutputFolder, Quiet, Seed, Workers

if TYPE_CHECKING:
    from brightgrey.planning.plan import Plan

__all__ = ["plan"]


def plan(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder that identify wrote after a search.")],
    limits: Annotated[
        Path | None,
        typer.Option(
            "--limits",
            metavar="FILE",
            help="TOML with torque, rms_torque, speed, acceleration, jerk, travel and twist, in the recording's units. "
            "Default: what the recordings reached. A table [controller] has the gains of the drive's controller.",
        ),
    ] = None,
    loop: Annotated[
        Literal["open", "closed"] | None,
        typer.Option(
            "--loop",
            help="Plan a torque, or a setpoint for the drive's controller of position and speed. Default: closed if "
            "the limits have a table [controller]; without one, closed takes gains that suit the model.",
        ),
    ] = None,
    decide: Annotated[
        list[str] | None,
        typer.Option("--decide", metavar="EFFECT", help="Effect to decide. Repeat for more. Default: all open ones."),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option("--seconds", metavar="S", help="Length of the motion in s. Default: that of the recording."),
    ] = None,
    out: OutputFolder = Path("plan"),
    seed: Seed = 0,
    workers: Workers = CORES,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Design the motion that decides what the last recordings left undecided.

    DIR receives plan.csv (time, position, velocity, acceleration, torque), plan.toml and plan.svg. Command the torque
    of plan.csv at the machine, or in closed loop its setpoint with the torque as feed-forward. Record it, and identify
    the old and the new recording together.
    """
    from brightgrey.cli.terminal import results as show
    from brightgrey.model.files import check_folder, write_files

    check_folder(out)
    from brightgrey.cli.terminal.signals import stop_on_signal

    with stop_on_signal() as stop, _motions_tried(silent=quiet or json) as show_progress:
        # behind the signal's handler: Python may drop an interrupt that comes while it imports
        from brightgrey.api.planning import plan as design
        from brightgrey.planning.limits import read_limits
        from brightgrey.report.charts.planned_motion import planned_motion
        from brightgrey.report.drawing.svg_figure import svg_figure

        given, controller = read_limits(limits) if limits else ({}, None)

        def progress(done: int, total: int) -> None:
            if stop.number is not None:
                raise typer.Exit(_interrupted(stop.number))
            show_progress(done, total)

        found = design(
            run,
            limits=given,
            loop=loop,
            controller=controller,
            decide=decide or (),
            seconds=seconds,
            seed=seed,
            workers=workers,
            progress=progress,
        )
        files = {
            "plan.csv": found.csv_text().encode(),
            "plan.toml": found.toml_text().encode(),
            "plan.svg": svg_figure([planned_motion(found.columns)]).encode(),
        }
        write_files(out, files)
    if json:
        show.as_json(_as_data(found))
    elif not quiet:
        show.sentences([f"{line}." for line in (*found.sentences(), *found.cautions())])
        print(f"Results are in {out}: {', '.join(files)}")


def _interrupted(number: int) -> int:
    """Say that nothing was written, and give the exit code of a signal."""
    typer.echo("brightgrey: interrupted, nothing written", err=True)
    return 128 + number


def _as_data(found: Plan) -> dict[str, object]:
    return {
        "decides": [vars(d) for d in found.decisions],
        "family": found.found.candidate.family.name,
        "seconds": found.seconds,
        "use_of_limits": {name: found.use(name) for name in found.found.envelope.use},
        "controller": {name: value for name, (value, _) in found.controller.items()} or None,
        "parameters": found.gains,
        "cautions": found.cautions(),
    }


@contextmanager
def _motions_tried(*, silent: bool) -> Iterator[Callable[[int, int], None]]:
    """Show on a terminal's stderr how many motions were tried."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    from brightgrey.cli.terminal import results as show
    from brightgrey.cli.terminal.compilation import compile_kernel

    compile_kernel(silent=silent)
    if silent or not sys.stderr.isatty():
        yield lambda done, total: None
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(bar_width=20), MofNCompleteColumn())
    with Progress(*columns, console=show.screen(stderr=True), transient=True) as progress:
        task = progress.add_task("motions tried", total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)
