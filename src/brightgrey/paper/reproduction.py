"""Reproduction of the paper's experiment (section 4) with several seeds."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

from brightgrey.errors import SettingsError
from brightgrey.estimation.problem.simulation_error import predict_many
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER, Structure
from brightgrey.model.files import check_folder, write_files
from brightgrey.paper.experiment import reference_recording, task_of
from brightgrey.paper.repetitions import RunSummary, Summary, repetitions_csv, summarise_run, summary
from brightgrey.search import IdentificationTask
from brightgrey.search.genetic import Evaluation, GeneticSettings, Progress, Run, genetic_search, history_csv

__all__ = ["Reproduction", "reproduce"]


@dataclass(frozen=True)
class Reproduction:
    """Result of :func:`reproduce`.

    Attributes
    ----------
    truth : Structure
        Of the reference drive.
    settings : GeneticSettings
    repetitions : tuple of RunSummary
        One per seed.
    runs : tuple of Run
        In the same order.
    task : IdentificationTask
    """

    truth: Structure
    settings: GeneticSettings
    repetitions: tuple[RunSummary, ...]
    runs: tuple[Run, ...] = field(repr=False)
    task: IdentificationTask = field(repr=False)

    @property
    def summary(self) -> Summary:
        """Rates over the seeds."""
        return summary(self.repetitions)

    @property
    def later(self) -> int:
        """Generation of figures 8 and 9: the eighth, as in the paper, or the last one if there are fewer."""
        return min(8, self.runs[0].generations - 1)

    def figures(self) -> dict[str, bytes]:
        """Figures of the first seed like the paper's 6 to 9, as PNG by file name; 9 shows 0.8 s, as in the paper."""
        from brightgrey.paper.figures import outputs
        from brightgrey.report.drawing.matplotlib_figure import picture
        from brightgrey.report.drawing.trees import trees

        first, later = self.runs[0].generation(0), self.runs[0].generation(self.later)
        recording = self.task.recordings[0]
        drawn = {
            "figure6.png": outputs(recording, [self._output(e) for e in first], _labels(first)),
            "figure7.png": trees([e.tree for e in first], _titles(first)),
            "figure8.png": trees([e.tree for e in later], _titles(later)),
            "figure9.png": outputs(recording, [self._output(e) for e in later], _labels(later), until=0.8),
        }
        return {name: picture(figure, "png") for name, figure in drawn.items()}

    def generations_csv(self) -> str:
        """Best individual of every generation of every seed, as CSV; RSS in SI."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(("seed", "generation", "structure", "n_parameters", "rss", "criterion", "true_present"))
        for row, done in zip(self.repetitions, self.runs, strict=True):
            for number in range(done.generations):
                best = done.best_of(number)
                present = any(e.job.structure == self.truth for e in done.generation(number))
                rss = repr(best.result.misfit.rss[0])
                cells = (best.job.structure, best.result.n_parameters, rss, repr(best.value), str(present).lower())
                writer.writerow((row.seed, number, *cells))
        return text.getvalue()

    names: ClassVar[tuple[str, ...]] = (
        *("figure6.png", "figure7.png", "figure8.png", "figure9.png"),
        *("runs.csv", "generations.csv", "history.csv"),
    )

    def write(self, folder: str | Path) -> None:
        """Write figures and tables into `folder`, all or none; SettingsError if that cannot be."""
        check_folder(folder)
        tables = {
            "runs.csv": repetitions_csv(self.repetitions),
            "generations.csv": self.generations_csv(),
            "history.csv": history_csv(self.runs[0]),
        }
        write_files(folder, self.figures() | {name: text.encode() for name, text in tables.items()})

    def _output(self, e: Evaluation) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        values = {name: np.array([value]) for name, value in e.result.values}
        return predict_many(e.job.structure, values, self.task.recordings[0], self.task.settings)[0, :, 0]


def reproduce(
    settings: GeneticSettings | None = None,
    *,
    seeds: int = 1,
    seed: int = 0,
    workers: int = 1,
    progress: Callable[[int, Progress], None] | None = None,
) -> Reproduction:
    """Search for the reference drive of the paper's section 4, with several seeds.

    Parameters
    ----------
    settings : GeneticSettings, optional
        The paper's by default.
    seeds : int
        Number of seeds.
    seed : int
        First of them.
    workers : int
        Threads; the results do not depend on it.
    progress : callable, optional
        Called as ``progress(seed, progress)`` after every generation.

    Returns
    -------
    Reproduction
        Ctrl-C ends it with the seeds that are complete, if there is one.

    Raises
    ------
    SettingsError
        If `seeds` is below 1.
    """
    if seeds < 1:
        raise SettingsError(f"seeds is {seeds}; at least 1 is needed")
    chosen = settings or GeneticSettings()
    task, truth = task_of(reference_recording()), PAPER.parse(PAPER_EXPERIMENT.structure)
    runs: list[Run] = []
    for number in range(seed, seed + seeds):
        try:
            done = genetic_search(task, chosen, number, workers=workers, progress=_with_seed(progress, number))
        except KeyboardInterrupt:
            if not runs:
                raise
            break
        if done.interrupted and runs:
            break
        runs.append(done)
        if done.interrupted:
            break
    rows = tuple(summarise_run(done, truth, seed + i) for i, done in enumerate(runs))
    return Reproduction(truth, chosen, rows, tuple(runs), task)


def _with_seed(progress: Callable[[int, Progress], None] | None, seed: int) -> Callable[[Progress], None] | None:
    return None if progress is None else lambda step: progress(seed, step)


def _titles(generation: tuple[Evaluation, ...]) -> list[str]:
    from brightgrey.report.drawing.svg import effect_numbers

    return [f"model {e.individual + 1}: {effect_numbers(e.job.structure)}" for e in generation]


def _labels(generation: tuple[Evaluation, ...]) -> list[str]:
    return [f"{e.individual + 1}: {e.job.structure}".replace("_", " ") for e in generation]
