"""Two outputs of one motion: the factor between them, and which of them comes later."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.numerics.digital_filter import lfilter
from brightgrey.recordings.checks.check import Check, CheckResult, mind, note, passed, stop
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.checks.regression import regress, regress_whitened
from brightgrey.recordings.sample_values import is_constant
from brightgrey.recordings.units.signals import KINDS

KNOWN = {
    180.0 / np.pi: "a unit in degrees taken for radians",
    np.pi / 180.0: "a unit in radians taken for degrees",
    30.0 / np.pi: "rpm taken for rad/s",
    np.pi / 30.0: "rad/s taken for rpm",
    60.0: "a time in minutes",
    1.0 / 60.0: "a time in minutes",
    2.0 * np.pi: "turns taken for radians",
    0.5 / np.pi: "radians taken for turns",
    1000.0: "a factor of 1000 between units",
    1e-3: "a factor of 1000 between units",
}
"""Factors that come from units, by what they are."""


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    clear: float = 3.0
    """Standard errors from which a difference is no chance (0.3 %)."""
    small: float = 0.01
    """Deviation of the factor that calibration explains."""
    large: float = 0.1
    """Deviation of the factor from which the outputs contradict each other."""
    late: float = 0.1
    """Delay in sampling intervals from which it matters."""
    of_difference: float = 0.5
    """Part of the difference of two outputs that a delay has to explain."""


POLICY = _Policy()


@dataclass(frozen=True)
class _Pair:
    """Two outputs of one motion: the factor between them, and how much later the second is."""

    names: tuple[str, str]
    factor: float
    factor_error: float
    delay: float  #: s.
    delay_error: float
    explained: float  #: Part of one output that the other explains.
    of_difference: float  #: Part of their difference that the delay explains.
    same_mass: bool


def run(examined: Examined) -> Iterator[CheckResult]:
    """Compare every later output with the first one."""
    r = examined.recording
    for k in range(1, len(r.outputs)):
        if is_constant(r.y[0]) or is_constant(r.y[k]) or "speed" in (r.outputs[0].kind, r.outputs[k].kind):
            continue
        pair = _compare(examined, k)
        factor = _say_factor(pair)
        yield factor
        if factor.grade in ("passed", "note"):
            yield _say_delay(examined, pair)


def _compare(examined: Examined, k: int) -> _Pair:
    """Regress the output of the lower order of derivative on the other one and its slope.

    Both go through a low-pass filter whose derivative needs no differences. Its time is the ratio of the two noises, so
    that what is left is white, and the estimate of the delay is efficient.
    """
    r, dt = examined.recording, examined.dt
    orders = KINDS[r.outputs[0].kind], KINDS[r.outputs[k].kind]
    signals, noise = (r.y[0], r.y[k]), (examined.noise[0], examined.noise[k])
    high = 0 if orders[0] > orders[1] else 1
    target, reference = signals[1 - high], signals[high]
    gap = orders[high] - orders[1 - high]
    begun = np.ones((r.samples, 1))  # the filter begins with a wrong state, from which it decays
    time = float(np.clip((noise[1 - high] / noise[high]) ** (1.0 / max(gap, 1)), 4.0 * dt, r.samples * dt))
    if gap:
        for _ in range(gap):
            target, filtered = (target - _low_pass(target, time, dt)) / time, _low_pass(reference, time, dt)
            slope, reference = (reference - filtered) / time, filtered
        after = np.arange(r.samples) * dt / time
        begun = np.column_stack([np.ones(r.samples), *(after**n * np.exp(-after) for n in range(gap))])
    else:
        width = next((w for w in examined.widths if examined.is_clean(r.y[k], noise[1], w)), examined.widths[-1])
        slope = examined.smooth(reference, width, 1)
        target, reference = examined.smooth(target, width), examined.smooth(reference, width)
    terms = np.column_stack([reference, slope, begun[: target.size]])
    plain, level = regress(target, terms), regress(target, np.delete(terms, 1, axis=1))
    fit = regress_whitened(target, terms) if gap else plain  # whitened, a smoothed slope would be noise
    (a, b), (a_error, b_error) = fit.coefficients[:2].tolist(), fit.std[:2].tolist()
    a = a or 1e-300
    return _Pair(
        (r.outputs[0].name, r.outputs[k].name),
        factor=1.0 / a if high == 1 else a,
        factor_error=a_error / a**2 if high == 1 else a_error,
        delay=b / a if high == 1 else -b / a,
        delay_error=b_error / abs(a),
        explained=plain.explained,
        of_difference=1.0
        - float(plain.residual @ plain.residual) / max(float(level.residual @ level.residual), 1e-300),
        same_mass=r.outputs[0].mass == r.outputs[k].mass,
    )


def _low_pass(x: Array, time: float, dt: float) -> Array:
    """Filter 1 / (1 + s T) by the trapezoidal rule, begun at the first sample."""
    a = 2.0 * time / dt
    return np.asarray(x[0] + lfilter([1.0 / (1.0 + a), 1.0 / (1.0 + a)], [1.0, (1.0 - a) / (1.0 + a)], x - x[0]))


def _say_factor(pair: _Pair) -> CheckResult:
    """Say if the second output contradicts the first."""
    first, second = pair.names
    figure = f"'{second}' is {pair.factor:.4g} ± {2 * pair.factor_error:.1g} times what '{first}' says"
    threshold = f"{POLICY.clear:g} standard errors, and {100 * POLICY.large:.0f} %"
    off = abs(pair.factor - 1.0)
    if pair.explained < POLICY.of_difference:
        return mind(figure, f"'{second}' does not follow '{first}': name outputs of one axis", threshold)
    if off < max(POLICY.clear * pair.factor_error, POLICY.small):
        return passed(figure, threshold)
    if off < POLICY.large:
        return note(
            figure,
            f"'{second}' and '{first}' differ by {100 * (pair.factor - 1.0):.1f} %: one of their units or gear ratios"
            " is not exact",
            threshold,
        )
    near = next((what for value, what in KNOWN.items() if abs(abs(pair.factor) / value - 1.0) < POLICY.small), "")
    turned = pair.factor < 0.0 and abs(pair.factor + 1.0) < POLICY.large
    cause = "its sign is turned" if turned else near or "a gear ratio or a unit"
    gear = f"{second}={1.0 / pair.factor:.6g}"
    return stop(
        figure,
        f"'{second}' contradicts '{first}' ({cause}): give its unit by --unit, or --gear '{gear}'",
        threshold,
        gear=[gear],
    )


def _say_delay(examined: Examined, pair: _Pair) -> CheckResult:
    """Say if the second output is late, and not twisted against the first by an elastic shaft."""
    first, second = pair.names
    figure = f"'{second}' comes {1e3 * pair.delay:.3g} ± {2e3 * pair.delay_error:.1g} ms after '{first}'"
    threshold = f"{POLICY.clear:g} standard errors, {POLICY.late:g} samples"
    clear = abs(pair.delay) > max(POLICY.clear * pair.delay_error, POLICY.late * examined.dt)
    if not clear or (pair.of_difference < POLICY.of_difference and not pair.same_mass):
        return passed(figure, threshold)
    earlier, later = (first, second) if pair.delay > 0.0 else (second, first)
    elastic = "" if pair.same_mass else ", and no elasticity"
    return mind(
        figure,
        f"'{later}' comes {1e3 * abs(pair.delay):.3g} ms after '{earlier}': a skew of clocks or a filter{elastic}. Take"
        f" it back by --shift '{later}={-abs(pair.delay):.3g}'",
        threshold,
        shift=[f"{later}={-abs(pair.delay):.3g}"],
    )


CHECK = Check("outputs", "Do two outputs say the same of one motion, at one time?", run)
