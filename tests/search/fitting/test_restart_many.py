"""Restarts of the structures of a table: where their fields begin, and what they have to beat."""

from concurrent.futures import Executor, Future

import pytest

from brightgrey.kit import PAPER
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.lattice import complexity


class Asked(Executor):
    """Notes what it is asked and gives back what is known of a structure, as if nothing better were found."""

    def __init__(self, fits):
        self.fits, self.calls = fits, []

    def submit(self, function, /, task, structure, *rest):
        self.calls.append(rest)
        result = Future()
        result.set_result(self.fits.done[structure])
        return result


@pytest.mark.parametrize(
    ("costs", "begun"),
    [
        (
            {"two_mass": 100.0, "two_mass+coulomb": 95.0, "two_mass+viscous": 60.0, "two_mass+backlash": 40.0},
            {"two_mass": ["two_mass+backlash"], "two_mass+coulomb": []},
        ),
        (  # it has found the gap, whatever else it has and lacks
            {"two_mass+viscous+backlash": 100.0, "three_mass+coulomb+backlash": 40.0, "two_mass+coulomb": 30.0},
            {"two_mass+viscous+backlash": ["three_mass+coulomb+backlash"], "three_mass+coulomb+backlash": []},
        ),
    ],
    ids=["better supermodel", "best fit with a hard limit"],
)
def test_restart_many__much_better_fit__its_optimum_is_a_start(task, costs, begun):
    names = dict(zip(costs, map(PAPER.parse, costs), strict=True))
    fits = FitTable(task, list(names.values()))
    fits.done.update({s: StructureFit(s, {}, costs[name], complexity(s)) for name, s in names.items()})
    asked = Asked(fits)
    fits.restart_many([names[name] for name in begun], 1, asked)
    starts = [[str(f.structure) for f in known] for *_, known, _, _ in asked.calls]
    assert starts == [[name, *more] for name, more in begun.items()]


def test_restart_many__supermodel_with_a_redundant_effect__begins_where_it_has_its_optimum_from(task):
    """The optimum of a structure without the effect of the asked one: it would not be tried otherwise."""
    own, same, larger = map(PAPER.parse, ("two_mass+coulomb", "two_mass+viscous", "two_mass+coulomb+viscous"))
    fits = FitTable(task, [own, same, larger])
    fits.done |= {own: StructureFit(own, {}, 100.0, 7), same: StructureFit(same, {}, 40.0, 7)}
    fits.done[larger] = StructureFit(larger, {}, 40.0, 8, ("coulomb",), equals=same)
    asked = Asked(fits)
    fits.restart_many([own], 1, asked)
    ((*_, known, enough, to_beat),) = asked.calls
    assert [f.structure for f in known] == [own, same]
    assert enough == pytest.approx(40.0, rel=0.01)  # the best structure leaves so much
    assert to_beat == 100.0


@pytest.mark.parametrize("name", ["two_mass+coulomb", "two_mass+backlash"])
def test_restart_many__several_fields__known_optimum_is_a_start_of_one_of_them(task, name):
    own = PAPER.parse(name)
    fits = FitTable(task, [own])
    fits.done[own] = StructureFit(own, {}, 100.0, 7)
    asked = Asked(fits)
    fits.restart_many([own], 0, asked, fields=2)
    assert [len(known) for *_, known, _, _ in asked.calls] == [1, 0]
    seeds = {seed for *_, seed, _, _, _ in asked.calls}
    assert len(seeds) == 2
