"""Numbers of the genetic programming: the paper's, and those that the paper leaves open, fixed here.

Reference drive, motion, sampling interval and f_tanh of the paper's experiment are in :mod:`brightgrey.excitation`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal, get_args

from brightgrey.errors import SettingsError, unknown_name
from brightgrey.estimation.optimisation.pattern_fit import Estimator, check_estimator
from brightgrey.search.criteria import CRITERIA
from brightgrey.search.fitting import Options
from brightgrey.search.genetic.mutation import MUTATIONS

__all__ = [
    "ASSUMED",
    "PAPER_SETTINGS",
    "PROBABILITIES",
    "RANGE",
    "RESOLUTION",
    "TUNED_SETTINGS",
    "GeneticSettings",
    "StartFrom",
]

StartFrom = Literal["inherited", "standard", "neighbours"]

P_CLONE = 0.2
PROBABILITIES: Mapping[str, float] = MappingProxyType(
    {"point": 0.15, "insertion": 0.15, "deletion": 0.15, "chromosome": 0.1}
)
"""Probability of each mutation, per individual of the new population, clones included.

Not in the paper, and fixed before any success rate was measured: at least one mutation is tried on
1 - 0.85³ · 0.9 = 45 % of the individuals, so that in six of them some three stay what recombination made. How much it
matters (paper's reference, exact identification, 200 runs each): true structure found in 41 % of the runs; twice the
probabilities 40 %, half 34 %, no mutation 6 %; p_clone 0 and 0.5 instead of 0.2: 42 % and 38 %.
"""

PATIENCE = 12
"""Polls without a gain of a hundredth after which a pattern search ends; docs/design says what that costs."""

ASSUMED: Mapping[str, float] = MappingProxyType(
    {
        "J1": 0.010,
        "J2": 0.010,
        "J3": 0.006,
        "J4": 0.004,
        "c1": 90.0,
        "c2": 150.0,
        "c3": 200.0,
        "d1": 0.05,
        "d2": 0.05,
        "d3": 0.05,
        "M_C": 0.7,
        "f_v": 0.02,
        "M_S": 0.8,
        "omega_S": 7.0,
        "M_G": 0.5,
        "alpha": 0.01,
        "T_1": 0.003,
        "T_d": 0.005,
    }
)
"""What is assumed of every parameter in the paper's experiment, SI; the paper gives no number.

Those of the reference drive are off by 17 to 40 %, so that no start is the truth by construction. Those of the other
submodels decide how well their absence shows: a range from half to twice the assumed value excludes zero, and only
gravity (centred on zero) and a light, stiffly coupled third mass can be present without an effect.
"""

RANGE = (0.5, 2.0)
"""Bounds over assumed value (paper section 4); a parameter of either sign has ± the upper one."""

RESOLUTION = 1e-3
"""Step in rad/s that the reference's velocity is rounded to: the floor of RSS.

The paper's data have no noise and double precision. This is 2.5e-5 of the peak, five times the error of the simulation
at level ``fast``; the paper's setting never gets near it, least squares does.
"""


@dataclass(frozen=True)
class GeneticSettings:
    """How to search.

    Attributes
    ----------
    population : int
        Individuals n_P (paper: 6).
    generations : int
        Generations that are evaluated, the initial one counted as number 0 beside them (paper: 20).
    p_clone : float
        Probability that an individual is a clone, not a recombination. Not in the paper.
    mutations : mapping of str to float
        Probability of each mutation by name. Not in the paper.
    estimator : {'pattern-search', 'least-squares'}
        The paper's is pattern search.
    iterations : int
        Limit of the estimator's iterations for each individual in each generation (paper: 500).
    stall_polls : int
        A pattern search ends, too, where so many polls together lower the cost by less than a hundredth; 0 if only
        the limit counts. Not in the paper.
    criterion : str
        What individuals are selected by, see :mod:`brightgrey.search.criteria`.
    k_p : float
        Weight of the number of parameters in the paper's fitness (19) (paper: 2).
    start_from : {'inherited', 'standard', 'neighbours'}
        Where an identification starts: at the node's values, inherited or random (paper); at the same standard start
        for every individual of a structure, so that no structure is identified twice; or, by least squares only, where
        those end that a structure contains or is contained in, as in the search of all structures.
    elite : int
        Best structures so far that each new population begins with, unchanged (paper: 0). Those with an effect that is
        known to be idle are no better than they are without it, and left out here and in `n_neighbours`. With fewer
        others the population is smaller.
    max_remutations : int
        An individual whose structure has been tried is mutated up to this many times, each time by a random one of
        the mutations, until it is one that has not (paper: 0).
    n_starts_narrow : int
        With `start_from` 'neighbours': descents of each field where a structure is sought from everywhere within narrow
        ranges, see :class:`brightgrey.search.fitting.Options`.
    n_neighbours : int
        Of each new population, individuals that differ from the best structures so far by one node and have not been
        tried, those of the very best first; as far as the elite leaves room (paper: 0).

    Raises
    ------
    SettingsError
        For a number out of range or an unknown name.
    """

    population: int = 6
    generations: int = 20
    p_clone: float = P_CLONE
    mutations: Mapping[str, float] = field(default_factory=lambda: dict(PROBABILITIES))
    estimator: Estimator = "pattern-search"
    iterations: int = 500
    stall_polls: int = PATIENCE
    criterion: str = "fitness"
    k_p: float = 2.0
    start_from: StartFrom = "inherited"
    elite: int = 0
    max_remutations: int = 0
    n_neighbours: int = 0
    n_starts_narrow: int = 8

    def __post_init__(self) -> None:
        limits = {
            "population": 1,
            "generations": 0,
            "iterations": 1,
            "stall_polls": 0,
            "elite": 0,
            "max_remutations": 0,
            "n_neighbours": 0,
        }
        limits["n_starts_narrow"] = 1
        for name, least in limits.items():
            value = getattr(self, name)
            if value < least:
                raise SettingsError(f"{name} is {value}; at least {least} is needed")
        if self.elite > self.population:
            raise SettingsError(f"elite is {self.elite}, more than the population of {self.population}")
        if not 0.0 <= self.k_p < float("inf"):
            raise SettingsError(f"k_p is {self.k_p}; it has to be a number from 0")
        for name in self.mutations:
            if name not in MUTATIONS:
                raise SettingsError(unknown_name("mutation", name, MUTATIONS))
        for name, value in {"p_clone": self.p_clone, **self.mutations}.items():
            if not 0.0 <= value <= 1.0:
                raise SettingsError(f"probability {name} is {value}; it has to be between 0 and 1")
        check_estimator(self.estimator)
        if self.criterion not in CRITERIA:
            raise SettingsError(unknown_name("criterion", self.criterion, CRITERIA))
        if self.start_from not in get_args(StartFrom):
            raise SettingsError(unknown_name("start_from", self.start_from, get_args(StartFrom)))
        if self.start_from == "neighbours" and self.estimator != "least-squares":
            raise SettingsError("start_from 'neighbours' needs the estimator 'least-squares'")

    @property
    def options(self) -> Options:
        """How thoroughly each structure is fitted, with `start_from` 'neighbours'."""
        return Options(rounds=self.iterations, narrow=self.n_starts_narrow)

    @property
    def neighbours(self) -> int:
        """Individuals near the best structures that a new population has room for."""
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
"""A setting of ours, not the paper's: structures are identified where their relatives have ended, neighbours first.

Derivatives instead of polling, and what is saved goes into more structures. Chosen on seeds from 1000 on.
"""
