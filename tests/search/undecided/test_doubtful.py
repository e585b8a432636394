"""Effects that help in some parts of a recording only, on recordings of the reference solver with a disturbance."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from brightgrey.api.to_si import identification_task
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import PAPER
from brightgrey.search.border_search import BorderSearch
from brightgrey.search.evidence import EffectVerdict, with_model
from brightgrey.search.lattice import Lattice
from brightgrey.search.undecided.doubtful import without_unsteady
from brightgrey.search.verdicts import Reason
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

TRUTH = {"J1": 0.0277, "M_C": 0.8, "f_v": 0.05}
STRUCTURE = PAPER.parse("one_mass+coulomb+viscous")
WITH_GRAVITY = PAPER.parse("one_mass+coulomb+viscous+gravity")


@pytest.fixture(scope="module")
def search():
    """Fits to a recording in which somebody leans on the load for a twentieth of the time."""
    rng = np.random.default_rng(1)
    t = E.dt * np.arange(800)
    u = 3.0 * np.cos(2.0 * np.pi * 2.5 * t) + 1.5 * np.sin(2.0 * np.pi * 0.9 * t)
    pushed = 0.8 * ((t > 0.42 * t[-1]) & (t < 0.47 * t[-1]))
    (v,) = reference(str(STRUCTURE), TRUTH, u + pushed, E.dt, f_tanh=100.0)
    v += 0.003 * np.abs(v).max() * rng.standard_normal(v.size)
    task = identification_task([make_recording(u, v, dt=E.dt)], None, {}, {}, 100.0)
    with ThreadPoolExecutor(1) as workers:
        found = BorderSearch(task, Lattice.of(PAPER.whole), workers)
        found.fits.add([WITH_GRAVITY, STRUCTURE], workers)
        found.refined.begin_round(WITH_GRAVITY)
        yield found


def test_without_unsteady__helps_in_few_parts__is_left_out(search):
    deviance = {s: search.refined.of(s).deviance for s in (WITH_GRAVITY, STRUCTURE)}
    assert deviance[STRUCTURE] > deviance[WITH_GRAVITY]
    assert without_unsteady(search, WITH_GRAVITY, {"gravity": "unsteady gain"}) == STRUCTURE


def test_without_unsteady__helps_everywhere_or_without_that_reservation__stays(search):
    doubtful = {"coulomb": "unsteady gain", "viscous": "unsteady gain", "gravity": "unconfirmed"}
    assert without_unsteady(search, WITH_GRAVITY, doubtful) == WITH_GRAVITY


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (STRUCTURE, "No structure without it fits. The model leaves it out."),
        (WITH_GRAVITY, "No structure without it fits."),
    ],
)
def test_with_model__effect_that_the_model_lacks__is_said(model, said):
    card = EffectVerdict("gravity", "not decidable", None, None, Reason("indispensable"))
    assert with_model(card, WITH_GRAVITY, model).reason == said
