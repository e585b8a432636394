"""Search for the structure: which effects are at work."""

from brightgrey.search.criteria import CRITERIA, Criterion, Misfit, criterion
from brightgrey.search.estimators import LeastSquares, PatternSearch, estimator
from brightgrey.search.evaluation import Estimator, Evaluated, Job
from brightgrey.search.task import IdentificationTask

__all__ = [
    "CRITERIA",
    "Criterion",
    "Estimator",
    "Evaluated",
    "IdentificationTask",
    "Job",
    "LeastSquares",
    "Misfit",
    "PatternSearch",
    "criterion",
    "estimator",
]
