"""Tasks made of arrays, and the two halves of a search on them: a table of fits, and the decision."""

import numpy as np

from brightgrey.estimation import scales
from brightgrey.kit import PAPER
from brightgrey.search import IdentificationTask
from brightgrey.search.decision import decide_structures
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.missed_optima import find_missed_optima
from brightgrey.search.parallel import thread_pool
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference
from support.recordings import make_recording


def task_of_arrays(u, y, *, dt, f_tanh, hold="linear", level="fast", **recording):
    """Task of an input `u` and an output `y`; `recording` are options of :func:`make_recording`."""
    made = make_recording(u, y, dt=dt, hold=hold, **recording)
    known = scales(made)
    return IdentificationTask((made,), known, Settings(f_tanh, known.speed, level, hold=hold))


def simulated_task(structure, values, u, noise, *, dt, f_tanh, begin=0, seed=1, step=None):
    """Task of a velocity by the reference solver from sample `begin` on.

    `noise` is the standard deviation of white noise, `step` the resolution of the sensor.
    """
    (v,) = reference(structure, values, u, dt, f_tanh=f_tanh)
    y = (v + noise * np.random.default_rng(seed).normal(size=v.size))[begin:]
    return task_of_arrays(u[begin:], y if step is None else step * np.round(y / step), dt=dt, f_tanh=f_tanh)


def fit_all(task, structures, *, seed=0, executor=None, progress=None, seeking=None):
    """Fits of all `structures` by structure, after missed optima have been looked for."""
    fits = FitTable(task, structures, seed=seed)
    with thread_pool(executor) as workers:
        fits.add(structures, workers, progress)
        find_missed_optima(fits, workers, seeking)
    return fits.done


def decided(task, effects, **options):
    """Decision on the paper's grammar with nothing but `effects`, multiple masses among them."""
    return decide_structures(
        task, PAPER, exclude=tuple(e for e in PAPER.places if e not in {"one_mass", *effects}), **options
    )


def verdicts(decision):
    """Verdict on each effect by name."""
    return {card.effect: card.verdict for card in decision.evidence.cards}


def minimal(decision):
    """Minimal structures as text, the best first."""
    return [str(refined.structure) for refined in decision.evidence.minimal]
