"""Simulation: one compiled kernel for all structures, and its plain twin."""

from brightgrey.simulation.response import Response, response, squares
from brightgrey.simulation.settings import Settings

__all__ = ["Response", "Settings", "response", "squares"]
