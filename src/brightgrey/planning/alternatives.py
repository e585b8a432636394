"""Alternatives to a question: truths that explain the recordings as well, and rivals that hold all other effects.

Where two structures explain the recordings alike, the truth may be one of them, or have a part of the effects of
either. Examples are a dead time of 5 ms, a lag of 5 ms, or 3 ms and 2 ms of them. The nearer it is to the rival, the
more a motion has to show.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np

from brightgrey.estimation.problem.nuisance import FRICTION_WIDTH
from brightgrey.kit import Structure, function_set
from brightgrey.search.undecided.question import Question

__all__ = ["against_largest", "share_that_matters", "truth_between", "with_free", "with_free_width"]


def share_that_matters(question: Question, part: float) -> float:
    """Share of the way from the rival to the truth: `part` of that from where its effects have a size that matters.

    A question other than ``'tied'`` has one truth, at the end of the way.
    """
    return question.least_share + part * (1.0 - question.least_share) if question.kind == "tied" else 1.0


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
    return with_free(question, {FRICTION_WIDTH})


def with_free(question: Question, names: Collection[str]) -> Question:
    """Question whose rival may change parameters as if the recordings said nothing of them."""
    free = np.array([name in names for name in question.rival.names], bool)
    H, g = np.array(question.rival.information), np.array(question.gradient)
    free &= np.diag(H) > 0.0
    if not free.any():
        return question
    scale = np.sqrt(np.diag(H)[free])
    inverse = np.linalg.pinv(H[np.ix_(free, free)] / np.outer(scale, scale), rcond=1e-12, hermitian=True)
    inverse /= np.outer(scale, scale)
    information, gradient = H - H[:, free] @ inverse @ H[free], g - H[:, free] @ inverse @ g[free]
    information[free], information[:, free], gradient[free] = 0.0, 0.0, 0.0  # but for rounding
    rival = replace(question.rival, information=tuple(map(tuple, information.tolist())))
    deviance = max(question.deviance - float(g[free] @ inverse @ g[free]), 0.0)
    return replace(question, rival=rival, gradient=tuple(gradient.tolist()), deviance=deviance)


def against_largest(question: Question, share: float) -> Iterator[Question]:
    """The question against each of the largest structures that lack one of its effects.

    Every structure without the effect has to be refuted, and all others may take its part there. Any structure between
    the rival and the largest one leaves no less than that, and none has a higher threshold than the rival.

    Parameters
    ----------
    question : Question
        With its truth at `share` of the way from the rival.
    share : float
    """
    way = np.array([share, 1.0 - share])
    for other in question.largest:
        yield replace(
            question,
            rival=other.known,
            gradient=tuple((way @ np.array(other.gradients)).tolist()),
            deviance=max(float(way @ np.array(other.deviances) @ way), 0.0),
        )


def _union(first: Structure, second: Structure) -> Structure | None:
    """Structure with the effects of both and the masses of the larger one; None if two of them exclude each other."""
    chain = max((p for s in (first, second) for p in s.placed if p.effect.masses), key=lambda p: p.effect.masses)
    both = Structure((chain, *(first.beside | second.beside)))
    return None if function_set().broken_rule(both) else both
