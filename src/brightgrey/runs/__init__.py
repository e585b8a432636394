"""Runs that survive: what has been evaluated is kept, and where evaluations are made does not matter."""

from brightgrey.runs.glance import Glance, glance
from brightgrey.runs.memory import Budget, Memory, Stop
from brightgrey.runs.store import RunError, Store
from brightgrey.runs.workforce import Workforce

__all__ = ["Budget", "Glance", "Memory", "RunError", "Stop", "Store", "Workforce", "glance"]
