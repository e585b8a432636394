"""Largest rivals: structures with everything but one effect, whose part all the others may take together.

An effect is needed when every structure without it is refuted, and that is so when the largest one is. A recording may
have refuted viscous friction in the place of Coulomb friction, and Stribeck friction may be as good as it. Then viscous
and Stribeck friction together are a rival, too, and a better one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from brightgrey.arrays import Array
from brightgrey.kit import Structure
from brightgrey.search.detectability import Detectability, relevant_sizes
from brightgrey.search.fitting.refined_fit import refine, residual_and_jacobian
from brightgrey.search.lattice import contains, has
from brightgrey.search.parallel import in_order
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

    def fit(self, pairs: Sequence[tuple[Structure, Structure]]) -> None:
        """Fit those of all pairs of a truth and a rival, in parallel: `of` asks for them one by one."""
        wanted: dict[Structure, Structure] = {}
        for truth, rival in pairs:
            for structure in self.without(truth, rival):
                wanted.setdefault(structure, rival)
        refined = self.detectability.refined
        task, least = refined.task, {s: self.least_sizes(s, rival) for s, rival in wanted.items()}
        starts = {s: {**task.default_start(s), **refined.of(rival).values, **least[s]} for s, rival in wanted.items()}
        material = self.detectability.circumstances.material_growth
        calls = [(task, s, start, refined.whitening, np.inf, material) for s, start in starts.items()]
        for structure, end in zip(wanted, in_order(self.detectability.executor, refine, calls), strict=True):
            values = _of_least_size(structure, end.values, least[structure])
            residual, jacobian, _ = residual_and_jacobian(task, structure, values)
            self._fitted[structure] = _Simulated(values, residual, jacobian)

    def least_sizes(self, structure: Structure, rival: Structure) -> dict[str, float]:
        """Least sizes that matter of the effects that a structure has beyond a rival."""
        task, found = self.detectability.refined.task, dict[str, float]()
        values = {**task.default_start(structure), **self.detectability.refined.of(rival).values}
        for placed in structure.placed:
            if not has(rival, str(placed)):
                for size in relevant_sizes(task, values, str(placed))[:1]:
                    found |= size
        return found

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
            own = self._fitted[structure]
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


def _of_least_size(structure: Structure, values: Mapping[str, float], least: Mapping[str, float]) -> dict[str, float]:
    """Values with the effects that have vanished at the least size: from nothing, none would be found by its slope."""
    found = dict(values)
    for placed in structure.placed:
        sizes = [placed.parameter(q.symbol) for q in placed.effect.parameters if q.size]
        if any(name in least and abs(values[name]) < abs(least[name]) for name in sizes):
            own = {placed.parameter(q.symbol) for q in placed.effect.parameters}
            found |= {name: value for name, value in least.items() if name in own}
    return found
