"""Numerics that every start needs, without the slow imports of scipy.stats, scipy.signal and scipy.optimize.

Each function gives the numbers of its namesake in scipy; the tests compare them. `number_format` writes numbers for
people.
"""
