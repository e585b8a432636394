"""Torque that grows with the time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brightgrey.recordings.checks.check import Check, CheckResult, note, passed
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.checks.force_balance import ForceBalance, balances
from brightgrey.recordings.checks.regression import Regression, regress


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    clear: float = 5.0
    """Standard errors from which a drift is no chance."""
    matters: float = 0.02
    """Drift from the first to the last sample, as a part of the input's standard deviation, that matters."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Regress the input on the force balance and the time.

    A spring is no term at first: where a position goes one way, its force is that of a drift.
    """
    if not (found := balances(examined)):
        return
    fit = _clearest([_with_time(each, without="spring") for each in found])
    signal = examined.recording.input
    size, error = (float(x[-1]) * signal.factor for x in (fit.coefficients, fit.std))
    figure = f"'{signal.name}' drifts by {size:.3g} ± {2 * error:.2g} {signal.unit}"
    threshold = f"{POLICY.clear:g} standard errors, {100 * POLICY.matters:g} % of the standard deviation"
    large = abs(size) > POLICY.matters * float(np.std(examined.recording.u)) * signal.factor
    if large and abs(size) > POLICY.clear * error:
        spring = abs(_clearest([_with_time(each) for each in found]).deviations(-1)) < POLICY.clear
        with_what = ", with the time or with the position," if spring else ","
        yield note(
            figure,
            f"the torque that the motion needs drifts by {size:.3g} {signal.unit} over the recording{with_what} as"
            " friction does while a drive warms up: let it warm up first, or use a part by --window",
            threshold,
        )
    else:
        yield passed(figure, threshold)


def _with_time(found: ForceBalance, without: str = "") -> Regression:
    """Balance with the time as the last term, one from the first sample to the last, and without one of the others."""
    time = (found.motion.t - found.motion.t.mean()) / max(float(np.ptp(found.motion.t)), 1e-300)
    kept = [name != without for name in found.names]
    return regress(found.u, np.column_stack([found.terms[:, kept], time]))


def _clearest(fits: list[Regression]) -> Regression:
    """Return the balance in which the drift has the smallest standard error."""
    return min(fits, key=lambda fit: fit.std[-1])


CHECK = Check("drift", "Does the torque that the motion needs stay the same?", run)
