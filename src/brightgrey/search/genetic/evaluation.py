"""Jobs that a genetic search gives to an estimator, and their results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.kit import Structure
from brightgrey.search.criteria import Misfit

__all__ = ["Estimator", "Evaluated", "Job", "NamedValues"]

NamedValues = tuple[tuple[str, float], ...]
"""Parameter values, SI, by name, in the structure's order."""


@dataclass(frozen=True)
class Job:
    """One identification. Equal jobs have equal results: nothing in it is random."""

    structure: Structure
    start: NamedValues  #: Start values, SI, of the parameters by name, in the structure's order.

    @classmethod
    def of(cls, structure: Structure, values: Mapping[str, float]) -> Job:
        """Job that starts from `values`, which may hold more than the structure needs."""
        return cls(structure, tuple((name, float(values[name])) for name in structure.parameters))


@dataclass(frozen=True)
class Evaluated:
    """Result of an identification."""

    values: NamedValues  #: Estimates, SI, in the order of the job's start.
    misfit: Misfit
    n_parameters: int  #: Number of parameters that were estimated, d.
    spent: SimulationCount  #: What was simulated.
    idle: tuple[str, ...] = ()  #: Effects that only make the fit worse; the misfit is that without them.

    @property
    def simulations(self) -> int:
        """Parameter sets that were simulated."""
        return self.spent.sets


class Estimator(Protocol):
    """Identifies one structure from several starts, side by side; called in threads.

    The result of a start must not depend on the other starts.
    """

    def __call__(self, structure: Structure, starts: Sequence[NamedValues]) -> Sequence[Evaluated]:
        """Results in the order of `starts`."""
        ...
