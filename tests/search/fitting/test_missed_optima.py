"""What a residual leaves to explain."""

import numpy as np
import pytest

from brightgrey.kit import PAPER
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.fitting.missed_optima import is_explained
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.lattice import Lattice
from brightgrey.search.parallel import InlineExecutor
from support.searches import simulated_task

STRUCTURE, VALUES = PAPER.parse("one_mass+viscous"), {"J1": 0.02, "f_v": 0.05}


@pytest.mark.parametrize(("share", "explained"), [(0.0, True), (5e-5, True), (2e-4, False), (1e-2, False)])
def test_is_explained__no_noise_and_a_wrong_inertia__only_below_the_error_to_which_sensors_are_trusted(
    share, explained
):
    """The residual is `share` of the motion: what a certificate calls unexplained is to be looked for by the search."""
    u = 2.0 * np.sin(np.arange(600) / 20.0)
    task = simulated_task(STRUCTURE, VALUES, u, 0.0, dt=0.002, f_tanh=5.0)
    problem, (recording,) = task.problem(STRUCTURE), task.recordings
    size = problem.weights[0] * np.std(recording.y) * np.sqrt(recording.samples)

    def residual(factor):
        named = {name: np.array([value]) for name, value in {**VALUES, "J1": factor * VALUES["J1"]}.items()}
        return problem.residuals(named, task.settings)[:, 0]

    factor = 1.0 + share * size / (np.linalg.norm(residual(1.001) - residual(1.0)) / 0.001)
    fitted = StructureFit(STRUCTURE, {**VALUES, "J1": factor * VALUES["J1"]}, float(np.sum(residual(factor) ** 2)), 2)
    search = BorderSearch(task, Lattice.of(PAPER), InlineExecutor())
    search.fits.done[STRUCTURE] = fitted
    assert search.is_explained() == explained
    assert is_explained(search.fits) == explained  # as where all structures are fitted
