"""How much has been simulated."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["SimulationCount"]


@dataclass(frozen=True)
class SimulationCount:
    """What was given to the simulation, counted where it was.

    Attributes
    ----------
    sets : int
        Parameter sets, those on a beginning of the recordings counted like those on the whole, and several recordings
        of one set as one.
    samples : int
        Samples of all these simulations. Divided by those of the recordings: the sets, each counted by its share
        of the samples. What is given up on the way counts in full.
    """

    sets: int = 0
    samples: int = 0

    def __add__(self, other: SimulationCount) -> SimulationCount:
        return SimulationCount(self.sets + other.sets, self.samples + other.samples)
