"""Functions of the public face, which speak the recording's units; inside of them everything is SI.

A user imports them from :mod:`brightgrey`.
"""
