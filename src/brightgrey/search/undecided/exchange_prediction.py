"""What a structure would leave with one effect exchanged for another, by its derivatives at its optimum."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.noise.orthonormal_basis import BASIS_RANK_TOLERANCE, beyond, orthonormal_basis
from brightgrey.kit import Placed, Structure, function_set
from brightgrey.search.fitting.refined_fit import Refined, RefinedFits, accurate, residual_and_jacobian
from brightgrey.search.further.proposals import EffectChanges, FurtherEffect, by_score, changes_beside, joint_step

__all__ = [
    "Linearised",
    "WithoutEffect",
    "linearised",
    "without_effect",
    "without_effects",
]


def linearised(refined: RefinedFits, own: Refined) -> Linearised:
    """Residual and derivatives at the optimum of a structure."""
    residual, jacobian, inside = residual_and_jacobian(refined.task, own.structure, own.values)
    names = refined.task.problem_and_space(own.structure)[1].names
    slopes = refined.whitening.whiten(jacobian[:, list(inside)]).T if inside else ()
    return Linearised(refined, own, residual, dict(zip((names[i] for i in inside), slopes, strict=True)))


@dataclass(frozen=True)
class Linearised:
    """Optimum of a structure with its whitened derivatives."""

    refined: RefinedFits
    own: Refined
    residual: Array  #: Not whitened.
    slopes: Mapping[str, Array]  #: By the parameters that are not at a bound, shape (residuals,) each.

    def changes(self, effects: Sequence[Placed], seed: int) -> list[EffectChanges]:
        """Whitened changes by each of some effects."""
        found = changes_beside(accurate(self.refined.task), self.own, self.residual, effects, seed)
        return [replace(c, changes=self.refined.whitening.whiten(c.changes)) for c in found]

    def beside(self, effects: Sequence[Placed], seed: int) -> list[tuple[float, FurtherEffect]]:
        """Effects that share something with what the structure leaves, with their scores, the largest first."""
        basis = self.basis(self.slopes)
        changes = [replace(c, changes=beyond(basis, c.changes)) for c in self.changes(effects, seed)]
        return by_score(changes, beyond(basis, self.refined.whitening.whiten(self.residual)))

    def basis(self, names: Collection[str]) -> Array:
        """Orthonormal basis of what some parameters explain, whitened."""
        columns = [slope for name, slope in self.slopes.items() if name in names]
        return orthonormal_basis(np.column_stack(columns)) if columns else np.zeros((len(self.residual), 0))

    def without(self, gone: Placed) -> WithoutEffect:
        """The structure without an effect, where the other parameters follow as far as their derivatives say."""
        task, whitening = accurate(self.refined.task), self.refined.whitening
        structure = without_effect(self.own.structure, gone)
        problem, space = task.problem_and_space(structure)
        base = {**dict(zip(space.names, space.start.tolist(), strict=True)), **space.fixed, **self.own.values}
        names = (*space.names, *space.fixed)
        residual = problem.residuals({n: np.array([base[n]]) for n in names}, task.settings)[:, 0]
        basis = self.basis(space.names)
        left = beyond(basis, whitening.whiten(residual))
        return WithoutEffect(structure, left, basis, float(left @ left) + whitening.floor_deviance)


@dataclass(frozen=True)
class WithoutEffect:
    """A structure without an effect, at first order."""

    structure: Structure
    left: Array  #: Whitened residual, beyond what its parameters explain.
    basis: Array  #: Of what they explain.
    deviance: float

    def with_several(self, changes: Sequence[EffectChanges]) -> tuple[float, list[FurtherEffect]]:
        """Deviance that several effects at once would leave, and these effects, the largest change first.

        Those that the structure may not have are left out. So is what its parameters explain but for rounding.
        """
        kit, distinct = function_set(), list[EffectChanges]()
        for c in changes:
            if not kit.broken_rule(Structure((*self.structure.placed, *c.added))):
                rest, whole = self.beyond(c), np.linalg.norm(c.changes, axis=0)
                seen = np.linalg.norm(rest.changes, axis=0) > BASIS_RANK_TOLERANCE * whole
                distinct.append(replace(rest, changes=rest.changes * seen))
        left, effects = joint_step(distinct, self.left)
        return self.deviance + float(left @ left) - float(self.left @ self.left), effects

    def beyond(self, change: EffectChanges) -> EffectChanges:
        """Changes by another effect beyond what the parameters explain."""
        return replace(change, changes=beyond(self.basis, change.changes))


def without_effects(structure: Structure, gone: Iterable[Placed]) -> Structure:
    """The structure without some effects, and without what requires them."""
    return reduce(without_effect, gone, structure)


def without_effect(structure: Structure, gone: Placed) -> Structure:
    """The structure without an effect, and without what requires it."""
    dependent = [p for p in structure.placed if p.place == gone.place and gone.name in p.effect.requires]
    return Structure(tuple(p for p in structure.placed if p != gone and p not in dependent))
