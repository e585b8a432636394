"""Simulation: one compiled kernel for all structures, and a plain implementation that tests it."""

from brightgrey.simulation.response import Response, response, squares
from brightgrey.simulation.settings import Settings

__all__ = ["Response", "Settings", "response", "squares"]
