"""How often a symptom is told where there is none, and what is told of drives that lack something.

    python bench/symptoms.py false --runs 200     true structures, coloured noise: false alarms
    python bench/symptoms.py missing --runs 20    fits that lack one effect or mass of the true structure

Data come from the reference solver. Descents begin at the truth (`false`): symptoms are tested, not the search. Fits
that end with a residual larger than the noise by 1 % have missed the optimum all the same, and what they are told is
true; they are left out and counted.
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np

from brightgrey.estimation import fit
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER
from brightgrey.paper.repetitions import wilson_interval
from brightgrey.recordings import Recording, Signal
from brightgrey.simulation.reference import UnsettledError, reference
from recovery import coloured, torque

POLES = (0.0, 0.5, 0.9, 0.95, 0.99)
NOISE = 0.01
LOST = 1.01
TRUTHS = (
    "one_mass+coulomb+viscous",
    "one_mass+viscous+gravity+delay",
    "two_mass+coulomb+viscous",
    "two_mass+coulomb+viscous+stribeck+current_control",
    "three_mass+viscous+gravity",
)
MISSING = (
    ("one_mass+coulomb+viscous", "one_mass+viscous"),
    ("one_mass+coulomb+viscous", "one_mass+coulomb"),
    ("one_mass+coulomb+viscous+stribeck", "one_mass+coulomb+viscous"),
    ("one_mass+coulomb+viscous+gravity", "one_mass+coulomb+viscous"),
    ("one_mass+coulomb+viscous+delay", "one_mass+coulomb+viscous"),
    ("two_mass+coulomb+viscous", "one_mass+coulomb+viscous"),
    ("three_mass+coulomb+viscous", "two_mass+coulomb+viscous"),
    ("three_mass+coulomb+viscous", "two_mass+coulomb+viscous+delay"),
)


def made(text: str, seed: int, pole: float) -> tuple[Recording, dict[str, float], float]:
    """Recording of a random drive, its values, and the RMS of its noise."""
    rng = np.random.default_rng([seed, round(100 * pole), TRUTHS.index(text) if text in TRUTHS else 99])
    values = random_values(PAPER.parse(text).parameters, rng)
    u = torque(("reversing", "chirp", "multisine")[seed % 3], rng)
    (v,) = reference(text, values, u, E.dt, f_tanh=E.f_tanh)
    noise = NOISE * np.abs(v).max() * coloured(v.size, pole, rng)
    outputs = (Signal("velocity", "velocity", "rad/s"),)
    signal = Signal("torque", "input", "N m")
    return (
        Recording("made", E.dt * np.arange(v.size), u, (v + noise)[None], signal, outputs),
        values,
        float(noise.std()),
    )


def false_alarms(runs: int, seed: int) -> None:
    print("| AR pole | fits (left out) | pattern told | peak told | patterns |\n|---|---|---|---|---|")
    for pole in POLES:
        patterns, peaks, fits, lost, what = 0, 0, 0, 0, Counter()
        for k in range(runs):
            text = TRUTHS[k % len(TRUTHS)]
            try:
                recording, values, noise = made(text, seed + k, pole)
            except UnsettledError:
                continue
            found = fit(
                PAPER.parse(text), [recording], f_tanh=E.f_tanh, start=values, starts=1, patience=0, initial="rest"
            )
            (output,) = found.train.values()
            if output.rmse > LOST * noise:
                lost += 1
                continue
            told = [s.title for s in found.symptoms if "faded" not in s.title and "mass" not in s.title]
            fits += 1
            peaks += "Peak in the residual" in told
            hits = [t for t in told if t != "Peak in the residual"]
            patterns += bool(hits)
            what.update(hits[:1])
        low, high = wilson_interval(patterns, fits)
        lower, upper = wilson_interval(peaks, fits)
        print(
            f"| {pole:g} | {fits} ({lost}) | {patterns} ({100 * low:.1f} to {100 * high:.1f} %) | {peaks}"
            f" ({100 * lower:.1f} to {100 * upper:.1f} %) | {dict(what)} |",
            flush=True,
        )


def missing(runs: int, seed: int) -> None:
    for truth, text in MISSING:
        first, done, where = Counter(), 0, []
        for k in range(runs):
            try:
                recording, _, _ = made(truth, seed + k, (0.0, 0.9)[k % 2])
            except UnsettledError:
                continue
            found = fit(PAPER.parse(text), [recording], f_tanh=E.f_tanh, starts=4, patience=0, initial="rest")
            first.update(s.title for s in found.symptoms)
            if not found.symptoms:
                first.update(["nothing"])
            where += [s.seen for s in found.symptoms if "peak" in s.seen]
            done += 1
        print(f"{truth} fitted as {text}, {done} drives: {dict(first.most_common())}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("false", "missing"))
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    (false_alarms if given.what == "false" else missing)(given.runs, given.seed)


if __name__ == "__main__":
    main()
