"""Fits of structures: a table of the best ones, how each is made, and their refinement."""
