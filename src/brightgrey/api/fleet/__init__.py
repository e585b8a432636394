"""Identification of many axes, and comparison of each with its siblings."""
