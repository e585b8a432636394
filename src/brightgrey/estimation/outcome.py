"""How a fit ended, as a value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from brightgrey.estimation.bounds import Search
from brightgrey.estimation.estimates import Estimate
from brightgrey.estimation.leastsquares import Descent
from brightgrey.estimation.uncertainty import weakest

__all__ = ["Outcome", "outcome_of"]

_BLIND = 1e7  # condition number from which a combination of parameters cannot be seen


@dataclass(frozen=True)
class Outcome:
    """How a fit ended: numerical failure is a value, with its text as the message."""

    kind: Literal["converged", "at bound", "evaluation limit", "diverged", "not identifiable"]
    text: str


def outcome_of(search: Search, best: Descent, estimates: Mapping[str, Estimate]) -> Outcome:
    """What there is to say about the end of the fit, the gravest first."""
    if not np.isfinite(best.cost) or (not np.any(best.jacobian) and search.names):
        return Outcome("diverged", "no parameter set gave a finite simulation that depends on the parameters")
    inside = [i for i, name in enumerate(search.names) if estimates[name].at_bound is None]
    condition, direction = weakest(best.jacobian[:, inside])
    if condition > _BLIND:
        involved = [search.names[i] for i, share in zip(inside, direction, strict=True) if abs(share) > 0.3]
        text = f"this recording cannot tell {' and '.join(involved)} apart"
        return Outcome("not identifiable", text if len(involved) > 1 else f"this recording does not show {involved[0]}")
    ran = [f"{name} at its {e.at_bound} bound" for name, e in estimates.items() if e.at_bound]
    if ran:
        return Outcome("at bound", ", ".join(ran))
    if not best.converged:
        return Outcome("evaluation limit", f"no optimum within {best.evaluations} batches of simulations")
    return Outcome("converged", "the cost has a minimum here, inside all bounds")
