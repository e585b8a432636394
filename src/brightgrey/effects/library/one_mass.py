"""Drive train of one inert mass."""

from brightgrey.effects.mass_chain import ladder

EFFECT = ladder("one_mass", masses=1)
