"""All laws of the function set behind one number: compiled once for every structure."""

from __future__ import annotations

from typing import Any

from brightgrey.effects import Law, registry
from brightgrey.simulation.compiled import inner
from brightgrey.simulation.lanes import get, splat

__all__ = ["evaluate", "smooth_laws"]


def smooth_laws() -> tuple[Law, ...]:
    """Laws that the kernel solves for implicitly: one port, no straight line. The position is the law's number."""
    laws = (effect.law for effect in registry().values())
    return tuple(law for law in laws if law is not None and law.ports == 1 and not law.affine)


def _link(number: int, law: Law, rest: Any) -> Any:
    """Function that evaluates `law` for its number and asks `rest` for any other."""
    value = inner(law.value)
    count = len(law.parameters)

    if count == 1:

        def one(which: Any, p: Any, first: Any, who: Any, z: Any) -> Any:
            if which == number:
                phi, slopes = value((z,), (get(p, first, who),))
                return phi, slopes[0]
            return rest(which, p, first, who, z)

        return inner(one)
    if count == 2:

        def two(which: Any, p: Any, first: Any, who: Any, z: Any) -> Any:
            if which == number:
                phi, slopes = value((z,), (get(p, first, who), get(p, first + 1, who)))
                return phi, slopes[0]
            return rest(which, p, first, who, z)

        return inner(two)
    if count == 3:

        def three(which: Any, p: Any, first: Any, who: Any, z: Any) -> Any:
            if which == number:
                parameters = (get(p, first, who), get(p, first + 1, who), get(p, first + 2, who))
                phi, slopes = value((z,), parameters)
                return phi, slopes[0]
            return rest(which, p, first, who, z)

        return inner(three)

    def four(which: Any, p: Any, first: Any, who: Any, z: Any) -> Any:
        if which == number:
            pair = (get(p, first, who), get(p, first + 1, who))
            phi, slopes = value((z,), (*pair, get(p, first + 2, who), get(p, first + 3, who)))
            return phi, slopes[0]
        return rest(which, p, first, who, z)

    return inner(four)


@inner
def _none(which: Any, p: Any, first: Any, who: Any, z: Any) -> Any:
    return splat(0.0, who), splat(0.0, who)


def _chain() -> Any:
    function: Any = _none
    for number, law in enumerate(smooth_laws()):
        if not 1 <= len(law.parameters) <= 4:
            raise TypeError(f"law of {law.parameters}: the kernel takes one to four parameters")
        function = _link(number, law, function)
    return function


evaluate = _chain()
"""``evaluate(number, p, first, who, z) -> (phi, slope)``, parameters from row `first` of table `p` on."""
