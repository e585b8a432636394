"""Minimal structures: nothing can be removed and nothing has to be added, neither without a significant loss."""

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
    """Adequate structures that contain no other adequate one: hopeful ones first, until none is left to be examined.

    They fit equally well, so that the fewest masses come first, and of these the best criterion.

    A refit may show that what was accepted is not adequate, or what was rejected is: all is asked again then, and what
    contains a structure that was driven out is looked at.
    """
    bench = yardstick.bench
    looked: list[Structure] = []  # at, be it as a smaller one of those accepted
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
    """Those accepted and, if it is adequate and none of them fits better, the structure; without what it beats."""
    if _beaten(yardstick, structure, accepted) or not _adequate(yardstick, structure, rivals):
        return list(accepted)
    return [*(s for s in accepted if not _beaten(yardstick, s, [structure])), structure]


def _beaten(yardstick: Yardstick, structure: Structure, others: Iterable[Structure]) -> bool:
    """Whether one of the others fits significantly better, though it need not contain the structure.

    By more than chance would give the best of all known ones if they did: for others no distribution is known.
    """
    own, tests = yardstick.bench.judge(structure), len(yardstick.known)
    return any(yardstick.better(yardstick.bench.judge(s), own, tests) for s in others)


def _without_loss(yardstick: Yardstick, structure: Structure, rivals: Rivals) -> list[Structure]:
    """Adequate structures that lack one effect, or one mass, of an adequate one; they are refitted from there.

    Of one that could do without what it lacks, but not without another effect, the one that has that.
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
    """`small` if it is adequate; else what it is beaten by, and that is adequate and does not contain `big`, if any."""
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
    """Whether a structure fits significantly worse than one that has an effect, or a mass, more.

    Its optimum may be elsewhere, as with a light mass between two others: before what it lacks is called for, that is
    sought from everywhere.
    """
    bench, tests = yardstick.bench, len(one_larger(small, yardstick.known))  # a short cut: more are compared later
    while yardstick.better(bench.judge(big), bench.judge(small), tests):
        fields = _fields(yardstick, small, big) - bench.sought.get(small, 0)
        if fields <= 0 or bench.vain >= BUDGET.max_fruitless_restarts:
            return True
        bench.seek(small, min(fields, BUDGET.side_by_side))
    return False


def _fields(yardstick: Yardstick, small: Structure, big: Structure) -> int:
    """From how many fields of starts an optimum is sought; if much is between the two, only for masses without gaps."""
    left, least = (yardstick.left(yardstick.bench.judge(s)) for s in (small, big))
    if left <= BUDGET.small_difference * least:
        return BUDGET.restarts_costly if small.has_hard_limit else BUDGET.restarts
    return BUDGET.restarts_costly if small.masses < big.masses and not small.has_hard_limit else 0


def _next(yardstick: Yardstick, accepted: Sequence[Structure], looked: Collection[Structure]) -> Structure | None:
    """Structure that may be adequate by all that is known now and contains none of those accepted.

    Of several the one with the least Bayesian information criterion, by the number of independent samples. The level of
    the search may be off by all that some leave: a refit decides.
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
    """Whether nothing that contains the structure fits significantly better."""
    return next(_better_than(yardstick, structure, rivals), None) is None


def _better_than(yardstick: Yardstick, structure: Structure, rivals: Rivals) -> Iterator[Structure]:
    """What contains the structure and fits significantly better, the best first, refitted as it is asked for.

    Whom it was compared with stays the same when it is asked again: that takes no further refits. What else has been
    refitted meanwhile counts, too.
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
    """What contains the structure and is compared with it, and among how many others each counts for its chance."""
    more = one_larger(structure, yardstick.known)
    larger = [s for s in yardstick.known if s != structure and contains(s, structure)]
    if not larger:
        return {}
    far = min(larger, key=lambda s: (yardstick.bench.cost(s), yardstick.known[s].free))
    return dict.fromkeys(more, len({*more, far})) | ({} if far in more else {far: _chances(yardstick, structure)})


def _chances(yardstick: Yardstick, structure: Structure) -> int:
    """Among how many tests that counts with what contains the structure and is the best of all beyond one effect more.

    It has the share of the chance of any of them. The largest alone needs no such division if its ratio is distributed
    as Wilks says; with resonances and gaps, which have a place of their own, more comes by chance.
    """
    more = len(one_larger(structure, yardstick.known))
    larger = sum(s != structure and contains(s, structure) for s in yardstick.known)
    return (more + 1) * (larger - more)
