"""Identification into a folder that keeps all that has been evaluated: it can be interrupted and taken up again."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numba
import numpy
import scipy

from brightgrey.api.identification import identify
from brightgrey.api.result import Result
from brightgrey.errors import BrightgreyError
from brightgrey.kit import function_set
from brightgrey.model.files import check_folder, write_files
from brightgrey.model.model import Model
from brightgrey.recordings import Recording
from brightgrey.runs import Budget, CachingExecutor, RunError, RunStatus, Stop, Store, read_status
from brightgrey.runs.serialisation import canonical, code, digest
from brightgrey.runs.store import FILE
from brightgrey.search.genetic import GeneticSettings, Progress
from brightgrey.search.parallel import Stopped, thread_pool
from brightgrey.search.survey import SearchProgress
from brightgrey.version import __version__

__all__ = ["StoredRun", "identify_resumable", "list_runs", "request_of"]

PRINTED = "printed.txt"
_ELSEWHERE = ("recordings", "test", "start", "search", "structure", "progress", "workers", "executor")


@dataclass(frozen=True)
class StoredRun:
    """What a folder holds after :func:`identify_into`.

    Attributes
    ----------
    files : mapping of str to bytes
        Results by file name.
    printed : str
        What was said of them.
    result : Result or None
        None where an earlier call had finished the run: nothing was computed then.
    """

    files: Mapping[str, bytes] = field(repr=False)
    printed: str
    result: Result | None

    @property
    def stopped(self) -> bool:
        """Whether this is only the best so far."""
        return self.result is not None and self.result.stopped

    @property
    def model(self) -> Model:
        """The identified model."""
        return Model.check(json.loads(self.files["model.json"]))


def request_of(recordings: Recording | Sequence[Recording], structure: Any = None, **options: Any) -> dict[str, Any]:
    """All that the result of :func:`identify` depends on, as plain data: what a run is recognised by."""
    given = inspect.signature(identify).bind(recordings, structure, **options)
    given.apply_defaults()
    asked = given.arguments
    several = (recordings,) if isinstance(recordings, Recording) else tuple(recordings)
    request = {name: value for name, value in asked.items() if name not in _ELSEWHERE}
    request |= {name: sorted(set(asked[name])) for name in ("require", "exclude")}
    request |= {f"recording {i}": _about(r) for i, r in enumerate(several, 1)}
    if asked["test"] is not None:
        request["test recording"] = _about(asked["test"])
    if asked["start"] is not None:
        request["start model"] = digest(asked["start"].text())[:16]
    search = asked["search"]
    if structure is not None:
        request["structure"] = str(function_set().parse(str(structure)))
    elif isinstance(search, GeneticSettings):
        request |= {"search": "genetic"} | {f"genetic {name}": value for name, value in asdict(search).items()}
    else:
        request["search"] = search or "auto"
    versions = {"brightgrey": __version__, "numpy": numpy.__version__, "scipy": scipy.__version__}
    request["versions"] = {**versions, "numba": numba.__version__, "code": code()}
    plain: dict[str, Any] = json.loads(canonical(request))
    return plain


def _about(recording: Recording) -> str:
    return f"{recording.name} ({recording.fingerprint[:16]})"


def identify_resumable(
    folder: str | Path,
    recordings: Recording | Sequence[Recording],
    structure: Any = None,
    *,
    executor: Executor | None = None,
    budget: Budget | None = None,
    stop: Stop | None = None,
    restart: bool = False,
    progress: Callable[[SearchProgress | Progress], None] | None = None,
    printed: Callable[[Result], str] = lambda result: "",
    request: str = "",
    **options: Any,
) -> StoredRun:
    """Call :func:`identify` and write its results to `folder`, with every evaluation on the way.

    Called again after an interruption of any kind, it goes on, and ends with the same bytes. After its end it gives
    the results at once.

    Parameters
    ----------
    folder : str or Path
        For this run alone.
    recordings, structure
        See :func:`identify`.
    executor : Executor, optional
        Makes the evaluations of a search; one thread if there is none.
    budget : Budget, optional
    stop : Stop, optional
        Ends a search with the best so far when it is told.
    restart : bool
        Forget the run that is there.
    progress : callable, optional
    printed : callable, optional
        Text on a result that is kept with it.
    request : str
        Command that the report gives to repeat it.
    options
        Further arguments of :func:`identify`.

    Raises
    ------
    RunError
        If another process is at work in `folder`, a run of another request (but for the finished fit of a given
        structure, which is replaced) or a damaged one is there, results
        cannot be kept, or the search was stopped before there is anything.
    BrightgreyError
        As :func:`identify`.
    """
    check_folder(folder)
    asked = request_of(recordings, structure, **options)
    with Store.open(folder, asked, restart=restart, cheap=_is_fit) as store:
        if store.finished:
            files = store.files()
            said = files.pop(PRINTED, b"").decode()
            _put_back(Path(folder), files)
            return StoredRun(files, said, None)

        def note(step: SearchProgress | Progress) -> None:
            _note(store, step)
            if progress is not None:
                progress(step)

        with thread_pool(executor) as workers, CachingExecutor(workers, store, budget, stop) as memory:
            try:
                result = identify(recordings, structure, executor=memory, progress=note, **options)
            except (Stopped, KeyboardInterrupt) as reason:
                text = f"stopped before any model was found; the same command goes on with what is kept in '{folder}'"
                raise RunError(text) from reason
            except RunError:
                raise
            except BrightgreyError:
                store.discard()  # the same request would fail again
                raise
            finally:
                memory.stop()
        result = replace(result, request=request)
        contents, said = result.contents(), printed(result)
        _sweep(Path(folder), contents)
        write_files(folder, contents)
        if not result.stopped:
            store.finish({**contents, PRINTED: said.encode()})
        return StoredRun(contents, said, result)


def _is_fit(request: Mapping[str, Any]) -> bool:
    """Whether nothing was searched: such a result is soon there again."""
    return request.get("structure") is not None


def _note(store: Store, step: SearchProgress | Progress) -> None:
    """Keep where a search stands, of a genetic one all that the next generation is drawn from."""
    if isinstance(step, SearchProgress):
        store.stage({"name": step.name, "done": step.done, "total": step.total, "best": str(step.structure)})
        return
    best = str(step.best.job.structure)
    store.stage({"name": "generations", "done": step.generation, "total": step.generations, "best": best})
    trees = [[str(e.tree), list(e.result.values), e.value] for e in step.population]
    store.generation(step.generation, {"random": step.random, "population": trees})


def _put_back(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write results of a finished run that are missing or have been changed."""
    lost = {
        name: content
        for name, content in files.items()
        if not (folder / name).is_file() or (folder / name).read_bytes() != content
    }
    if lost:
        write_files(folder, lost)


def _sweep(folder: Path, names: Mapping[str, bytes]) -> None:
    """Remove what a killed process left of its temporary files."""
    for name in names:
        for leftover in folder.glob(f".{name}.*"):
            leftover.unlink(missing_ok=True)


def list_runs(folder: str | Path) -> list[tuple[Path, RunStatus | RunError]]:
    """Runs in `folder` and the folders below it, each with what it is or why it cannot be read.

    Raises
    ------
    RunError
        If there is none.
    """
    root = Path(folder)
    found: list[tuple[Path, RunStatus | RunError]] = []
    for file in sorted(root.rglob(FILE)):
        try:
            found.append((file.parent, read_status(file.parent)))
        except RunError as error:
            found.append((file.parent, error))
    if not found:
        raise RunError(f"there is no run in '{folder}'")
    return found
