"""Search for the structure: the effects that are at work in a drive."""

from brightgrey.search.criteria import CRITERIA, Criterion, Misfit, criterion
from brightgrey.search.task import IdentificationTask

__all__ = ["CRITERIA", "Criterion", "IdentificationTask", "Misfit", "criterion"]
