"""Second opinion on a fit: the balance of torques, regressed on the measured motion without a simulation.

A drive whose shafts are stiff at slow motion is one rigid inertia there. Its torque is the inertia times the
acceleration and the torques of its effects, which follow from the measured motion. Smoothed by one kernel, both sides
are compared by linear regression, as the inverse dynamic model of robot identification (Gautier, Khalil 1988,
doi:10.1109/CDC.1988.194724). Each term of the fit gets a factor, which should be 1. Simulation error and equation error
fail in different ways. A term that is false in the simulation may still fit well, but seldom has it the same sign in
the balance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from brightgrey.arrays import Array
from brightgrey.estimation.diagnostics.finding import Finding
from brightgrey.estimation.optimisation.options import TORQUE_REGRESSION_DEFAULTS
from brightgrey.estimation.problem.torque_balance import inertias, lags_of, rigid_torque, sizes_of, torque_kinds
from brightgrey.kit import Placed, Structure, slowest_resonance
from brightgrey.kit.in_words import effect_in_words
from brightgrey.recordings import Recording
from brightgrey.recordings.checks.examined import Examined
from brightgrey.recordings.checks.regression import regress
from brightgrey.recordings.units.signals import KINDS

__all__ = ["TermOpinion", "contradictions", "second_opinion"]


@dataclass(frozen=True)
class _Policy:
    """Numbers of this module."""

    lags: float = 2.0
    """Least width of the kernel over the lag of the input: the shift by the lag is an approximation."""
    interval: float = 1.96
    """Standard errors in half of a 95 % interval."""
    notable: float = 0.1
    """Part of a size below which a difference does not matter: friction and sensors are not known better."""
    contradiction: float = 5.0
    """Standard errors by which a factor is below zero to contradict the fit: model error counts, too."""
    least_samples: int = 40
    """Samples over the width of the kernel that a recording has to have: a dozen independent ones."""
    least_slow: float = 0.1
    """Part of the torque's RMS about its mean that is left after smoothing: else resonances leak through the kernel."""
    least_share: float = 1e-6
    """Torque of an effect, as a part of the input's RMS, below which it is left out."""


POLICY = _Policy()


@dataclass(frozen=True)
class TermOpinion:
    """A term of the torque balance: as the simulation has fitted it, and as the regression has it."""

    effects: tuple[Placed, ...]  #: Of one kind, at one or more masses; the masses themselves for the inertia.
    parameters: tuple[str, ...]  #: Their sizes, which add up.
    fitted: float  #: Sum of the sizes in the fit, SI.
    regressed: float  #: The same by regression, SI.
    std: float  #: Its standard error, SI.

    @property
    def half_width(self) -> float:
        """Half of the 95 % interval of the regression, SI."""
        return POLICY.interval * self.std

    @property
    def is_open(self) -> bool:
        """True if the regression does not tell the term from zero."""
        return abs(self.regressed) < self.half_width

    @property
    def differs(self) -> bool:
        """True if fit and regression differ by more than the regression's 95 % interval and a tenth of the fit."""
        apart = abs(self.regressed - self.fitted)
        return apart > max(self.half_width, POLICY.notable * abs(self.fitted))

    @property
    def contradicts(self) -> bool:
        """True if the regression gives the other sign beyond doubt."""
        return bool(self.regressed * np.sign(self.fitted) < -POLICY.contradiction * self.std)


@dataclass(frozen=True)
class _Motion:
    """Motion of a rigid drive by the first output, and its input; not thinned, shape (samples,) each."""

    position: Array
    velocity: Array
    u: Array
    examined: Examined
    first_width: float  #: Standard deviation of the kernel that has smoothed it, in samples.


def second_opinion(
    structure: Structure, values: Mapping[str, float], recordings: Sequence[Recording], f_tanh: float
) -> tuple[TermOpinion, ...]:
    """Regress the input on the torques of a fit.

    Parameters
    ----------
    structure : Structure
    values : mapping of str to float
        All parameters of the fit, SI.
    recordings : sequence of Recording
    f_tanh : float
        Gain of the sign of friction in s/rad (s/m).

    Returns
    -------
    tuple of TermOpinion
        Inertia first. Empty if the first output has no sign, is an acceleration or is not at the driven mass, if the
        recordings are too short for the slowest resonance, or if the motion below it does not even show the inertia.
    """
    groups = torque_kinds(structure)
    columns: list[list[Array]] = []
    input_torque: list[Array] = []
    for recording in recordings:
        motion = _motion(recording, _input_lag(structure, values))
        if motion is None:
            return ()
        width = _width(structure, values, motion)
        if motion.u.size < POLICY.least_samples * width:
            return ()
        smooth, thin = motion.examined.smooth, slice(None, None, max(1, int(width / 2.0)))
        if smooth(motion.u, width).std() < POLICY.least_slow * motion.u.std():
            return ()
        lanes = {name: np.full(motion.velocity.size, value) for name, value in values.items()}
        torques = [rigid_torque(structure, g, lanes, motion.position, motion.velocity, f_tanh) for g in groups]
        inertia = sum(values[name] for name in inertias(structure))
        rows = [inertia * smooth(motion.velocity, width, 1), *(-smooth(torque, width) for torque in torques)]
        columns.append([row[thin] for row in rows])
        input_torque.append(smooth(motion.u, width)[thin])
    u = np.concatenate(input_torque)
    terms = np.array([np.concatenate(parts) for parts in zip(*columns, strict=True)])
    known = np.sqrt(np.mean(np.square(terms), axis=1)) > POLICY.least_share * float(np.sqrt(np.mean(np.square(u))))
    found = regress(u, terms[known].T)
    factors = iter(zip(found.coefficients.tolist(), found.std.tolist(), strict=True))
    masses = tuple(p for p in structure.placed if p.effect.masses)
    sizes = [(masses, inertias(structure)), *((group, sizes_of(group)) for group in groups)]
    out = []
    for (effects, names), is_known in zip(sizes, known.tolist(), strict=True):
        if is_known:
            factor, std = next(factors)
            total = sum(values[name] for name in names)
            out.append(TermOpinion(effects, names, total, factor * total, std * abs(total)))
    return () if not out or out[0].is_open else tuple(out)


def contradictions(opinions: Sequence[TermOpinion]) -> list[Finding]:
    """Findings on terms whose sign the regression contradicts."""
    return [
        Finding(
            "contradicted",
            f"the balance of torques without a simulation gives {effect_in_words(o.effects[0])} the opposite sign, "
            f"{abs(o.regressed / o.std):.0f} standard errors from zero: the model explains with it what is something "
            "else",
            o.parameters,
        )
        for o in opinions
        if o.contradicts
    ]


def _input_lag(structure: Structure, values: Mapping[str, float]) -> float:
    """Total lag of the input in s."""
    return sum(values[name] for name in lags_of(structure))


def _motion(recording: Recording, lag: float) -> _Motion | None:
    """Motion smoothed as little as the noise of its velocity allows, and the input shifted by its lag."""
    signal = recording.outputs[0]
    order = KINDS[signal.kind]
    examined = Examined(recording)
    if order > 1 or signal.kind == "speed" or signal.mass != recording.input.mass or not examined.moves:
        return None
    y, noise = recording.y[0], examined.noise[0]
    width = next((w for w in examined.widths if order or examined.is_clean(y, noise, w)), examined.widths[-1])
    position = y if order == 0 else np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1])) * recording.dt])
    delayed = np.interp(recording.t - lag, recording.t, recording.u)
    smooth = examined.smooth
    velocity = smooth(y, width, 1 - order)
    return _Motion(smooth(position, width), velocity, smooth(delayed, width), examined, width)


def _width(structure: Structure, values: Mapping[str, float], motion: _Motion) -> float:
    """Width of the kernel in samples: above it the drive is rigid, and its acceleration free of noise."""
    examined = motion.examined
    period = 2.0 * np.pi / max(slowest_resonance(structure, values), 1e-300)
    without_resonance = TORQUE_REGRESSION_DEFAULTS.smoothing * period / examined.dt
    least = (2.0, POLICY.lags * _input_lag(structure, values) / examined.dt, without_resonance)
    order = KINDS[examined.recording.outputs[0].kind]
    noise = examined.noise[0] * (1.0 if order else 0.5 / (motion.first_width**1.5 * examined.dt))
    wide = (w for w in examined.widths if examined.is_clean(motion.velocity, noise, w))
    return max(*least, next(wide, examined.widths[-1]))
