"""Further effects: which places of a grammar's later stage are worth offering, by score tests at the fits so far.

A large function set is out of reach of one fit of everything. So a search begins with a small one. Where that leaves
something unexplained, each further effect is simulated once, at the least size that matters, beside a structure that
lacks it. What its change shares with the residual, beyond what the structure's own parameters explain, is its score
(Rao 1948, doi:10.1017/S0305004100023987). Effects are taken one by one, the largest score first, each beside those that
were taken before (orthogonal matching pursuit, Pati, Rezaiifar, Krishnaprasad 1993, doi:10.1109/ACSSC.1993.342465).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.kit import Placed, Structure
from brightgrey.numerics.distributions import chi2
from brightgrey.search.fitting.refined_fit import RefinedFits, accurate
from brightgrey.search.policy import FURTHER, SELECTION

__all__ = ["further_effects"]


@dataclass(frozen=True)
class _Candidate:
    """A further effect beside a structure, with the whitened changes that it makes at several values."""

    placed: Placed
    changes: Array  #: Beyond what is explained already, shape (residuals, draws).
    either_sign: bool


def further_effects(
    refined: RefinedFits, structure: Structure, more: Sequence[Placed], least: float, seed: int
) -> tuple[Placed, ...]:
    """Effects of `more` that explain a material part of the residual of `structure`, the most important first.

    Parameters
    ----------
    refined : RefinedFits
        In a round.
    structure : Structure
        A fitted one.
    more : sequence of Placed
        Effects that it may lack.
    least : float
        Least deviance of any structure. An effect has to explain a part of what `structure` leaves beyond it.
    seed : int
        Of the values that are drawn for effects of several parameters.
    """
    own, whitening = refined.of(structure), refined.whitening
    residual, jacobian, inside = refined.jacobian(structure)
    basis = whitening.basis(jacobian[:, list(inside)])
    left = _beyond(basis, whitening.whiten(residual))
    candidates = []
    for placed in more:
        if _has_place(structure, placed):
            changes, either_sign = _changes(refined, structure, placed, seed)
            candidates.append(_Candidate(placed, _beyond(basis, changes), either_sign))
    enough = max(
        float(chi2.isf(SELECTION.false_alarm_level / max(len(candidates), 1), 1)),
        (SELECTION.min_rss_ratio - 1.0) * own.deviance,
        FURTHER.rescued_share * (own.deviance - least),
    )
    chosen: list[Placed] = []
    while candidates and len(chosen) < FURTHER.at_once:
        scores = [_scores(c, left) for c in candidates]
        first = int(np.argmax([s.max(initial=0.0) for s in scores]))
        if not scores[first].max(initial=0.0) >= enough:
            break
        taken = candidates.pop(first)
        chosen.append(taken.placed)
        for _ in taken.placed.effect.parameters:  # an effect of several parameters has as many directions
            found = _scores(taken, left)
            direction = taken.changes[:, int(np.argmax(found))]
            if not found.max(initial=0.0) > 0.0:
                break
            unit = (direction / np.linalg.norm(direction))[:, None]
            left = _beyond(unit, left)
            taken = _Candidate(taken.placed, _beyond(unit, taken.changes), taken.either_sign)
            candidates = [_Candidate(c.placed, _beyond(unit, c.changes), c.either_sign) for c in candidates]
    return tuple(chosen)


def _has_place(structure: Structure, placed: Placed) -> bool:
    """True if a structure lacks an effect, has its place, and what it requires."""
    last = {"drive": 1, "mass": structure.masses, "shaft": structure.masses - 1}[placed.effect.where]
    required = {Placed(name, placed.place) for name in placed.effect.requires}
    return placed.place <= last and placed not in structure.placed and required <= set(structure.placed)


def _changes(refined: RefinedFits, structure: Structure, placed: Placed, seed: int) -> tuple[Array, bool]:
    """Whitened changes of the residuals by an effect of the size that matters, and if it may have either sign."""
    task, own = accurate(refined.task), refined.of(structure)
    big = Structure((*structure.placed, placed))
    problem, space = task.problem_and_space(big)
    base = {**dict(zip(space.names, space.start.tolist(), strict=True)), **space.fixed, **own.values}
    size = placed.relevant_size(task.scales, own.values)
    (vanishing,) = (q for q in placed.effect.parameters if q.size)
    others = [n for n in map(placed.parameter, (q.symbol for q in placed.effect.parameters)) if n in space.names]
    others = [n for n in others if n != placed.parameter(vanishing.symbol)]
    count = 1 + (FURTHER.draws if others else 0)
    values = {name: np.full(count, size.get(name, value)) for name, value in base.items()}
    drawn = space.sample(count, np.random.default_rng(seed))
    for name in others:
        values[name][1:] = drawn[space.names.index(name), 1:]
    moved = problem.residuals(values, task.settings)
    changes = refined.whitening.whiten(moved - refined.jacobian(structure)[0][:, None])
    return np.where(np.isfinite(changes).all(axis=0), changes, 0.0), vanishing.scale == "linear"


def _beyond(basis: Array, x: Array) -> Array:
    """Part of `x`, shape (residuals, ...), beyond an orthonormal `basis`."""
    return np.asarray(x - basis @ (basis.T @ x))


def _scores(candidate: _Candidate, left: Array) -> Array:
    """Decrease of the deviance by a step along each change, shape (draws,); 0 for a size of the wrong sign."""
    along = left @ candidate.changes
    length = np.square(candidate.changes).sum(axis=0)
    allowed = (length > 0.0) & (candidate.either_sign | (along < 0.0))
    return np.divide(np.square(along), length, out=np.zeros_like(length), where=allowed)
