"""Drive train of one inert mass."""

from brightgrey.effects.mass_chain import mass_chain

EFFECT = mass_chain("one_mass", masses=1)
