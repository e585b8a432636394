"""The loop of figure 5: identify all individuals, judge them, let them have offspring."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from brightgrey.kit import PAPER, Grammar, Structure
from brightgrey.search.criteria import criterion
from brightgrey.search.genetic.history import Evaluation, Progress, Run
from brightgrey.search.genetic.offspring import Offspring, offspring, remutate_duplicates, untried_neighbours
from brightgrey.search.genetic.population import Draw, initial_population
from brightgrey.search.genetic.rules import Rules
from brightgrey.search.genetic.settings import GeneticSettings
from brightgrey.search.parallel import Stopped

__all__ = ["Evaluator", "evolve"]


class Evaluator(Protocol):
    """Strategy by which individuals are identified and judged."""

    def evaluate(self, generation: int, born: Sequence[Offspring]) -> list[Evaluation]:
        """Evaluations of the individuals of a generation, in their order."""
        ...

    def revise(self, evaluations: Sequence[Evaluation]) -> list[Evaluation]:
        """All evaluations so far, in the light of the latest generation; further ones are appended."""
        ...

    def has_lost(self, structure: Structure) -> bool:
        """True if a structure, evaluated or not, cannot win any more."""
        ...


def evolve(
    evaluator: Evaluator,
    draw: Draw,
    settings: GeneticSettings | None = None,
    *,
    grammar: Grammar = PAPER,
    seed: int = 0,
    progress: Callable[[Progress], None] | None = None,
) -> Run:
    """Search for a structure by the paper's degenerate genetic programming.

    All random draws are made here, one after the other. The results of a generation are put in their order before
    anything is drawn again. So the same seed gives the same run for any number of workers.

    Parameters
    ----------
    evaluator : Evaluator
        Identifies and judges individuals by the criterion of `settings`.
    draw : callable
        Random parameters of a submodel.
    settings : GeneticSettings, optional
        The paper's by default.
    grammar : Grammar
    seed : int
    progress : callable, optional
        Called after every generation.

    Returns
    -------
    Run
        An interruption (Ctrl-C, or the executor says so) ends it with the evaluations so far.

    Raises
    ------
    KeyboardInterrupt, Stopped
        If it is interrupted before the first generation is evaluated.
    """
    settings = settings or GeneticSettings()
    rules, rng, began = Rules(grammar), np.random.default_rng(seed), time.monotonic()
    done: list[Evaluation] = []
    born: Sequence[Offspring] = [
        Offspring(tree, (), "initial") for tree in initial_population(settings.population, rules, draw, rng)
    ]
    for generation in range(settings.generations + 1):
        try:
            first = len(done)
            done += evaluator.evaluate(generation, born)
            done = evaluator.revise(done)
            current = done[first : first + len(born)]
            if progress:
                share = (settings.generations - generation) / (generation + 1)
                left, state = share * (time.monotonic() - began), rng.bit_generator.state
                progress(Progress(generation, settings.generations, Run(tuple(done)).best, left, state, current))
        except (KeyboardInterrupt, Stopped):
            if not done:
                raise
            return Run(tuple(done), interrupted=True)
        if generation < settings.generations:
            born = _next_generation(done, current, evaluator.has_lost, settings, rules, draw, rng)
    return Run(tuple(done))


def _next_generation(
    done: Sequence[Evaluation],
    current: Sequence[Evaluation],
    has_lost: Callable[[Structure], bool],
    settings: GeneticSettings,
    rules: Rules,
    draw: Draw,
    rng: np.random.Generator,
) -> Sequence[Offspring]:
    """Elite, untried neighbours of the best structures, and the offspring of the `current` population."""
    independent = current[0].result.misfit.independent
    chances = criterion(settings.criterion, settings.k_p).chances([e.value for e in current], independent)
    children = offspring([e.tree for e in current], chances, settings, rules, draw, rng)
    tried = {e.job.structure for e in done}

    def is_tried(structure: Structure) -> bool:
        return structure in tried or has_lost(structure)

    best = [e.tree for e in Run(tuple(done)).structures() if not e.result.idle]
    close = untried_neighbours(best, is_tried, settings, rules, draw, rng)
    tried |= {neighbour.tree.structure for neighbour in close}
    children = remutate_duplicates(children, is_tried, settings, rules, draw, rng)
    return (*(Offspring(tree, (), "elite") for tree in best[: settings.elite]), *close, *children)
