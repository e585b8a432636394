"""Self-test of an identification: simulated recordings of known drives are identified as the recordings were."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from brightgrey.api.result import Result
from brightgrey.api.to_si import check_alike
from brightgrey.api.written_run import recording_of_run, task_of_run
from brightgrey.arguments import checked_arguments
from brightgrey.errors import RecordingError, SettingsError
from brightgrey.kit import Structure, grammar_named
from brightgrey.model.files import write_files
from brightgrey.model.model import Model, load_model
from brightgrey.model.run_record import RunRecord, load_run_record
from brightgrey.recordings import Recording
from brightgrey.report.self_test import with_section
from brightgrey.runs import RunError, Stop
from brightgrey.runs.blas_threads import one_blas_thread
from brightgrey.runs.serialisation import canonical, digest, source_hash
from brightgrey.search import IdentificationTask
from brightgrey.search.parallel import Stopped, thread_pool
from brightgrey.self_test.repetition import Repetition, Request, repeat
from brightgrey.self_test.schema import SELF_TEST_FILE, SelfTest
from brightgrey.self_test.sensor_noise import SensorNoise, sensor_noises
from brightgrey.self_test.simulated_drives import SimulatedDrive, simulated_drives
from brightgrey.self_test.summary import drive_part, noise_parts, self_test_sentences, stable_verdicts
from brightgrey.version import __version__

__all__ = ["selftest", "write_selftest"]

_KEPT = "selftest.partial.jsonl"


@one_blas_thread()
@checked_arguments
def selftest(
    run: Result | str | Path,
    *,
    draws: int = 10,
    fast: bool = False,
    found_only: bool = False,
    seed: int = 0,
    workers: int = 1,
    recordings: Sequence[Recording] = (),
    progress: Callable[[int, int], None] | None = None,
    stop: Stop | None = None,
) -> SelfTest:
    """Ask whether these recordings would have found this model.

    Known drives are simulated with the recorded input: the found model, its equivalent structures, and the model with
    each effect that is *not needed* at the least size that matters. The outputs get noise of the colour and the
    rounding that the recordings have. Then each is identified with the settings of the run.

    Parameters
    ----------
    run : Result or str or Path
        Result of :func:`identify`, or the folder that it was written to.
    draws : int
        Simulated recordings of each drive.
    fast : bool
        Begin each identification at the optima of the run and seek no others. That shows what noise does to the
        result, and leaves out that a search may miss an optimum.
    found_only : bool
        Simulate the found model only. That says how stable the result is, and is faster. It leaves out if an equivalent
        structure would be told apart, and if an effect that is *not needed* would be noticed.
    seed : int
        Seed of the noise. The same seed gives the same bytes, for any number of workers.
    workers : int
        Draws that are made at the same time.
    recordings : sequence of Recording, optional
        Recordings of the run, where its files are no longer found.
    progress : callable, optional
        ``progress(done, total)`` is called after every draw.
    stop : Stop, optional
        Ends the test early. What is done is kept in the folder of the run, and the same call goes on from there.

    Returns
    -------
    SelfTest
        Counts with their intervals; :func:`write_selftest` writes it into the folder of a run.

    Raises
    ------
    SettingsError
        For a folder without a run, a genetic search, or a number of draws below 1.
    RecordingError
        If a recording is not found, or is not the one that was identified.
    RunError
        If it was stopped.

    Examples
    --------
    >>> found = selftest("out", draws=20)  # doctest: +SKIP
    >>> print(found.found.found_again)  # doctest: +SKIP
    19 of 20 (76 to 99 %)
    """
    if draws < 1:
        raise SettingsError(f"draws is {draws}; at least 1 is needed")
    tested = _tested(run, recordings)
    request = _request(tested)
    minimal = _minimal(tested, request.task)
    if fast:
        optima = {Structure.parse(f.structure): f.values for f in tested.record.fits}
        certificate = tested.model.certificate
        offered = certificate.offered if certificate else ()
        request = replace(request, optima={**optima, **dict(minimal[:1])}, offered=offered)
    verdicts = dict(tested.model.evidence or {})
    not_needed = [effect for effect, verdict in verdicts.items() if verdict == "not needed"]
    drives = simulated_drives(request.task, minimal, not_needed)[: 1 if found_only else None]
    noises = sensor_noises(request.task, *minimal[0])
    key = digest(tested.record.text(), tested.model.text(), canonical([fast, seed]), source_hash())
    repetitions = _Repetitions(request, drives, noises, seed, stop or Stop(), tested.folder, key)
    found = repetitions.all(draws, workers, progress or (lambda done, total: None))
    units = tested.recordings[0].units
    parts = [drive_part(variants, made, units) for variants, made in zip(drives, found, strict=True)]
    made = SelfTest(
        structure=str(tested.model.structure),
        draws=draws,
        fast=fast,
        found_only=found_only,
        seed=seed,
        noise=noise_parts(tested.recordings, noises),
        verdicts=verdicts,
        stable=stable_verdicts(verdicts, found[0]),
        drives=tuple(parts),
        sentences=(),
        version=__version__,
    )
    return made.model_copy(update={"sentences": self_test_sentences(made)})


def write_selftest(found: SelfTest, folder: str | Path) -> Path:
    """Write selftest.json into the folder of a run, and a section into its report.html if there is one.

    The kept draws of a test of all drives are removed with that. Those of the found model stay for such a test.

    Parameters
    ----------
    found : SelfTest
    folder : str or Path

    Returns
    -------
    Path
        Of selftest.json.
    """
    report = Path(folder) / "report.html"
    contents = {SELF_TEST_FILE: found.text().encode()}
    if report.is_file():
        contents[report.name] = with_section(report.read_text(encoding="utf-8"), found).encode()
    write_files(folder, contents)
    if not found.found_only:
        (Path(folder) / _KEPT).unlink(missing_ok=True)
    return Path(folder) / SELF_TEST_FILE


@dataclass(frozen=True)
class _Tested:
    """Identification that is tested."""

    record: RunRecord
    model: Model
    recordings: tuple[Recording, ...]
    folder: Path | None  #: None for a result in memory.


def _tested(run: Result | str | Path, recordings: Sequence[Recording]) -> _Tested:
    """Record, model and recordings of a run."""
    if isinstance(run, Result):
        record, folder, model = run.record, None, run.model
        recordings = recordings or run.recordings
        if record is None:
            raise SettingsError("this result has no record of its request; identify again")
    else:
        folder, record = Path(run), load_run_record(run)
        model = load_model(folder / "model.json")
        recordings = recordings or [recording_of_run(part, folder) for part in record.recordings]
    if record.search == "genetic":
        raise SettingsError("a genetic search gives no verdicts to test; identify with --search auto")
    if record.search is not None and model.evidence is None:
        raise SettingsError("the search was stopped before its end; the same 'identify' command goes on with it")
    if len(recordings) != len(record.recordings):
        raise RecordingError(f"{len(recordings)} recordings came; the run has {len(record.recordings)}")
    check_alike(recordings, None)
    return _Tested(record, model, tuple(recordings), folder)


def _minimal(tested: _Tested, task: IdentificationTask) -> list[tuple[Structure, Mapping[str, float]]]:
    """Minimal structures with their values, the found one first: it is simulated as the model has it.

    Those with effects that were not offered are left out: they move as these do.
    A search of a long recording decides on every k-th sample, with a drift and an initial state of its own. Its optimum
    leaves another residual on all samples than the model that is reported.
    """
    own = str(tested.model.structure)
    optima = {fitted.structure: fitted.values for fitted in tested.record.fits}
    names = tested.model.ties.minimal if tested.model.ties else (own,)
    if tested.record.fits[0].structure != own or not optima.keys() >= set(names):
        raise SettingsError("run.json and model.json are of different runs; identify again")
    found = _as_reported(tested.model, task, optima[own])
    rivals = {fitted.structure for fitted in tested.record.fits if fitted.status == "rival"}
    others = [n for n in names if n != own and n not in rivals]
    return [(tested.model.structure, found), *((Structure.parse(n), optima[n]) for n in others)]


def _as_reported(model: Model, task: IdentificationTask, optimum: Mapping[str, float]) -> dict[str, float]:
    """Values of the model, SI, with the nuisances of an optimum that are the drive's or its initial state's."""
    problem = task.problem(model.structure)
    kept = (part.name for part in problem.nuisances if part not in problem.drifts and part.name in optimum)
    values = {**{name: optimum[name] for name in kept}, **model.values_si()}
    if problem.friction_width is not None:
        width = problem.friction_width
        found = 1.0 / model.settings_si().f_tanh  # 0 for an exact sign
        values[width.name] = min(max(found, width.low), width.high) if found else 0.0
    return values


def _request(tested: _Tested) -> Request:
    """Identification as it was asked for, on the recordings."""
    record = tested.record
    return Request(
        task_of_run(record, tested.recordings),
        None if record.grammar is None else grammar_named(record.grammar),
        record.require,
        record.exclude,
        "exhaustive" if record.search == "exhaustive" else "border",
        record.initial,
        record.level,
        record.seed,
    )


@dataclass
class _Repetitions:
    """Repetitions of all drives; those that are done are kept in the folder of the run."""

    request: Request
    drives: Sequence[Sequence[SimulatedDrive]]
    noises: Sequence[SensorNoise]
    seed: int
    stop: Stop
    folder: Path | None
    key: str  #: Of all that a repetition depends on but the drive and its number.

    def all(self, draws: int, workers: int, progress: Callable[[int, int], None]) -> list[list[Repetition]]:
        """Repetitions by drive and draw."""
        wanted = [(i, k) for k in range(draws) for i in range(len(self.drives))]
        done = self._kept()
        total = len(wanted)
        made = {place: done[place] for place in wanted if place in done}
        progress(len(made), total)
        with thread_pool(None, workers) as pool:
            try:
                waiting = {pool.submit(self._repeat, *place): place for place in wanted if place not in made}
                for future in as_completed(waiting):
                    made[waiting[future]] = future.result()
                    self._keep(waiting[future], made[waiting[future]])
                    progress(len(made), total)
            except Stopped:
                raise RunError(self._stopped(len(made), total)) from None
            except BaseException:
                self.stop.request()
                raise
        return [[made[i, k] for k in range(draws)] for i in range(len(self.drives))]

    def _repeat(self, drive: int, draw: int) -> Repetition:
        variants = self.drives[drive]
        return repeat(
            self.request,
            variants[draw % len(variants)],
            self.noises,
            (self.seed, drive, draw),
            lambda: self.stop.requested,
        )

    def _stopped(self, done: int, total: int) -> str:
        if self.folder is None or not done:
            return f"stopped after {done} of {total} draws; nothing was written"
        return f"stopped after {done} of {total} draws; they are kept in '{self.folder}', and the same command goes on"

    def _kept(self) -> dict[tuple[int, int], Repetition]:
        """Repetitions that an interrupted test of the same key has kept."""
        found: dict[tuple[int, int], Repetition] = {}
        if self.folder is None or not (self.folder / _KEPT).is_file():
            return found
        for line in (self.folder / _KEPT).read_text(encoding="utf-8").splitlines():
            try:
                row: dict[str, Any] = json.loads(line)
            except ValueError:  # the process was killed while it wrote
                continue
            if row["key"] == self.key:
                drive, draw = row["place"]
                found[drive, draw] = Repetition.of(row["result"])
        return found

    def _keep(self, place: tuple[int, int], made: Repetition) -> None:
        if self.folder is None:
            return
        with (self.folder / _KEPT).open("a", encoding="utf-8") as file:
            row = {"key": self.key, "place": list(place), "result": asdict(made)}  # in this order, as the file has it
            file.write(json.dumps(row, ensure_ascii=False) + "\n")
