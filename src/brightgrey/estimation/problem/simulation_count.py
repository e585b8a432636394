"""Count of simulations: the measure of effort."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["SimulationCount"]


@dataclass(frozen=True)
class SimulationCount:
    """Number of simulations and of simulated samples."""

    #: Simulated parameter sets. A set on truncated recordings counts like one on whole recordings, and a set on
    #: several recordings counts once.
    sets: int = 0
    #: Samples of all these simulations; an aborted simulation counts in full. Divided by the samples of the
    #: recordings, it gives the number of sets on whole recordings with the same effort.
    samples: int = 0

    def __add__(self, other: SimulationCount) -> SimulationCount:
        return SimulationCount(self.sets + other.sets, self.samples + other.samples)
