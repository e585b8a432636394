"""The paper's degenerate genetic programming (section 3): trees, rules, operators and the loop of figure 5."""

from brightgrey.search.genetic.engine import evolve
from brightgrey.search.genetic.history import Evaluation, Progress, Run, history_csv
from brightgrey.search.genetic.settings import GeneticSettings
from brightgrey.search.genetic.tree import Node

__all__ = ["Evaluation", "GeneticSettings", "Node", "Progress", "Run", "evolve", "history_csv"]
