"""Drive trains of one to four inert masses in a row."""

from brightgrey.effects.mass_chain import mass_chain

EFFECTS = (
    mass_chain("one_mass", masses=1),
    mass_chain("two_mass", masses=2),
    mass_chain("three_mass", masses=3),
    mass_chain("four_mass", masses=4),
)
