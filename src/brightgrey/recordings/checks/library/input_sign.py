"""Sign of the input: does a positive torque accelerate the motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brightgrey.numerics.distributions import norm
from brightgrey.recordings.checks.check import Check, CheckResult, passed, stop
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.checks.force_balance import ForceBalance, balances, most_explaining, natural_misfit


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    level: float = 1e-3
    """Probability of the test by chance."""
    explained: float = 0.5
    """Part of the input that the balance with the sign turned has to explain."""
    reverses: float = 0.02
    """Part of the largest speed from which a speed of the other sign counts as motion."""


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Compare force balances of the input as it is and with its sign turned, of a rigid drive and of an elastic one."""
    if not (found := balances(examined)):
        return
    by_order = [[b for b in found if b.order == order] for order in sorted({b.order for b in found})]
    best = [most_explaining(each) for each in by_order]
    tests = [_compare_signs(each) for each in best]
    clearest = max(tests, key=lambda test: abs(test.ratio))
    figure = (
        f"as it is {100 * (1 - clearest.as_it_is):.0f} %, turned {100 * (1 - clearest.turned):.0f} % of the input are"
        " explained"
    )
    threshold = f"p < {POLICY.level:g}"
    critical = -2.0 * np.log(POLICY.level)
    seems_turned = (
        clearest.turned < 1.0 - POLICY.explained
        and clearest.ratio > critical
        and all(t.ratio > -critical for t in tests)
    )
    if seems_turned and not any(map(_shows_sign, best)):
        yield passed("the speed keeps its sign, and its changes do not tell the sign of the input", threshold)
    elif seems_turned:
        yield stop(
            figure,
            f"a positive '{examined.recording.input.name}' slows the motion down: turn its sign, --input-gain -1 (times"
            " the gain that was given)",
            threshold,
            input_gain=-1.0,
        )
    else:
        yield passed(figure, threshold)


@dataclass(frozen=True)
class _Comparison:
    as_it_is: float  #: Part of the input that is not explained.
    turned: float  #: The same of the input with its sign turned.
    ratio: float  #: Twice the logarithm of the likelihood ratio of two models that do not contain each other.


def _compare_signs(found: ForceBalance) -> _Comparison:
    (as_it_is, few), (turned, many) = natural_misfit(found, 1.0), natural_misfit(found, -1.0)
    samples = many if turned < as_it_is else few
    return _Comparison(as_it_is, turned, samples * float(np.log(max(as_it_is, 1e-12) / max(turned, 1e-12))))


def _shows_sign(found: ForceBalance) -> bool:
    """True if a balance of the wrong sign means that the sign is wrong.

    While the speed keeps its sign, friction that falls with speed looks like friction of the wrong sign. Then only an
    inertia tells that is clearly negative.
    """
    v = found.motion.velocity
    if min(v.max(), -v.min()) > POLICY.reverses * float(np.abs(v).max()):
        return True
    return bool(found.deviations("inertia") < -norm.isf(POLICY.level))


CHECK = Check("sign of the input", "Does a positive input accelerate the motion?", run)
