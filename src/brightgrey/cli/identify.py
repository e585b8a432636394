"""``brightgrey identify``: from recordings to a model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from brightgrey.cli.options import common as options
from brightgrey.cli.options import genetic
from brightgrey.cli.options.common import (
    CORES,
    Dask,
    Json,
    MaxEvaluations,
    MaxSeconds,
    Processes,
    Quiet,
    Restart,
    Seed,
    Step,
    Time,
    Unit,
    Workers,
)
from brightgrey.cli.options.given_command import given
from brightgrey.errors import SettingsError, unknown_name

if TYPE_CHECKING:
    from brightgrey.search.exhaustive import SearchProgress
    from brightgrey.search.genetic import Progress

__all__ = ["checked_structure", "identify"]

SEARCHES = ("auto", "exhaustive", "genetic")

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
Search = Annotated[
    str | None,
    typer.Option(
        "--search",
        metavar="auto|exhaustive|genetic",
        help="How the structure is searched for if none is named: all of them, with evidence, or genetic "
        "programming. auto (the default) tries all while that takes minutes at most.",
    ),
]
Require = Annotated[
    list[str] | None,
    typer.Option("--require", metavar="EFFECT", help="Every structure searched has this effect. May be repeated."),
]
Exclude = Annotated[
    list[str] | None,
    typer.Option("--exclude", metavar="EFFECT", help="No structure searched has this effect. May be repeated."),
]
Profile = Annotated[
    list[str] | None,
    typer.Option(
        "--profile",
        metavar="NAME",
        help="Find the interval of this parameter by profile likelihood, too. May be repeated.",
    ),
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
    context: typer.Context,
    recordings: Recordings,
    input: Input,
    output: Output,
    structure: StructureOption = None,
    search: Search = None,
    require: Require = None,
    exclude: Exclude = None,
    preset: genetic.Preset = "paper",
    population: genetic.Population = None,
    generations: genetic.Generations = None,
    iterations: genetic.Iterations = None,
    estimator: genetic.Estimator = None,
    criterion: genetic.CriterionName = None,
    p_clone: genetic.Clone = None,
    k_p: genetic.Kp = None,
    mutation: genetic.Mutation = None,
    elite: genetic.Elite = None,
    max_remutations: genetic.MaxRemutations = None,
    neighbours: genetic.Neighbours = None,
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
    profile: Profile = None,
    initial: Begin = "auto",
    seed: Seed = 0,
    workers: Workers = CORES,
    processes: Processes = False,
    dask: Dask = None,
    max_evaluations: MaxEvaluations = None,
    max_seconds: MaxSeconds = None,
    restart: Restart = False,
    out: Out = Path("out"),
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Estimate the parameters of a structure from recordings, or search for the structure, too.

    Writes report.html, model.json, ranking.csv and fit.svg to DIR; a genetic search adds history.csv. What has been
    evaluated is kept in DIR as well: the same command goes on after an interruption, and gives the result at once
    after the end.

    All values, in and out, stand in the recording's units.
    """
    ranges, constants = options.bounds(bound or ()), options.fixed(fix or ())
    units, part = options.units(unit or ()), options.window(window)
    from brightgrey.cli.terminal import results as show
    from brightgrey.model.files import check_folder
    from brightgrey.recordings.recording import check_hold

    check_folder(out)
    chosen = checked_structure(structure, search, (*(require or ()), *(exclude or ())))
    settings = (genetic.genetic_settings if search == "genetic" else genetic.refuse_genetic_options)(
        preset,
        mutation,
        population=population,
        generations=generations,
        iterations=iterations,
        estimator=None if chosen else estimator,
        criterion=criterion,
        p_clone=p_clone,
        k_p=k_p,
        elite=elite,
        max_remutations=max_remutations,
        n_neighbours=neighbours,
    )
    held = check_hold(hold)
    from brightgrey.api.resumable import identify_resumable
    from brightgrey.cli.terminal.signals import signals
    from brightgrey.estimation.optimisation.pattern_fit import check_estimator
    from brightgrey.estimation.problem.initial_state import check_initial
    from brightgrey.model.model import load_model
    from brightgrey.recordings import Recording, read_recording
    from brightgrey.runs import Budget, Workforce

    method = check_estimator(estimator or "least-squares") if structure else "least-squares"
    begin = check_initial(initial)
    check_for_search(structure, processes, dask, max_evaluations, max_seconds)
    workforce, budget = Workforce(workers, processes, dask), Budget(max_evaluations, max_seconds)

    def read(file: Path) -> Recording:
        return read_recording(
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

    with (
        signals() as stop,
        workforce.executor() as executor,
        _display(structure, silent=quiet or json) as progress,
    ):
        kept = identify_resumable(
            out,
            [read(file) for file in recordings],
            chosen,
            search=settings or search,
            require=require or (),
            exclude=exclude or (),
            progress=progress,
            bounds=ranges,
            fixed=constants,
            f_tanh=f_tanh,
            start=load_model(start) if start else None,
            test=read(test_recording) if test_recording else None,
            estimator=method,
            profile=profile or (),
            initial=begin,
            seed=seed,
            workers=workers,
            executor=executor,
            budget=budget,
            stop=stop,
            restart=restart,
            summary=lambda result: show.text(result, out),
            request=given(context),
        )
    show.kept(kept, out, quiet=quiet, json=json)
    if kept.stopped:
        stop.leave()


@contextmanager
def _display(structure: str | None, *, silent: bool) -> Iterator[Callable[[SearchProgress | Progress], None] | None]:
    """Say on the terminal what is going on; gives what a search reports its steps to."""
    from brightgrey.cli.terminal import progress as live
    from brightgrey.cli.terminal import results as show

    if structure is not None:
        with show.working(f"estimating the parameters of {structure}", silent=silent):
            yield None
        return
    with live.steps("structure search", silent=silent) as display:
        yield lambda step: display(step, "structure search")


def check_for_search(structure: str | None, *options: object) -> None:
    """Refuse options on the work of a search where there is none."""
    if structure and any(options):
        raise SettingsError("--processes, --dask, --max-evaluations and --max-seconds belong to a search")


def checked_structure(
    text: str | None, search: str | None, effects: Sequence[str], searches: Sequence[str] = SEARCHES
) -> str | None:
    """Refuse what is no structure, and no search, before any file is read."""
    from brightgrey.kit import function_set
    from brightgrey.search.exhaustive import candidates

    if text is not None:
        if search is not None or effects:
            raise SettingsError("--structure excludes --search, --require and --exclude")
        return str(function_set().parse(text))
    if search not in (None, *searches):
        raise SettingsError(unknown_name("search", str(search), searches))
    if search == "genetic" and effects:
        raise SettingsError("--require and --exclude belong to the exhaustive search")
    candidates(effects, grammar=function_set())
    return None
