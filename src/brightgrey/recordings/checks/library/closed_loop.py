"""Inputs that follow the noise of the sensor: recordings in closed loop."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.numerics.distributions import f as fisher
from brightgrey.recordings.checks.check import Check, CheckResult, note, passed
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.sample_values import is_constant


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    order: int = 12
    """Past samples from which input and output are predicted."""
    lags: int = 3
    """Samples after which a controller has answered."""
    level: float = 1e-3
    share: float = 0.02
    """Part of the input's innovations that the sensor's innovations have to explain."""
    most_samples: int = 50_000


POLICY = _Policy()


def run(examined: Examined) -> Iterator[CheckResult]:
    """Test if what is new in an output explains what is new in the input at the same sample and the next ones."""
    r = examined.recording
    if not examined.moves:
        return
    for signal, values in zip(r.outputs, r.y, strict=True):
        u, y = r.u[: POLICY.most_samples], values[: POLICY.most_samples]
        if is_constant(u) or is_constant(y) or u.size < 20 * POLICY.order:
            continue
        share, chance = _answer(u / np.std(u), y / np.std(y))
        figure = f"{100 * share:.1f} % of what is new in the input follow what is new in '{signal.name}'"
        threshold = f"{100 * POLICY.share:.0f} %, p < {POLICY.level:g}"
        if share > POLICY.share and chance < POLICY.level:
            yield note(
                figure,
                f"'{r.input.name}' answers to '{signal.name}': a recording in closed loop. The noise of the sensor is"
                " in the input, too, which lowers the parameters a little if it is large",
                threshold,
            )
        else:
            yield passed(figure, threshold)


def _answer(u: Array, y: Array) -> tuple[float, float]:
    """Return the part of the input's innovations that those of an output explain, and its probability by chance."""
    new_u, new_y = _innovations(u, y)
    lagged = np.column_stack([new_y[POLICY.lags - k : new_y.size - k] for k in range(POLICY.lags + 1)])
    target = new_u[POLICY.lags :]
    left = target - lagged @ np.linalg.lstsq(lagged, target, rcond=None)[0]
    rss, base = float(left @ left), max(float(target @ target), 1e-300)
    degrees = target.size - 3 * POLICY.order
    ratio = (base - rss) / (POLICY.lags + 1) / max(rss / degrees, 1e-300)
    return 1.0 - rss / base, float(fisher.sf(ratio, POLICY.lags + 1, degrees))


def _innovations(u: Array, y: Array) -> tuple[Array, Array]:
    """Return what the past of both does not tell of the input and of the output."""
    past = [x[POLICY.order - k : x.size - k] for x in (u, y) for k in range(1, POLICY.order + 1)]
    terms = np.column_stack([*past, np.ones(u.size - POLICY.order)])
    rests = [x - terms @ np.linalg.lstsq(terms, x, rcond=None)[0] for x in (u[POLICY.order :], y[POLICY.order :])]
    return rests[0], rests[1]


CHECK = Check("closed loop", "Does the input answer to the sensor?", run)
