"""Runs that survive an interruption: every evaluation is kept, and may be made by threads, processes or a cluster."""

from brightgrey.runs.caching_executor import Budget, CachingExecutor, Stop
from brightgrey.runs.executors import Workforce
from brightgrey.runs.status import RunStatus, read_status
from brightgrey.runs.store import RunError, Store

__all__ = ["Budget", "CachingExecutor", "RunError", "RunStatus", "Stop", "Store", "Workforce", "read_status"]
