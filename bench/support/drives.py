"""Simulated drives of the benchmarks: excitation, coloured noise, encoder, and the recordings made of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations

import numpy as np
from scipy.signal import lfilter

from brightgrey.arrays import Array
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import Placed, Structure, function_set, grammar_named
from brightgrey.recordings import Recording, Signal
from brightgrey.recordings.recording import Hold
from brightgrey.simulation.reference import reference

__all__ = [
    "MORE_MASSES",
    "MOTIONS",
    "SHARPNESS",
    "RandomDrive",
    "coloured_noise",
    "drawn_structure",
    "excitation",
    "largest_within",
    "lumped",
    "rounded",
    "simulated_recording",
]

MORE_MASSES = ("two_mass", "three_mass", "four_mass")
MOTIONS = ("reversing", "chirp", "multisine")
SHARPNESS = (np.inf, 1000.0, 100.0, 30.0)
"""Gains of friction's sign over the largest speed, in turn: an exact sign, and three smoothed ones."""
AR_POLE = 0.9
"""Pole of the first-order autoregression that half of the random drives have as noise."""


def excitation(motion: str, rng: np.random.Generator) -> Array:
    """Return a torque in N m as large as that of the paper's experiment and as long; `motion` is one of `MOTIONS`."""
    e = PAPER_EXPERIMENT
    paper = e.torque()
    peak, t = float(np.abs(paper).max()), e.dt * np.arange(e.samples)
    duration = e.samples * e.dt
    if motion == "reversing":
        return np.round(paper, 3)
    if motion == "chirp":  # logarithmic from 1 to 100 Hz
        rate = np.log(100.0) / duration
        u = np.sin(2.0 * np.pi * np.expm1(rate * t) / rate)
    else:  # the first 60 harmonics of the recording's length; lower ones are stronger, to reach about the same speed
        k = np.arange(1, 61)
        phase = rng.uniform(0.0, 2.0 * np.pi, k.size)
        u = np.sum(np.sin(2.0 * np.pi * k[:, None] * t / duration + phase[:, None]) / np.sqrt(k)[:, None], axis=0)
    ramp = np.minimum(1.0, t / 0.02)  # from rest
    return np.round(peak * ramp * u / np.abs(u).max(), 3)


def coloured_noise(count: int, pole: float, rng: np.random.Generator, settling: int = 200) -> Array:
    """Return noise of unit variance: white, or a first-order autoregression after `settling` samples."""
    white = rng.standard_normal(count + settling)
    return np.asarray(lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)[settling:])


def rounded(y: Array, step: float) -> Array:
    """Return `y` rounded to whole steps, as an encoder gives it."""
    return np.asarray(np.round(y / step) * step)


def simulated_recording(
    u: Array,
    y: Array,
    *,
    sensors: Sequence[str] = ("velocity",),
    name: str = "simulated",
    dt: float = PAPER_EXPERIMENT.dt,
    hold: Hold = "linear",
) -> Recording:
    """Return a recording of torque in N m, positions in rad and speeds in rad/s.

    `y` has shape (samples,) or (sensors, samples).
    """
    outputs = []
    for sensor in sensors:
        kind, _, mass = sensor.partition("@")
        outputs.append(
            Signal(sensor.replace("@", ""), kind, "rad" if kind == "position" else "rad/s", mass=int(mass or 1))
        )
    t = dt * np.arange(u.size)
    return Recording(name, t, u, np.atleast_2d(y), Signal("torque", "input", "N m"), tuple(outputs), hold=hold)


def last_places(chain: Placed) -> dict[str, int]:
    """Last place of an effect by where it stands."""
    return {"drive": 1, "mass": chain.effect.masses, "shaft": chain.effect.masses - 1}


def drawn_structure(rng: np.random.Generator) -> Structure:
    """Draw one to four masses with two to six effects of the function set `drive`.

    Kinds of effects are equally likely, and so are the places of each. What an effect requires is added.
    """
    grammar = grammar_named("drive").whole
    chains = [p for p in grammar.placed if p.effect.masses]
    while True:
        chain = chains[int(rng.integers(len(chains)))]
        last = last_places(chain)
        there = [p for p in grammar.placed if not p.effect.masses and p.place <= last[p.effect.where]]
        kinds = sorted({p.name for p in there})
        chosen = []
        for kind in rng.permutation(kinds)[: int(rng.integers(2, 7))]:
            places = [p for p in there if p.name == kind]
            chosen.append(places[int(rng.integers(len(places)))])
        chosen += [Placed(name, p.place) for p in chosen for name in p.effect.requires]
        structure = Structure((chain, *dict.fromkeys(chosen)))
        if 2 <= len(structure.beside) <= 6 and not grammar.broken_rule(structure):
            return structure


def lumped(structure: Structure, masses: int) -> Iterator[Structure]:
    """Structures with fewer masses that a structure may look like where some of its shafts are stiff.

    Neighbouring masses become one, which has the effects of all of them. The shafts between them vanish, with their
    gaps and hardening springs.
    """
    chain = next(p for p in function_set().whole.placed if p.effect.masses == masses)
    for cuts in combinations(range(1, structure.masses), masses - 1):  # shafts that stay
        group = {mass: 1 + sum(cut < mass for cut in cuts) for mass in range(1, structure.masses + 1)}
        shafts = {cut: 1 + i for i, cut in enumerate(cuts)}
        moved = []
        for p in structure.beside:
            place = {"drive": {1: 1}, "mass": group, "shaft": shafts}[p.effect.where].get(p.place)
            moved += [] if place is None else [Placed(p.name, place)]
        yield Structure((chain, *dict.fromkeys(moved)))


def largest_within(structure: Structure) -> list[Structure]:
    """Structures that lack one effect, with what requires it, or the last mass, with what stands there."""
    kit, found = function_set(), []
    for gone in structure.beside:
        kept = [p for p in structure.placed if p != gone]
        kept = [p for p in kept if not (gone.name in p.effect.requires and p.place == gone.place)]
        found.append(Structure(tuple(kept)))
    if structure.masses > 1:
        (chain,) = (p for p in grammar_named("drive").whole.placed if p.effect.masses == structure.masses - 1)
        last = last_places(chain)
        found.append(Structure((chain, *(p for p in structure.beside if p.place <= last[p.effect.where]))))
    return [s for s in dict.fromkeys(found) if not kit.broken_rule(s)]


class RandomDrive:
    """One random drive with two motions; `y` are its speeds without noise, each of shape (sensors, samples).

    The structure is drawn from `candidates`, or by `draw`, the values come from
    :func:`brightgrey.excitation.random_drives.random_values`. Half of the drives have noise of an autoregression with
    pole `AR_POLE`, a third of them an encoder. The gain of friction's sign is `f_tanh` in s/rad; by default it is one
    of `SHARPNESS` over the largest speed, in turn. A sensor is ``velocity``, ``velocity@2`` or ``speed@2``, the last
    one without sign.
    """

    def __init__(
        self,
        seed: int,
        number: int,
        candidates: Sequence[Structure] = (),
        f_tanh: float | None = None,
        draw: Callable[[np.random.Generator], Structure] | None = None,
        sensors: Sequence[str] = ("velocity",),
    ) -> None:
        rng = np.random.default_rng([seed, number])
        self.seed, self.number, self.sensors = seed, number, tuple(sensors)
        self.truth = draw(rng) if draw else candidates[int(rng.integers(len(candidates)))]
        self.values = random_values(self.truth.parameters, rng)
        self.motion = MOTIONS[number % 3]
        self.pole = AR_POLE if rng.random() < 0.5 else 0.0
        self.encoder = bool(rng.random() < 1.0 / 3.0)
        kinds = (self.motion, MOTIONS[(number + 1) % 3])
        self.u = [excitation(kind, rng) for kind in kinds]
        largest = float(np.abs(self._speeds(self.u[0], f_tanh or PAPER_EXPERIMENT.f_tanh)).max())
        self.f_tanh = f_tanh or SHARPNESS[number % len(SHARPNESS)] / largest
        self.sharpness = self.f_tanh * largest
        self.y = [self._speeds(u, self.f_tanh) for u in self.u]

    def _speeds(self, u: Array, f_tanh: float) -> Array:
        """Speeds without noise, shape (sensors, samples)."""
        masses = [sensor.partition("@")[2] or "1" for sensor in self.sensors]
        states = [f"v{mass}" for mass in masses]
        y = reference(str(self.truth), self.values, u, PAPER_EXPERIMENT.dt, f_tanh=f_tanh, outputs=states)
        unsigned = np.array([sensor.startswith("speed") for sensor in self.sensors])
        return np.where(unsigned[:, None], np.abs(y), y)

    def recordings(self, noise: float, draw: int = 0) -> list[Recording]:
        """Return a recording to identify from and one of another motion to test on.

        Parameters
        ----------
        noise : float
            Standard deviation of the noise over the peak of each speed in the first motion.
        draw : int
            Number of the noise: others have other noise of the same kind.
        """
        made, peaks = [], np.abs(self.y[0]).max(axis=1)
        rng = np.random.default_rng([self.seed, self.number, round(1e6 * noise), *([draw] if draw else [])])
        for name, u, speeds in zip(("train", "test"), self.u, self.y, strict=True):
            signals = []
            for v, peak in zip(speeds, peaks, strict=True):
                size = noise * float(peak)
                y = v + size * coloured_noise(v.size, self.pole, rng)
                if self.encoder:  # a step of a thousandth of the peak, or half of the noise
                    y = rounded(y, max(1e-3 * float(peak), 0.5 * size))
                signals.append(y)
            made.append(simulated_recording(u, np.array(signals), sensors=self.sensors, name=name))
        return made
