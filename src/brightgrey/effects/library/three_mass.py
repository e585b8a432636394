"""Drive train of three inert masses."""

from brightgrey.effects.mass_chain import ladder

EFFECT = ladder("three_mass", masses=3)
