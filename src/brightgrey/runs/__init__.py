"""Runs that survive: what has been evaluated is kept, and where evaluations are made does not matter."""

from brightgrey.runs.caching_executor import Budget, CachingExecutor, Stop
from brightgrey.runs.executors import Workforce
from brightgrey.runs.status import RunStatus, read_status
from brightgrey.runs.store import RunError, Store

__all__ = ["Budget", "CachingExecutor", "RunError", "RunStatus", "Stop", "Store", "Workforce", "read_status"]
