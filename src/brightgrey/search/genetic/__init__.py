"""Degenerate genetic programming (paper section 3): trees, rules, operators and the loop of figure 5."""

from brightgrey.search.genetic.engine import evolve
from brightgrey.search.genetic.estimators import LeastSquares, PatternSearch, estimator
from brightgrey.search.genetic.evaluation import Estimator, Evaluated, Job
from brightgrey.search.genetic.history import Evaluation, Progress, Run, history_csv
from brightgrey.search.genetic.search import genetic_search
from brightgrey.search.genetic.settings import GeneticSettings
from brightgrey.search.genetic.tree import Node

__all__ = [
    "Estimator",
    "Evaluated",
    "Evaluation",
    "GeneticSettings",
    "Job",
    "LeastSquares",
    "Node",
    "PatternSearch",
    "Progress",
    "Run",
    "estimator",
    "evolve",
    "genetic_search",
    "history_csv",
]
