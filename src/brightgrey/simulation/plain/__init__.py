"""Plain implementation of the kernel's method for one system in numpy, slow and easy to read.

Tests compare the compiled kernel with it. Matrix exponentials come from scipy, events from a root finder.
"""

from brightgrey.simulation.plain.loop import plain_response

__all__ = ["plain_response"]
