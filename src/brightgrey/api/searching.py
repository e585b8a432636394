"""From recordings to a structure by the genetic search."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from brightgrey.api.request import Range, bounds_si, f_tanh_si, fixed_si
from brightgrey.errors import SettingsError
from brightgrey.estimation import scales
from brightgrey.export.parts import CriterionPart
from brightgrey.export.ranking import Row
from brightgrey.kit import PAPER, Structure
from brightgrey.recordings import Recording
from brightgrey.search import Identification
from brightgrey.search.genetic import GeneticSettings, Progress, Run, history_csv
from brightgrey.search.repetition import run
from brightgrey.simulation import Settings

__all__ = ["Found", "find"]

T = TypeVar("T")
SHARPNESS = 100.0  # default f_tanh times the largest speed


@dataclass(frozen=True)
class Found:
    """Best structure with its estimates (SI), the ranking of all that were tried, and every evaluation."""

    structure: Structure
    values: Mapping[str, float]
    ranking: tuple[Row, ...]
    criterion: CriterionPart
    files: Mapping[str, bytes]
    note: str

    def own(self, given: Mapping[str, T] | None) -> dict[str, T]:
        """Those of `given` that are about a parameter of the structure."""
        return {name: value for name, value in (given or {}).items() if name in self.structure.parameters}


def find(
    recordings: Sequence[Recording],
    settings: GeneticSettings,
    *,
    bounds: Mapping[str, Range],
    fixed: Mapping[str, float],
    f_tanh: float | None,
    seed: int,
    workers: int,
    progress: Callable[[Progress], None] | None,
) -> Found:
    """Search all structures of the paper's grammar on `recordings`.

    Parameters
    ----------
    recordings : sequence of Recording
        Of one drive, with the same outputs.
    settings : GeneticSettings
    bounds : mapping of str to (low, high)
        In the recording's units, by names of parameters of any structure.
    fixed : mapping of str to float
        In the recording's units.
    f_tanh : float or None
        In the recording's units.
    seed, workers : int
    progress : callable or None
        Called after every generation.

    Raises
    ------
    SettingsError
        For wrong bounds and values, or if no structure could be simulated.
    """
    units = recordings[0].units
    widest = max(PAPER.structures(), key=lambda s: len(s.parameters))
    known = scales(recordings)
    task = Identification(
        recordings=tuple(recordings),
        scales=known,
        settings=Settings(
            f_tanh=SHARPNESS / known.speed if f_tanh is None else f_tanh_si(f_tanh, units),
            speed_scale=known.speed,
            level="fast",
            hold=recordings[0].hold,
        ),
        bounds=bounds_si(widest, bounds, units),
        fixed=fixed_si(widest, fixed, units),
    )
    done = run(task, settings, seed, workers=workers, progress=progress)
    best = done.best
    if not best.value > float("-inf") or not best.result.misfit.fit_percent > float("-inf"):
        raise SettingsError("no structure gave a finite simulation; check units, bounds and --input-gain")
    return Found(
        structure=best.job.structure,
        values=dict(best.result.values),
        ranking=_ranking(done, task),
        criterion=CriterionPart(name=settings.criterion, value=best.value),
        files={"history.csv": history_csv(done).encode()},
        note=_note(done, settings),
    )


def _ranking(done: Run, task: Identification) -> tuple[Row, ...]:
    """Every structure that was tried, by its best identification at the level of the search, in the outputs' units."""
    factors = np.array([signal.factor for signal in task.recordings[0].outputs])
    return tuple(
        Row(
            structure=str(e.job.structure),
            n_parameters=e.result.n_parameters,
            rss=float(np.sum(e.result.misfit.rss * (factors / task.weights(e.job.structure)) ** 2)),
            fit_percent=e.result.misfit.fit_percent,
            criterion=e.value,
        )
        for e in done.structures()
    )


def _note(done: Run, settings: GeneticSettings) -> str:
    count = len({e.job.structure for e in done.evaluations})
    end = f"interrupted after generation {done.generations - 1} of" if done.interrupted else "over"
    return (
        f"genetic search {end} {settings.generations} generations of {settings.population}: {count} structures tried,"
        f" {done.identifications} identifications, {done.simulations} simulations; others may fit as well"
    )
