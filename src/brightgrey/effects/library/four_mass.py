"""Drive train of four inert masses."""

from brightgrey.effects.mass_chain import mass_chain

EFFECT = mass_chain("four_mass", masses=4)
