"""Numbers of the genetic programming: the paper's, and those that the paper leaves open, fixed here.

Reference drive, motion, sampling interval and f_tanh of the paper's experiment are in :mod:`brightgrey.excitation`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal, get_args

from brightgrey.errors import SettingsError, one_of
from brightgrey.estimation.optimisation.pattern_fit import ESTIMATORS, Estimator
from brightgrey.search.criteria import CRITERIA
from brightgrey.search.fitting.structure_fit import Options
from brightgrey.search.genetic.mutation import MUTATIONS

__all__ = [
    "HEURISTICS",
    "PAPER_SETTINGS",
    "PROBABILITIES",
    "TUNED_SETTINGS",
    "GeneticHeuristics",
    "GeneticSettings",
    "StartFrom",
]

StartFrom = Literal["inherited", "standard", "neighbours"]

PROBABILITIES: Mapping[str, float] = MappingProxyType(
    {"point": 0.15, "insertion": 0.15, "deletion": 0.15, "chromosome": 0.1}
)
"""Probability of each mutation, per individual of the new population, clones included.

The probabilities are not in the paper, and were fixed before any success rate was measured. At least one mutation is
tried on 1 - 0.85³ · 0.9 = 45 % of the individuals, so that in a population of six some three stay unmutated.

Sensitivity on the paper's reference with exact identification, 200 runs each: the true structure is found in 41 % of
the runs. Twice the probabilities give 40 %, half give 34 %, no mutation 6 %; p_clone of 0 and 0.5 give 42 % and 38 %.
"""


@dataclass(frozen=True)
class GeneticHeuristics:
    """Tuned numbers of the genetic search that no user sets."""

    neighbour_draws: int = 30  #: Random mutations of a parent, after which all its neighbours count as tried.
    #: Simulation time of a structure with a hard limit over that of one without; it only orders the work.
    hard_limit_cost: int = 5
    #: Missed optima are looked for after the last generation, and after this fraction of the generations.
    early_restarts: tuple[int, ...] = (8, 3)


HEURISTICS = GeneticHeuristics()


@dataclass(frozen=True)
class GeneticSettings:
    """Settings of a genetic search; the defaults are the paper's.

    Attributes
    ----------
    population : int
        Individuals n_P (paper: 6).
    generations : int
        Generations that are evaluated beside the initial one, which has number 0 (paper: 20).
    p_clone : float
        Probability that an individual is a clone, not a recombination. Not in the paper.
    mutations : mapping of str to float
        Probability of each mutation by name. Not in the paper.
    estimator : {'pattern-search', 'least-squares'}
        Estimator of the parameters; the paper's is pattern search.
    iterations : int
        Limit of the estimator's iterations for each individual in each generation (paper: 500).
    stall_polls : int
        A pattern search also ends where this many polls together lower the cost by less than a hundredth; with 0 only
        the limit counts. Not in the paper; `docs/validation/genetic.md` says what it costs.
    criterion : str
        Criterion of selection, see :mod:`brightgrey.search.criteria`.
    k_p : float
        Weight of the number of parameters in the paper's fitness (19) (paper: 2).
    start_from : {'inherited', 'standard', 'neighbours'}
        Start of an identification. ``inherited`` are the values of the tree's nodes (paper). ``standard`` is one start
        per structure, so that no structure is identified twice. ``neighbours``, by least squares only, starts at the
        optima of structures that contain the structure or are contained in it.
    elite : int
        Best structures so far that each new population begins with, unchanged (paper: 0). Structures with a redundant
        effect are left out here and among the neighbours. With fewer others the population is smaller.
    max_remutations : int
        An individual whose structure has been tried is mutated again, up to this many times (paper: 0).
    n_neighbours : int
        Individuals of each new population that differ from the best structures by one node and have not been tried;
        neighbours of the very best come first. The elite takes precedence (paper: 0).
    n_starts_narrow : int
        With `start_from` 'neighbours': starts of each multistart within narrow ranges, see
        :class:`brightgrey.search.fitting.structure_fit.Options`.

    Raises
    ------
    SettingsError
        For a number out of range or an unknown name.
    """

    population: int = 6
    generations: int = 20
    p_clone: float = 0.2
    mutations: Mapping[str, float] = field(default_factory=lambda: dict(PROBABILITIES))
    estimator: Estimator = "pattern-search"
    iterations: int = 500
    stall_polls: int = 12
    criterion: str = "fitness"
    k_p: float = 2.0
    start_from: StartFrom = "inherited"
    elite: int = 0
    max_remutations: int = 0
    n_neighbours: int = 0
    n_starts_narrow: int = 8

    def __post_init__(self) -> None:
        least = {"population": 1, "iterations": 1, "n_starts_narrow": 1}
        for name in ("generations", "stall_polls", "elite", "max_remutations", "n_neighbours", *least):
            if getattr(self, name) < least.get(name, 0):
                raise SettingsError(f"{name} is {getattr(self, name)}; at least {least.get(name, 0)} is needed")
        if self.elite > self.population:
            raise SettingsError(f"elite is {self.elite}, more than the population of {self.population}")
        if not 0.0 <= self.k_p < float("inf"):
            raise SettingsError(f"k_p is {self.k_p}; it has to be a number from 0")
        for name in self.mutations:
            one_of("mutation", name, MUTATIONS)
        for name, value in {"p_clone": self.p_clone, **self.mutations}.items():
            if not 0.0 <= value <= 1.0:
                raise SettingsError(f"probability {name} is {value}; it has to be between 0 and 1")
        one_of("estimator", self.estimator, ESTIMATORS)
        one_of("criterion", self.criterion, CRITERIA)
        one_of("start_from", self.start_from, get_args(StartFrom))
        if self.start_from == "neighbours" and self.estimator != "least-squares":
            raise SettingsError("start_from 'neighbours' needs the estimator 'least-squares'")

    @property
    def options(self) -> Options:
        """Effort of each structure's fit, with `start_from` 'neighbours'."""
        return Options(rounds=self.iterations, narrow=self.n_starts_narrow)

    @property
    def neighbours(self) -> int:
        """Neighbours of the best structures that a new population has room for."""
        return min(self.n_neighbours, self.population - self.elite)


PAPER_SETTINGS = GeneticSettings()
"""The paper's setting."""

TUNED_SETTINGS = GeneticSettings(
    population=8,
    generations=16,
    estimator="least-squares",
    iterations=30,
    criterion="bic",
    start_from="neighbours",
    elite=2,
    max_remutations=4,
    n_neighbours=4,
    n_starts_narrow=4,
)
"""A setting beyond the paper's: fits start at the optima of neighbouring structures, and neighbours are tried first.

Derivatives replace polling, and the time that is saved goes into more structures. Chosen on seeds from 1000 on.
"""
