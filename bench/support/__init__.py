"""Shared by the benchmarks: simulated drives, shares with confidence intervals, tables and their data files."""
