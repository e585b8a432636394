"""Reproduction of section 4 of the paper: its experiment, repetitions and figures."""
