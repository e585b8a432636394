"""Both levels against the independent reference, on a sample; bench/accuracy.py does all structures."""

import numpy as np
import pytest

from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER, assemble
from brightgrey.simulation import Settings, response
from brightgrey.simulation.reference import UnsettledError, compare_solvers

ALL = list(PAPER.structures())
SAMPLE = range(9, 448, 37)
OUTPUTS = ("position", "velocity")


def test_sample__has_every_effect():
    assert {p.name for i in SAMPLE for p in ALL[i].placed} == set(PAPER.places)


@pytest.mark.parametrize("number", SAMPLE, ids=lambda i: str(ALL[i]))
def test_levels__random_drives__keep_their_accuracy(number):
    structure = ALL[number]
    values = random_values(structure.parameters, np.random.default_rng([2, number]))
    u = E.torque()
    try:
        known = compare_solvers(structure, values, u, E.dt, f_tanh=E.f_tanh, outputs=OUTPUTS, both=False)
    except UnsettledError as why:
        pytest.skip(str(why))
    if known.chaotic:
        pytest.skip("chaotic by measurement: listed apart by bench/accuracy.py")
    peak = np.abs(known.y).max(axis=1)
    s = assemble(structure, values, E.f_tanh, OUTPUTS)
    for level, allowed in (("accurate", 1e-4), ("fast", 5e-3)):
        y = response(s, u, E.dt, s.rest(u=u[0]), Settings(E.f_tanh, float(peak[1]), level)).y[..., 0]
        assert (np.abs(y - known.y).max(axis=1) / peak <= allowed).all(), level
