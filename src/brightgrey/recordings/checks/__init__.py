"""Checks of a recording before it is used: one file each in `library`, found by listing the folder.

A module of that folder defines ``CHECK``. Everything that the author of a check needs is in this room.
"""
