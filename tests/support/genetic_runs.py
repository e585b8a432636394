"""Genetic searches without recordings: one made by hand, and one by any estimator."""

from types import SimpleNamespace

from brightgrey.estimation.problem.simulation_count import SimulationCount
from brightgrey.kit import PAPER
from brightgrey.search.criteria import criterion
from brightgrey.search.genetic import GeneticSettings, Node, Run, evolve
from brightgrey.search.genetic.job_evaluator import JobEvaluator
from brightgrey.search.parallel import thread_pool


def individual(generation, number, value, parents=(), operator="recombination", structure="one_mass+coulomb"):
    names = structure.split("+")
    placed = PAPER.parse(structure)
    leaf = tuple(Node(p) for p in placed.placed[1:])
    misfit = SimpleNamespace(fit_percent=99.0)
    return SimpleNamespace(
        generation=generation,
        individual=number,
        parents=parents,
        operator=operator,
        tree=Node(placed.placed[0], (), leaf),
        job=SimpleNamespace(structure=placed),
        result=SimpleNamespace(n_parameters=len(names), simulations=7, spent=SimulationCount(7, 700), misfit=misfit),
        value=value,
        repeated=False,
    )


def small_run():
    """Three generations; the best comes from (1, 1), which was kept from (0, 0)."""
    other = "two_mass+viscous"
    return Run(
        (
            individual(0, 0, 2.0, operator="initial"),
            individual(0, 1, 1.0, operator="initial", structure=other),
            individual(1, 0, 0.5, (1, 1), structure=other),
            individual(1, 1, 2.0, (), "elite"),
            individual(2, 0, 3.0, (1, 1), "clone+insertion", "one_mass+coulomb+viscous"),
            individual(2, 1, 0.1, (0, 1), structure=other),
        )
    )


def search_with(estimator, draw, settings=None, *, default_start=None, workers=1, **options):
    """Genetic search whose individuals `estimator` identifies, each from its own start or from the default one."""
    settings = settings or GeneticSettings()
    with thread_pool(None, workers) as executor:
        judge = criterion(settings.criterion, settings.k_p)
        return evolve(JobEvaluator(estimator, executor, judge, default_start), draw, settings, **options)
