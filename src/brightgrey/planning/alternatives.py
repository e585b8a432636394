"""Alternatives to a question: truths that explain the recordings as well, and rivals that hold further open effects.

Where two structures explain the recordings alike, the truth may be one of them, or have a part of the effects of
either: a dead time of 5 ms, a lag of 5 ms, or 3 ms and 2 ms of them. The nearer it is to the rival, the more a motion
has to show.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import isclose, nan

import numpy as np

from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.kit import Placed, Structure, function_set
from brightgrey.search.detectability import Detectability
from brightgrey.search.undecided.question import Known, Question

__all__ = ["rivals_with_open_effects", "truth_between", "with_free_width"]


def truth_between(question: Question, share: float) -> Question:
    """Question whose truth lies between its two structures.

    Sizes of effects that only one of both has are scaled, other values are interpolated. What the truth does beyond the
    rival is linear in these sizes, and so is what the old recordings say of it.

    Parameters
    ----------
    question : Question
        Other kinds than ``'tied'`` are returned as they are, as are structures that exclude each other.
    share : float
        Part of the way from the rival, 0, to the truth, 1.
    """
    first, second = Structure.parse(question.truth), Structure.parse(question.rival.structure)
    both = _union(first, second)
    if question.kind != "tied" or both is None or share == 1.0:
        return question
    values, other = question.values, question.rival.values
    sizes = {p.parameter(q.symbol) for p in both.placed for q in p.effect.parameters if q.size or p.effect.masses}
    mixed = {}
    for name in (*both.parameters, FRICTION_WIDTH):
        if name in values and name in other:
            mixed[name] = share * values[name] + (1.0 - share) * other[name]
        elif name in values or name in other:
            alone, part = (values[name], share) if name in values else (other[name], 1.0 - share)
            mixed[name] = part * alone if name in sizes else alone
    gradient = tuple(share * g for g in question.gradient)
    return replace(question, truth=str(both), values=mixed, gradient=gradient, deviance=share**2 * question.deviance)


def with_free_width(question: Question) -> Question:
    """Question whose rival may change the width of friction's reversal as if the recordings said nothing of it.

    They know it to a factor at best. So far away their normal equations do not hold, and a motion in which friction
    sticks and slips depends on it.
    """
    names = question.rival.names
    if FRICTION_WIDTH not in names:
        return question
    H, g, k = np.array(question.rival.information), np.array(question.gradient), names.index(FRICTION_WIDTH)
    if H[k, k] <= 0.0:
        return question
    information = tuple(map(tuple, (H - np.outer(H[k], H[k]) / H[k, k]).tolist()))
    gradient = tuple((g - H[k] * g[k] / H[k, k]).tolist())
    rival = replace(question.rival, information=information)
    return replace(question, rival=rival, gradient=gradient, deviance=max(question.deviance - g[k] ** 2 / H[k, k], 0.0))


def rivals_with_open_effects(question: Question, others: Sequence[Question]) -> Iterator[Question]:
    """Questions whose rival also has other open effects, each in turn and all at once, from their size that matters on.

    Every structure without the effect has to be refuted, so one of these may take its part. The recordings so far count
    as saying nothing of the other effects. Each rival has its own threshold, as in the decision.
    """
    added = [q for q in map(_added, others) if q is not None and not set(q.effects) & set(question.effects)]
    added = [q for k, q in enumerate(added) if q.effects not in [p.effects for p in added[:k]]]
    wide = [_with_effects(question, [other]) for other in added]
    if len(added) > 1:
        wide.append(_with_effects(question, added))
    yield from (q for q in wide if q is not None)


def _added(question: Question) -> Question | None:
    """The question with only the effect's own values in the truth; None if the rival's values are others in it."""
    base, values = question.rival.values, question.values
    if question.kind != "size" or not all(isclose(values.get(name, nan), value) for name, value in base.items()):
        return None
    return replace(question, values={name: value for name, value in values.items() if name not in base})


def _with_effects(question: Question, added: Sequence[Question]) -> Question | None:
    """Question whose rival has further effects; None if they cannot stand there, or stand there already."""
    base, structure = question.rival, Structure.parse(question.rival.structure)
    more: dict[str, float] = {}
    for other in added:
        wider = _union(structure, Structure((*structure.placed, *map(Placed.parse, other.effects))))
        if wider is None or wider == structure:
            return None
        structure, more = wider, {**more, **other.values}
    names = tuple(n for n in (*structure.parameters, FRICTION_WIDTH) if n in base.names or n in more)
    old = [names.index(name) for name in base.names]
    information, gradient = np.zeros((len(names), len(names))), np.zeros(len(names))
    information[np.ix_(old, old)], gradient[old] = base.information, question.gradient
    left = max(question.parameters - len(more), 1)
    return replace(
        question,
        rival=Known(str(structure), {**base.values, **more}, names, tuple(map(tuple, information.tolist()))),
        gradient=tuple(gradient.tolist()),
        parameters=left,
        critical=Detectability.chance(left),
    )


def _union(first: Structure, second: Structure) -> Structure | None:
    """Structure with the effects of both and the masses of the larger one; None if two of them exclude each other."""
    chain = max((p for s in (first, second) for p in s.placed if p.effect.masses), key=lambda p: p.effect.masses)
    both = Structure((chain, *(first.beside | second.beside)))
    return None if function_set().broken_rule(both) else both
