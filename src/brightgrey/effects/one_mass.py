"""Drive train of one inert mass."""

from brightgrey.effects.ladder import ladder

EFFECT = ladder("one_mass", masses=1)
