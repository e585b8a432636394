"""Drive train of two inert masses."""

from brightgrey.effects.mass_chain import mass_chain

EFFECT = mass_chain("two_mass", masses=2)
