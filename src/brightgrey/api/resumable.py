"""Identification into a folder that keeps all that has been evaluated: it can be interrupted and taken up again."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
from brightgrey.runs.serialisation import canonical, digest, source_hash
from brightgrey.runs.store import FILE
from brightgrey.search.parallel import Stopped, thread_pool
from brightgrey.version import __version__

if TYPE_CHECKING:
    from brightgrey.api.structure_search import SearchKind
    from brightgrey.search.genetic import Progress
    from brightgrey.search.progress import SearchProgress

__all__ = ["StoredRun", "identify_resumable", "list_runs", "request_of"]

SUMMARY_FILE = "summary.txt"
_NOT_IN_REQUEST = ("recordings", "test", "start", "search", "structure", "progress", "workers", "executor")


@dataclass(frozen=True)
class StoredRun:
    """Content of a folder after :func:`identify_resumable`.

    Attributes
    ----------
    files : mapping of str to bytes
        Results by file name.
    summary : str
        Text on the result that was stored with it.
    result : Result or None
        None if an earlier call had finished the run, so that nothing was computed.
    """

    files: Mapping[str, bytes] = field(repr=False)
    summary: str
    result: Result | None

    @property
    def stopped(self) -> bool:
        """True if the search was stopped and the result is the best one so far."""
        return self.result is not None and self.result.stopped

    @property
    def model(self) -> Model:
        """The identified model."""
        return Model.check(json.loads(self.files["model.json"]))


def request_of(recordings: Recording | Sequence[Recording], structure: Any = None, **options: Any) -> dict[str, Any]:
    """Everything that the result of :func:`identify` depends on, as plain data. It identifies a run."""
    given = inspect.signature(identify).bind(recordings, structure, **options)
    given.apply_defaults()
    asked = given.arguments
    several = (recordings,) if isinstance(recordings, Recording) else tuple(recordings)
    request = {name: value for name, value in asked.items() if name not in _NOT_IN_REQUEST}
    request |= {name: sorted(set(asked[name])) for name in ("require", "exclude")}
    request |= {f"recording {i}": _identity(r) for i, r in enumerate(several, 1)}
    if asked["test"] is not None:
        request["test recording"] = _identity(asked["test"])
    if asked["start"] is not None:
        request["start model"] = digest(asked["start"].text())[:16]
    grammar = request.pop("grammar")
    if structure is None:
        request |= _search_asked(asked["search"], grammar)
    else:
        request["structure"] = str(function_set().parse(str(structure)))
    versions = {"brightgrey": __version__, "numpy": numpy.__version__, "scipy": scipy.__version__}
    request["versions"] = {**versions, "numba": numba.__version__, "code": source_hash()}
    plain: dict[str, Any] = json.loads(canonical(request))
    return plain


def _search_asked(search: SearchKind | None, grammar: str | None) -> dict[str, Any]:
    """Part of a request that tells which search it is; a given structure does not need the modules of a search."""
    from brightgrey.api.structure_search import grammar_searched
    from brightgrey.search.genetic import GeneticSettings

    if isinstance(search, GeneticSettings):
        about = {"search": "genetic"} | {f"genetic {name}": value for name, value in asdict(search).items()}
    else:
        about = {"search": search or "auto"}
    return about | {"grammar": grammar_searched(search, grammar).name}


def _identity(recording: Recording) -> str:
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
    summary: Callable[[Result], str] = lambda result: "",
    request: str = "",
    **options: Any,
) -> StoredRun:
    """Call :func:`identify`, keep every evaluation in `folder`, and write the results there.

    The same call continues an interrupted run and ends with the same bytes. The same call for a finished run reads
    its results and computes nothing.

    Parameters
    ----------
    folder : str or Path
        One folder holds one run.
    recordings, structure
        As for :func:`identify`.
    executor : Executor, optional
        Runs the evaluations of a search; one thread by default.
    budget : Budget, optional
        Number of evaluations and seconds after which a search stops with the best structure so far.
    stop : Stop, optional
        Stops a search with the best structure so far, from another thread or a signal handler.
    restart : bool
        Delete the run in `folder` first.
    progress : callable, optional
        Called after every structure or generation of a search.
    summary : callable, optional
        Makes the text that is stored beside the result.
    request : str
        Command that repeats the run; the report shows it.
    options
        Further arguments of :func:`identify`.

    Returns
    -------
    StoredRun

    Raises
    ------
    RunError
        If another process uses `folder`, if it holds a damaged run or one of another request, if results cannot be
        stored, or if the search was stopped before it had fitted a structure. The finished fit of a given structure is
        replaced instead.
    BrightgreyError
        As :func:`identify`.
    """
    check_folder(folder)
    asked = request_of(recordings, structure, **options)
    with Store.open(folder, asked, restart=restart, may_replace=_is_fit) as store:
        if store.finished:
            files = store.files()
            text = files.pop(SUMMARY_FILE, b"").decode()
            _restore(Path(folder), files)
            return StoredRun(files, text, None)

        def on_progress(step: SearchProgress | Progress) -> None:
            _store_progress(store, step)
            if progress is not None:
                progress(step)

        with thread_pool(executor) as workers, CachingExecutor(workers, store, budget, stop) as caching:
            try:
                result = identify(recordings, structure, executor=caching, progress=on_progress, **options)
                if stop is not None and stop.requested and _is_fit(asked):
                    raise KeyboardInterrupt
            except (Stopped, KeyboardInterrupt) as reason:
                if _is_fit(asked):  # nothing of it can be kept
                    store.discard()
                    raise
                raise RunError(
                    f"stopped before a structure was fitted; the same command continues with what is kept in '{folder}'"
                ) from reason
            except RunError:
                raise
            except BrightgreyError:
                store.discard()  # the same request would fail again
                raise
            finally:
                caching.stop()
        result = replace(result, request=request)
        contents, text = result.contents(), summary(result)
        _remove_temporary_files(Path(folder), contents)
        write_files(folder, contents)
        if not result.stopped:
            store.finish({**contents, SUMMARY_FILE: text.encode()})
        return StoredRun(contents, text, result)


def _is_fit(request: Mapping[str, Any]) -> bool:
    """Return True for a request without a search, which takes seconds to repeat."""
    return request.get("structure") is not None


def _store_progress(store: Store, step: SearchProgress | Progress) -> None:
    """Store the progress of a search; for a genetic one also the state that the next generation is drawn from."""
    from brightgrey.search.progress import SearchProgress

    if isinstance(step, SearchProgress):
        stage = {"name": step.name, "done": step.done, "total": step.total, "best": str(step.structure)}
        border = {} if step.border is None else asdict(step.border)
        store.note_stage(stage | {"fit_percent": step.fit_percent, "values": step.values} | border)
        return
    best = str(step.best.job.structure)
    store.note_stage({"name": "generations", "done": step.generation, "total": step.generations, "best": best})
    trees = [[str(e.tree), list(e.result.values), e.value] for e in step.population]
    store.save_generation(step.generation, {"random": step.random, "population": trees})


def _restore(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write those results of a finished run again that are missing or have been changed."""
    lost = {
        name: content
        for name, content in files.items()
        if not (folder / name).is_file() or (folder / name).read_bytes() != content
    }
    if lost:
        write_files(folder, lost)


def _remove_temporary_files(folder: Path, names: Mapping[str, bytes]) -> None:
    """Remove temporary files that a killed process has left behind."""
    for name in names:
        for leftover in folder.glob(f".{name}.*"):
            leftover.unlink(missing_ok=True)


def list_runs(folder: str | Path) -> list[tuple[Path, RunStatus | RunError]]:
    """List the runs in `folder` and in the folders below it.

    Parameters
    ----------
    folder : str or Path

    Returns
    -------
    list of (Path, RunStatus or RunError)
        Folder of each run, with its status or the reason why it cannot be read.

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
