"""Drive train of four inert masses."""

from brightgrey.effects.ladder import ladder

EFFECT = ladder("four_mass", masses=4)
