"""Runs that survive: what has been evaluated is kept, and where evaluations are made does not matter."""

from brightgrey.runs.caching_executor import Budget, Memory, Stop
from brightgrey.runs.executors import Workforce
from brightgrey.runs.status import Glance, glance
from brightgrey.runs.store import RunError, Store

__all__ = ["Budget", "Glance", "Memory", "RunError", "Stop", "Store", "Workforce", "glance"]
