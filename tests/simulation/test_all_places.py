"""Every effect at every place against the reference solvers, with smooth and with exact dry friction."""

import math

import numpy as np
import pytest

from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import Placed, Structure, assemble, grammar_named
from brightgrey.search.lattice import Lattice
from brightgrey.simulation import Settings, response
from brightgrey.simulation.reference import UnsettledError, compare_solvers

LATTICE = Lattice.of(grammar_named("drive").whole)
OUTPUTS = ("position", "velocity")
ELSEWHERE = [p for p in LATTICE.atoms if p.place > 1 or p.effect.number > 11]


def drive_with(placed: Placed, seed: int) -> Structure:
    """A random structure of up to three masses, or as many as it takes, with an effect and at most one gap."""
    rng = np.random.default_rng([seed, LATTICE.atoms.index(placed)])
    bit = 1 << LATTICE.atoms.index(placed)
    needed = bit | LATTICE.requires[LATTICE.atoms.index(placed)]
    masses = max(int(rng.integers(1, 4)), LATTICE.structure(needed).masses)
    mask = needed
    for i, other in enumerate(LATTICE.atoms):
        if other.effect.masses:
            mask |= (other.effect.masses <= masses) << i
        elif other.name != "backlash" or placed.name != "backlash":
            mask |= int(rng.random() < 0.2) << i
    for i, other in enumerate(LATTICE.atoms):  # of two that exclude each other, the later one goes
        if any(mask >> j & 1 and other.excludes(p) for j, p in enumerate(LATTICE.atoms) if j < i or p == placed):
            mask &= ~(1 << i) if other != placed else mask
    gaps = [i for i, p in enumerate(LATTICE.atoms) if p.name == "backlash" and mask >> i & 1]
    return LATTICE.structure(LATTICE.within(mask & ~sum(1 << i for i in gaps[1:])))


@pytest.mark.parametrize("f_tanh", [E.f_tanh, math.inf], ids=["smooth", "exact"])
@pytest.mark.parametrize("placed", ELSEWHERE, ids=str)
def test_levels__effect_at_its_place__keep_their_accuracy(placed, f_tanh):
    structure = drive_with(placed, 1)
    assert placed in structure.placed
    values = random_values(structure.parameters, np.random.default_rng([3, LATTICE.atoms.index(placed)]))
    u = E.torque()[:900:2]  # a pulse forth and one back
    try:
        known = compare_solvers(structure, values, u, E.dt, f_tanh=f_tanh, outputs=OUTPUTS)
    except UnsettledError as why:
        pytest.skip(str(why))
    if known.chaotic:
        pytest.skip("chaotic by measurement")
    assert known.difference.max() < 1e-6
    peak = np.abs(known.y).max(axis=1)
    s = assemble(structure, values, f_tanh, OUTPUTS)
    for level, allowed in (("accurate", 1e-4), ("fast", 5e-3)):
        y = response(s, u, E.dt, s.rest(u=u[0]), Settings(f_tanh, float(peak[1]), level)).y[..., 0]
        assert (np.abs(y - known.y).max(axis=1) / peak <= allowed).all(), level
