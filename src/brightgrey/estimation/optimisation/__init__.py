"""Optimisation algorithms: Levenberg-Marquardt, multistart, pattern search."""
