"""``brightgrey selftest``: identify simulated recordings of the found model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from brightgrey.cli.options.common import CORES, Json, Quiet, Seed, Workers
from brightgrey.cli.options.groups import RUN

__all__ = ["selftest"]


def selftest(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder that an identification has written.")],
    draws: Annotated[
        int,
        typer.Option("--draws", min=1, metavar="N", help="Simulated recordings of each drive.", rich_help_panel=RUN),
    ] = 10,
    fast: Annotated[
        bool,
        typer.Option(
            "--fast",
            help="Begin at the optima of the run and seek no others. That leaves out that a search may miss one.",
            rich_help_panel=RUN,
        ),
    ] = False,
    found_only: Annotated[
        bool,
        typer.Option(
            "--found-only",
            help="Simulate the found model only: no equivalent structure, and no effect that is not needed.",
            rich_help_panel=RUN,
        ),
    ] = False,
    seed: Seed = 0,
    workers: Workers = CORES,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Simulate recordings of the found model, identify them anew, and say how often the result comes out again.

    The equivalent structures are simulated as well, and the model with each effect that is not needed, at the least
    size that matters. Inputs are those recorded, and noise has the colour and size of the residual. RUN receives
    selftest.json and a section in report.html. After Ctrl-C the same command goes on.
    """
    from brightgrey.cli.terminal import progress as live
    from brightgrey.cli.terminal import self_test as show
    from brightgrey.cli.terminal.signals import stop_on_signal
    from brightgrey.model.files import check_folder

    check_folder(run)
    with stop_on_signal() as stop, live.counted("self-test", silent=quiet or json) as progress:
        from brightgrey.api.self_test import selftest as test
        from brightgrey.api.self_test import write_selftest

        found = test(
            run,
            draws=draws,
            fast=fast,
            found_only=found_only,
            seed=seed,
            workers=workers,
            progress=progress,
            stop=stop,
        )
        write_selftest(found, run)
    show.self_test(found, run, quiet=quiet, json=json)
