"""Drive train of four inert masses."""

from brightgrey.effects.mass_chain import ladder

EFFECT = ladder("four_mass", masses=4)
