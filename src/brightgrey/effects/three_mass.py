"""Drive train of three inert masses."""

from brightgrey.effects.ladder import ladder

EFFECT = ladder("three_mass", masses=3)
