"""Drive train of two inert masses."""

from brightgrey.effects.ladder import ladder

EFFECT = ladder("two_mass", masses=2)
