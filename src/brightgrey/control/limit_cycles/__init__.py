"""Limit cycles by describing functions and harmonic balance."""
