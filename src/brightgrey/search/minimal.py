"""Minimal structures: nothing can be removed and nothing has to be added, neither without a significant loss."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence

import numpy as np

from brightgrey.kit import Structure
from brightgrey.search.comparison import Judged, threshold
from brightgrey.search.fitting import Fitted
from brightgrey.search.identification import ACCURACY, ROUGH
from brightgrey.search.lattice import contains, extensions, minimal, simpler
from brightgrey.search.yardstick import Yardstick

__all__ = ["minimal_structures"]

_SLACK = 1.02  # ratio of costs within which a structure is always looked at
_MOST = 24  # structures that are examined
_AT_ONCE = 2  # larger structures refitted side by side: what an inadequate one does not need is in vain
_RARE = 1e-3


def minimal_structures(yardstick: Yardstick, progress: Callable[[Structure], None] | None) -> list[Judged]:
    """Adequate structures that contain no other adequate one: hopeful ones first, until none is left to be examined."""
    n, bench = yardstick.independent, yardstick.bench
    accepted: list[Structure] = []
    examined: set[Structure] = set()
    while len(examined) < _MOST or not accepted:
        structure = _next(yardstick, n, accepted, examined)
        if structure is None:
            break
        examined.add(structure)
        if progress is not None:
            progress(structure)
        if not _beaten(yardstick, structure, accepted) and _adequate(yardstick, structure):
            accepted = _unbeaten(yardstick, [*accepted, structure])  # what contains one beaten may be examined again
    rejected = sorted(examined.difference(accepted), key=str)
    improved = [s for s in rejected if bench.improve(s)]
    accepted += [s for s in improved if _adequate(yardstick, s)]
    for s in accepted:  # grows meanwhile
        accepted += [small for small in _without_loss(yardstick, s) if small not in accepted]
    least = minimal(_unbeaten(yardstick, accepted))
    return sorted(map(bench.judge, least), key=yardstick.criterion)


def _beaten(yardstick: Yardstick, structure: Structure, others: Iterable[Structure]) -> bool:
    """Whether one of the others fits significantly better, though it need not contain the structure.

    By more than chance would give the best of all known ones if they did: for others no distribution is known.
    """
    own, tests = yardstick.bench.judge(structure), len(yardstick.known)
    return any(yardstick.better(yardstick.bench.judge(s), own, tests) for s in others if s != structure)


def _unbeaten(yardstick: Yardstick, structures: Sequence[Structure]) -> list[Structure]:
    return [s for s in structures if not _beaten(yardstick, s, structures)]


def _without_loss(yardstick: Yardstick, structure: Structure) -> list[Structure]:
    """Adequate structures that lack one effect, or one mass, of an adequate one; they are refitted from there."""
    found, bench = [], yardstick.bench
    smaller = simpler(structure, yardstick.known)
    bench.judge_all(smaller)
    for s in smaller:
        bench.improve(s)
        tests = len(extensions(s, yardstick.known))  # a short cut: what follows compares these two as well
        if not yardstick.better(bench.judge(structure), bench.judge(s), tests) and _adequate(yardstick, s):
            found.append(s)
    return found


def _next(
    yardstick: Yardstick, n: float, accepted: Sequence[Structure], examined: Collection[Structure]
) -> Structure | None:
    """Structure that may be adequate by all that is known now and contains none of those accepted.

    Of several the one with the least Bayesian information criterion, by the number of independent samples. The level of
    the search may be off by all that some leave: those come late.
    """
    rough = yardstick.doubt * (ROUGH / ACCURACY) ** 2
    cost = {s: max(yardstick.bench.cost(s), yardstick.doubt) + rough for s in yardstick.known}
    least = min(yardstick.known.values(), key=lambda f: (cost[f.structure], f.free))

    def close(f: Fitted) -> bool:
        more = max(least.free - f.free, 1)
        reach = float(np.exp(2.0 * threshold(more, _RARE) / n))
        return cost[f.structure] <= max(_SLACK, reach) * cost[least.structure]

    def doubtful(f: Fitted) -> bool:
        return f.cost <= rough

    left = [
        f
        for f in yardstick.known.values()
        if f.structure not in examined
        and (close(f) or doubtful(f))
        and not any(contains(f.structure, s) for s in accepted)
    ]

    def promise(f: Fitted) -> tuple[float, int]:
        return n * float(np.log(max(cost[f.structure], 1e-300))) + f.free * float(np.log(n)), f.free

    return min(left, key=promise).structure if left else None


def _adequate(yardstick: Yardstick, structure: Structure) -> bool:
    """Whether nothing that contains the structure fits significantly better."""
    own = yardstick.bench.judge(structure)
    more = extensions(structure, yardstick.known)
    larger = [s for s in yardstick.known if s != structure and contains(s, structure)]
    if not larger:
        return True
    far = min(larger, key=lambda s: (yardstick.bench.cost(s), yardstick.known[s].free))
    compared = sorted({*more, far}, key=lambda s: (yardstick.bench.cost(s), str(s)))
    tests = dict.fromkeys(compared, len(compared))
    # The best of all has the share of the chance of any of them. The largest alone needs no such division if its ratio
    # is distributed as Wilks says; with resonances and gaps, which have a place of their own, more comes by chance.
    if far not in more:
        tests[far] *= len(larger) - len(more)
    pairs = (yardstick.bench.judge_all(compared[i : i + _AT_ONCE]) for i in range(0, len(compared), _AT_ONCE))
    return not any(yardstick.better(j, own, tests[j.structure]) for pair in pairs for j in pair)
