"""Drive train of three inert masses."""

from brightgrey.effects.mass_chain import mass_chain

EFFECT = mass_chain("three_mass", masses=3)
