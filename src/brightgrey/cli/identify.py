"""``brightgrey identify``: from recordings to a model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from brightgrey.cli.options.common import Json, OutputFolder, Quiet, Verbose
from brightgrey.cli.options.estimation import EstimationOptions, FurtherEstimationOptions
from brightgrey.cli.options.genetic import GeneticOptions
from brightgrey.cli.options.given_command import given
from brightgrey.cli.options.groups import with_options
from brightgrey.cli.options.recording import RecordingOptions
from brightgrey.cli.options.run import RunOptions
from brightgrey.cli.options.structure import StructureOptions

if TYPE_CHECKING:
    from brightgrey.search.genetic import Progress
    from brightgrey.search.progress import SearchProgress

__all__ = ["identify"]


@with_options
def identify(
    context: typer.Context,
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING", help="Recordings in any format, one or more, or a recording.toml.", show_default=False
        ),
    ],
    columns: RecordingOptions,
    structures: StructureOptions,
    estimation: EstimationOptions,
    further: FurtherEstimationOptions,
    genetic: GeneticOptions,
    run: RunOptions,
    out: OutputFolder = Path("out"),
    verbose: Verbose = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Identify a drive from recordings: its structure, unless it is given, and its parameters.

    Values are given and shown in the recording's units. DIR receives report.html, model.json, ranking.csv, fit.svg and
    run.json, after a genetic search also history.csv. DIR also stores every evaluation: the same command continues an
    interrupted run, and shows the result of a finished one.
    """
    arguments = estimation.arguments()
    columns.check()
    from brightgrey.model.files import check_folder

    check_folder(out)
    structure = structures.checked()
    settings = genetic.settings() if structures.search == "genetic" else None
    if settings is None:
        genetic.refuse(estimator=structure is None)
    run.check(structure)
    from brightgrey.api.resumable import identify_resumable
    from brightgrey.cli.terminal import results as show
    from brightgrey.cli.terminal.signals import stop_on_signal
    from brightgrey.errors import one_of
    from brightgrey.estimation.optimisation.pattern_fit import ESTIMATORS
    from brightgrey.model.model import load_model

    estimator = one_of("estimator", genetic.estimator or "least-squares", ESTIMATORS) if structure else "least-squares"
    with (
        stop_on_signal(searching=structure is None) as stop,
        run.workforce.executor() as executor,
        nullcontext(_read(columns, recordings, further.test_recording)) as data,
        _progress(structure, silent=quiet or json) as progress,
    ):
        stored = identify_resumable(
            out,
            structure=structure,
            **data,
            search=settings or structures.search,
            grammar=structures.grammar,
            require=structures.require or (),
            exclude=structures.exclude or (),
            progress=progress,
            start=load_model(further.start) if further.start else None,
            estimator=estimator,
            **further.lists(),
            seed=run.seed,
            workers=run.workers,
            executor=executor,
            budget=run.budget,
            stop=stop,
            restart=run.restart,
            summary=lambda result: show.text(result, out),
            request=given(context),
            check=not run.no_check,
            **arguments,
        )
    show.stored(stored, out, quiet=quiet, json=json, verbose=verbose)
    if stored.stopped:
        stop.exit_with_signal()


def _read(columns: RecordingOptions, recordings: Sequence[Path], test: Path | None) -> dict[str, Any]:
    """Return the recordings and the one to test with, as arguments.

    They are read before the simulator is compiled, since a user waits for that after an installation, and would then
    be told of a wrong name.
    """
    return {"recordings": columns.read_all(recordings), "test": columns.read(test) if test else None}


@contextmanager
def _progress(structure: str | None, *, silent: bool) -> Iterator[Callable[[SearchProgress | Progress], None] | None]:
    """Show on the terminal what is being done; yields the callback for the steps of a search."""
    from brightgrey.cli.terminal import results as show

    if structure is not None:
        with show.working(f"estimating the parameters of {structure}", silent=silent):
            yield None
        return
    from brightgrey.cli.terminal import progress as live  # with the search, which a given structure does not need

    with live.steps("structure search", silent=silent) as display:
        yield lambda step: display(step, "structure search")
