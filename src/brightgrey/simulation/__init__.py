"""Simulation: one compiled kernel for all structures, and a plain implementation that tests it."""

from brightgrey.simulation.preparation import is_kernel_ready, prepare_kernel
from brightgrey.simulation.response import Response, response, squares
from brightgrey.simulation.settings import Settings
from brightgrey.simulation.shared_cores import shared_cores

__all__ = ["Response", "Settings", "is_kernel_ready", "prepare_kernel", "response", "shared_cores", "squares"]
