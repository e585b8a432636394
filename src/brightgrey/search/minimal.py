"""Minimal structures: nothing can be removed and nothing has to be added without a significant loss."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence

import numpy as np

from brightgrey.kit import Structure
from brightgrey.search.comparison import Judged, threshold
from brightgrey.search.criteria import bic
from brightgrey.search.fitting import Fitted
from brightgrey.search.lattice import contains, minimal_elements, one_larger, one_smaller
from brightgrey.search.policy import BUDGET, SELECTION
from brightgrey.search.task import FAST_LEVEL_ACCURACY, TRUSTED_ACCURACY
from brightgrey.search.yardstick import Yardstick

__all__ = ["minimal_structures"]

Rivals = dict[Structure, dict[Structure, int]]


def minimal_structures(yardstick: Yardstick, progress: Callable[[Structure], None] | None) -> list[Judged]:
    """Adequate structures that contain no other adequate one, fewest masses first, then by BIC.

    Candidates are examined in the order of their promise until none is left. A refit may show that an accepted
    structure is not adequate, or that a rejected one is. Then all are tested again.
    """
    bench = yardstick.bench
    looked: list[Structure] = []  # examined, or submodels of accepted ones
    rivals: Rivals = {}
    examined = 0
    while True:
        before = len(looked), {s: j.cost for s, j in bench.judged.items()}
        accepted: list[Structure] = []
        for s in looked:
            accepted = _accepted(yardstick, accepted, s, rivals)
        while examined < BUDGET.max_examined or not accepted:
            structure = _next(yardstick, accepted, looked)
            if structure is None:
                break
            examined += 1
            looked.append(structure)
            if progress is not None:
                progress(structure)
            accepted = _accepted(yardstick, accepted, structure, rivals)
        for s in sorted(set(looked).difference(accepted), key=str):
            bench.improve(s)
        for s in accepted:
            looked += [small for small in _without_loss(yardstick, s, rivals) if small not in looked]
        if before == (len(looked), {s: j.cost for s, j in bench.judged.items()}):
            found = map(bench.judge, minimal_elements(accepted))
            return sorted(found, key=lambda j: (j.structure.masses, yardstick.criterion(j)))


def _accepted(
    yardstick: Yardstick, accepted: Sequence[Structure], structure: Structure, rivals: Rivals
) -> list[Structure]:
    """Accepted structures with the new one, if it is adequate and none rejects it, without those that it rejects."""
    if _beaten(yardstick, structure, accepted) or not _adequate(yardstick, structure, rivals):
        return list(accepted)
    return [*(s for s in accepted if not _beaten(yardstick, s, [structure])), structure]


def _beaten(yardstick: Yardstick, structure: Structure, others: Iterable[Structure]) -> bool:
    """Return True if one of the others fits significantly better, though it need not contain the structure.

    No distribution is known for models that are not nested. So the level is that of the best of all known structures.
    """
    own, tests = yardstick.bench.judge(structure), len(yardstick.known)
    return any(yardstick.better(yardstick.bench.judge(s), own, tests) for s in others)


def _without_loss(yardstick: Yardstick, structure: Structure, rivals: Rivals) -> list[Structure]:
    """Adequate structures among the submodels that lack one effect or one mass; they are refitted from the structure.

    If a submodel is rejected because it lacks another effect, the structure with that effect takes its place.
    """
    found, bench = [], yardstick.bench
    smaller = one_smaller(structure, yardstick.known)
    bench.judge_all(smaller)
    for s in smaller:
        bench.improve(s)
        if not _loses(yardstick, s, structure):
            found += _adequate_beside(yardstick, s, structure, rivals)
    return found


def _adequate_beside(yardstick: Yardstick, small: Structure, big: Structure, rivals: Rivals) -> list[Structure]:
    """`small` if it is adequate; else an adequate structure that rejects it and does not contain `big`, if any."""
    while True:
        beaten = False
        for s in _better_than(yardstick, small, rivals):
            beaten = True
            if not contains(s, big):
                small = s
                break
        else:
            return [] if beaten else [small]


def _loses(yardstick: Yardstick, small: Structure, big: Structure) -> bool:
    """Return True if `small` fits significantly worse than `big`, which has one effect or mass more.

    `small` may have missed its optimum, as with a light mass between two others. So it is first fitted by multistart.
    """
    bench, tests = yardstick.bench, len(one_larger(small, yardstick.known))  # a first test: more are compared later
    while yardstick.better(bench.judge(big), bench.judge(small), tests):
        fields = _fields(yardstick, small, big) - bench.sought.get(small, 0)
        if fields <= 0 or bench.vain >= BUDGET.max_fruitless_restarts:
            return True
        bench.seek(small, min(fields, BUDGET.side_by_side))
    return False


def _fields(yardstick: Yardstick, small: Structure, big: Structure) -> int:
    """Multistarts of `small` before `big` may reject it: many for a small difference, few or none for a large one."""
    left, least = (yardstick.left(yardstick.bench.judge(s)) for s in (small, big))
    if left <= BUDGET.small_difference * least:
        return BUDGET.restarts_costly if small.has_hard_limit else BUDGET.restarts
    return BUDGET.restarts_costly if small.masses < big.masses and not small.has_hard_limit else 0


def _next(yardstick: Yardstick, accepted: Sequence[Structure], looked: Collection[Structure]) -> Structure | None:
    """Candidate that may be adequate and contains no accepted structure: the one with the least BIC.

    BIC counts independent samples. A cost within the error of the search's level says nothing: a refit decides.
    """
    n = yardstick.independent
    rough = yardstick.doubt * (FAST_LEVEL_ACCURACY / TRUSTED_ACCURACY) ** 2
    cost = {s: max(yardstick.bench.cost(s), yardstick.doubt) + rough for s in yardstick.known}
    least = min(yardstick.known.values(), key=lambda f: (cost[f.structure], f.free))

    def close(f: Fitted) -> bool:
        more = max(least.free - f.free, 1)
        reach = float(np.exp(2.0 * threshold(more, SELECTION.screening_level) / n))
        return cost[f.structure] <= max(BUDGET.always_examined, reach) * cost[least.structure]

    def doubtful(f: Fitted) -> bool:
        return f.cost <= rough

    left = [
        f
        for f in yardstick.known.values()
        if f.structure not in looked
        and (close(f) or doubtful(f))
        and not any(contains(f.structure, s) for s in accepted)
    ]

    def promise(f: Fitted) -> tuple[float, int]:
        return bic(cost[f.structure], n, f.free), f.free

    return min(left, key=promise).structure if left else None


def _adequate(yardstick: Yardstick, structure: Structure, rivals: Rivals) -> bool:
    """Return True if no supermodel fits significantly better."""
    return next(_better_than(yardstick, structure, rivals), None) is None


def _better_than(yardstick: Yardstick, structure: Structure, rivals: Rivals) -> Iterator[Structure]:
    """Yield supermodels that fit significantly better, the best first; they are refitted when they are needed.

    The supermodels that are compared stay the same from call to call, so that no further refits are made. The best of
    those that were refitted meanwhile is added.
    """
    if structure not in rivals:
        rivals[structure] = _compared(yardstick, structure)
    own, tests, bench = yardstick.bench.judge(structure), dict(rivals[structure]), yardstick.bench
    late = [s for s in bench.judged if s != structure and s not in tests and contains(s, structure)]
    if late:
        best = min(late, key=lambda s: (bench.judged[s].cost, bench.judged[s].free, str(s)))
        tests[best] = _chances(yardstick, structure)
    compared = sorted(tests, key=lambda s: (bench.cost(s), str(s)))
    for i in range(0, len(compared), BUDGET.side_by_side):
        for j in bench.judge_all(compared[i : i + BUDGET.side_by_side]):
            if yardstick.better(j, own, tests[j.structure]):
                yield j.structure


def _compared(yardstick: Yardstick, structure: Structure) -> dict[Structure, int]:
    """Supermodels that are compared with the structure, each with the number of tests that its level is divided by."""
    more = one_larger(structure, yardstick.known)
    larger = [s for s in yardstick.known if s != structure and contains(s, structure)]
    if not larger:
        return {}
    far = min(larger, key=lambda s: (yardstick.bench.cost(s), yardstick.known[s].free))
    return dict.fromkeys(more, len({*more, far})) | ({} if far in more else {far: _chances(yardstick, structure)})


def _chances(yardstick: Yardstick, structure: Structure) -> int:
    """Bonferroni factor for comparing a structure with the best of all supermodels that are more than one step larger.

    By Wilks's theorem the largest supermodel alone would need no correction. But resonances and gaps have a place of
    their own, so that chance brings more.
    """
    more = len(one_larger(structure, yardstick.known))
    larger = sum(s != structure and contains(s, structure) for s in yardstick.known)
    return (more + 1) * (larger - more)
