"""Force balance of a drive: the input as the sum of inertia, friction, a spring and gravity.

It is the inverse dynamic model of robot identification (Gautier, Khalil 1988, doi:10.1109/CDC.1988.194724), smoothed
by one kernel on both sides. Elastic shafts and lags multiply both sides by polynomials of the derivative: terms of the
equation-error method (Young 1981, doi:10.1016/0005-1098(81)90082-0). Two versions are fitted: one with any
coefficients, one in which inertia, friction and spring are not negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.numerics.bounded_least_squares import bounded_least_squares
from brightgrey.recordings.checks.examined import Examined, SmoothedMotion
from brightgrey.recordings.checks.regression import Regression, independent_samples, regress
from brightgrey.recordings.units.parser import parse_unit
from brightgrey.recordings.units.signals import motion_unit

__all__ = ["ForceBalance", "balances", "most_explaining", "natural_misfit"]

NOT_NEGATIVE = ("inertia", "viscous friction", "Coulomb friction", "spring")


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    orders: tuple[int, ...] = (0, 4)
    """Derivatives of input and acceleration that are terms: none for a rigid drive; four are enough for two
    resonances, or for one and a lag."""
    least_travel: float = 1.0
    """Travel in rad from which gravity may depend on the angle."""
    reversal: float = 0.02
    """Width of the smoothed sign of the speed, as a part of the largest speed."""


POLICY = _Policy()


@dataclass(frozen=True)
class ForceBalance:
    """Terms of a force balance, and the regression of the input on them."""

    order: int  #: Derivatives of input and acceleration that are terms.
    names: tuple[str, ...]
    terms: Array  #: Shape (samples, terms).
    u: Array
    motion: SmoothedMotion
    regression: Regression

    def size(self, name: str) -> float:
        """Coefficient of a term, SI."""
        return float(self.regression.coefficients[self.names.index(name)])

    def deviations(self, name: str) -> float:
        """Coefficient of a term over its standard error."""
        return self.regression.deviations(self.names.index(name))


def balances(examined: Examined) -> list[ForceBalance]:
    """Balances of a rigid and of an elastic drive at all widths of smoothing; none if nothing moves with a sign."""
    examined = examined.coarse
    motions = examined.motions() if examined.moves else []
    return [_regress_input(examined, motion, order) for order in POLICY.orders for motion in motions]


def most_explaining(found: Sequence[ForceBalance]) -> ForceBalance:
    """The balance that explains most of the input, with its sign as it is or turned."""
    return min(found, key=lambda balance: min(natural_misfit(balance, sign)[0] for sign in (1.0, -1.0)))


def _regress_input(examined: Examined, motion: SmoothedMotion, order: int) -> ForceBalance:
    """Regress the input on what a drive would need for a motion."""
    largest = float(np.abs(motion.velocity).max()) or 1.0
    terms = {
        "inertia": motion.acceleration,
        "viscous friction": motion.velocity,
        "Coulomb friction": np.tanh(motion.velocity / (POLICY.reversal * largest)),
        "spring": motion.position - motion.position.mean(),
        "constant": np.ones(motion.u.size),
    }
    rotary = motion_unit(parse_unit(examined.recording.outputs[0].unit)) not in ("m", "mm")
    if rotary and np.ptp(motion.position) > POLICY.least_travel:
        terms |= {"sine": np.sin(motion.position), "cosine": np.cos(motion.position)}
    for k in range(1, order + 1):
        terms[f"derivative {k} of the input"], terms[f"derivative {k} of the acceleration"] = examined.higher(motion, k)
    matrix = np.column_stack(list(terms.values()))
    return ForceBalance(order, tuple(terms), matrix, motion.u, motion, regress(motion.u, matrix))


def natural_misfit(found: ForceBalance, sign: float) -> tuple[float, float]:
    """Misfit of a balance whose inertia, friction and spring are not negative, with the input times a sign.

    Returns
    -------
    misfit : float
        Sum of squares that is left, as a part of the input's about its mean.
    samples : float
        Independent samples of what is left.
    """
    scale = np.linalg.norm(found.terms, axis=0)
    terms = found.terms / np.where(scale > 0.0, scale, 1.0)
    low = np.array([0.0 if name in NOT_NEGATIVE else -np.inf for name in found.names])
    residual = sign * found.u - terms @ bounded_least_squares(terms, sign * found.u, low, np.full(low.size, np.inf))
    total = float(np.square(found.u - found.u.mean()).sum())
    return float(residual @ residual) / total if total > 0.0 else 1.0, independent_samples(residual)
