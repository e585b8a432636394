"""Drive train of two inert masses."""

from brightgrey.effects.mass_chain import ladder

EFFECT = ladder("two_mass", masses=2)
