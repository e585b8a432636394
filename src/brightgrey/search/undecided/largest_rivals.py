"""Largest rivals: structures with everything but one effect, whose part all the others may take together.

An effect is needed when every structure without it is refuted, and that is so when the largest one is. A recording may
have refuted viscous friction in the place of Coulomb friction, and Stribeck friction may be as good as it. Then viscous
and Stribeck friction together are a rival, too, and a better one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from brightgrey.arrays import Array
from brightgrey.kit import Structure
from brightgrey.search.detectability import Detectability, has, relevant_sizes
from brightgrey.search.fitting.refined_fit import refine, residual_and_jacobian
from brightgrey.search.lattice import contains
from brightgrey.search.undecided.past_recordings import eliminated
from brightgrey.search.undecided.question import LargestRival

__all__ = ["LargestRivals"]


@dataclass(frozen=True)
class _Simulated:
    """A structure at some values, with its residuals and their Jacobian."""

    values: dict[str, float]
    residual: Array
    jacobian: Array


@dataclass(frozen=True)
class LargestRivals:
    """Largest structures of the lattice that lack an effect, fitted to the recordings so far."""

    detectability: Detectability
    _fitted: dict[Structure, _Simulated] = field(default_factory=dict)

    def of(self, truth: Structure, rival: Structure, change: Array) -> Iterator[LargestRival]:
        """Those that have all of `rival` and lack an effect of `truth`.

        Parameters
        ----------
        truth, rival : Structure
        change : ndarray, shape (residuals,)
            Residual of the rival minus that of the truth.
        """
        refined = self.detectability.refined
        for structure in self.without(truth, rival):
            own = self._fitted.get(structure) or self._fit(structure, rival)
            self._fitted[structure] = own
            from_rival = own.residual - refined.jacobian(rival)[0]
            changes = np.stack([from_rival + change, from_rival], axis=1)
            known, gradients, products = eliminated(refined, structure, own.values, own.jacobian, changes)
            (first, second), (one, other) = gradients.tolist(), products.tolist()
            yield LargestRival(known, (tuple(first), tuple(second)), ((one[0], one[1]), (other[0], other[1])))

    def without(self, truth: Structure, rival: Structure) -> list[Structure]:
        """Largest structures that contain `rival` and lack an effect that `truth` has beyond it.

        They have as many masses as the larger one of both: further masses explain resonances, and cost most.
        """
        lattice = self.detectability.circumstances.lattice
        masses, found = max(truth.masses, rival.masses), dict[Structure, None]()
        atoms = [(1 << i, p) for i, p in enumerate(lattice.atoms)]
        beyond = sum(bit for bit, p in atoms if p.effect.masses > masses)
        for bit, placed in atoms:
            if has(truth, str(placed)) and not has(rival, str(placed)):
                largest = lattice.structure(lattice.within(lattice.everything & ~beyond & ~bit) | lattice.required)
                if contains(largest, rival) and largest != rival:
                    found[largest] = None
        return list(found)

    def _fit(self, structure: Structure, rival: Structure) -> _Simulated:
        """A structure fitted from the values of a rival, and its further effects of the least size that matters.

        They keep that size at least: from nothing at all, none would be found by its slope.
        """
        refined = self.detectability.refined
        task, values = refined.task, {**refined.task.default_start(structure), **refined.of(rival).values}
        least: dict[str, float] = {}
        for placed in structure.placed:
            if not has(rival, str(placed)):
                for size in relevant_sizes(task, values, str(placed))[:1]:
                    least |= size
        found = refine(task, structure, {**values, **least}, refined.whitening, np.inf).values
        for placed in structure.placed:
            names = [placed.parameter(q.symbol) for q in placed.effect.parameters if q.size]
            if any(name in least and abs(found[name]) < abs(least[name]) for name in names):
                own = {placed.parameter(q.symbol) for q in placed.effect.parameters}
                found = {**found, **{name: value for name, value in least.items() if name in own}}
        residual, jacobian, _ = residual_and_jacobian(task, structure, found)
        return _Simulated(dict(found), residual, jacobian)
