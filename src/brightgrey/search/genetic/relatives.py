"""Individuals identified where their relatives' identifications have ended, as in the search of all structures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from brightgrey.estimation.coloured import autoregression
from brightgrey.kit import Structure
from brightgrey.search.evaluation import Evaluated
from brightgrey.search.exhaustive import Fits, Fitted
from brightgrey.search.identification import Identification

__all__ = ["Relatives", "independent"]


def independent(task: Identification, structure: Structure, values: Mapping[str, float]) -> float:
    """Share of the samples that are independent, by the residuals of `structure` with `values` (SI, by name)."""
    named = {name: np.array([value]) for name, value in values.items()}
    residual = task.problem(structure).residuals(named, task.settings)[:, 0]
    lengths = [r.samples for r in task.recordings for _ in r.outputs]
    pieces = np.split(residual, np.cumsum(lengths)[:-1])
    return sum(autoregression(piece).telling(len(piece)) for piece in pieces) / len(residual)


class Relatives:
    """Has structures identified, each one once, and once more where a relative's optimum helps.

    Attributes
    ----------
    fits : Fits
    better : tuple of Structure
        Of earlier generations, which the latest one has improved.
    share : float
        Of the samples, how many are independent by the residuals of the best fit so far.
    """

    def __init__(self, fits: Fits, executor: Executor) -> None:
        self.fits, self.better, self.share = fits, tuple[Structure, ...](), 1.0
        self._executor = executor

    def identify(self, structures: Sequence[Structure]) -> list[tuple[Evaluated, bool]]:
        """Results in the order of `structures`, each with whether it had been there before."""
        fits = self.fits
        fresh = [s for s in dict.fromkeys(structures) if s not in fits.done]
        counted = len(fits.log)
        better = fits.add(fresh, self._executor) if fresh else set()
        self.better = tuple(s for s in fits.done if s in better and s not in structures)
        spent = self._spent(counted)  # by the first of them: hubs serve them all
        out, first = [], set(fresh)
        for s in structures:
            out.append((self.evaluated(s, spent if s in first else 0), s not in first))
            spent = 0 if s in first else spent
            first.discard(s)
        return out

    def seek(self, structure: Structure) -> int:
        """Identify a structure once more, from everywhere, if that has not been done; returns the simulations."""
        counted = len(self.fits.log)
        better = self.fits.seek(structure, self._executor)
        self.better = tuple(s for s in self.fits.done if s in better or s in self.better)
        return self._spent(counted)

    def listen(self) -> float:
        """Find `share` anew, and return it: what the best fit does not explain counts as noise."""
        best = min((f for f in self.fits.done.values() if not f.idle), key=lambda f: (f.cost, f.free))
        self.share = independent(self.fits.task, best.structure, best.values)
        return self.share

    def _spent(self, counted: int) -> int:
        """Simulations of the fits after the first `counted`."""
        return sum(f.simulations for _, f in self.fits.log[counted:])

    def evaluated(self, structure: Structure, simulations: int = 0) -> Evaluated:
        """What is known of `structure` now; a misfit without what only made it worse."""
        task, own = self.fits.task, self.fits.done[structure]
        (misfit,) = task.misfits(*self._shown(own))
        misfit = replace(misfit, share=self.share)
        values = tuple((name, float(own.values[name])) for name in structure.parameters)
        return Evaluated(values, misfit, own.free, simulations)

    def _shown(self, own: Fitted) -> tuple[Structure, dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]]:
        """Structure and values that the cost of a fit is that of."""
        if own.idle:
            own = next(f for f in self.fits.done.values() if not f.idle and f.cost == own.cost)
        space = self.fits.task.space(own.structure, initial=True)
        names = (*own.structure.parameters, *(n for n in space.names if n not in own.structure.parameters))
        return own.structure, {name: np.array([own.values[name]]) for name in names}
