"""The effects, one file each. :func:`brightgrey.effects.registry` finds them by listing this folder."""
