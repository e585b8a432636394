"""Brightgrey finds out which physical effects are at work in an electric drive train, and how large they are."""

__version__ = "0.1.0"
