"""False alarms of symptoms, and the symptoms that are reported of drives that lack an effect.

    python bench/symptoms.py false --runs 60 --seed 101     true structures, coloured noise: false alarms
    python bench/symptoms.py missing --runs 8     fits that lack one effect or mass of the true structure

Data come from the reference solver. Descents begin at the truth (`false`): symptoms are tested, not the search. A fit
that ends with a residual larger than the noise by 1 % has missed the optimum all the same, and its symptoms are true;
it is left out and counted.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from brightgrey.estimation import fit
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER
from brightgrey.recordings import Recording
from brightgrey.simulation.reference import UnsettledError, reference
from support.drives import MOTIONS, coloured_noise, excitation, simulated_recording
from support.results import Table, arguments, publish
from support.statistics import share

POLES = (0.0, 0.5, 0.9, 0.95, 0.99)
NOISE = 0.01
LOST = 1.01
PEAK = "Peak in the residual"
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


def simulated(text: str, seed: int, pole: float) -> tuple[Recording, dict[str, float], float]:
    """Recording of a random drive, its values, and the RMS of its noise."""
    rng = np.random.default_rng([seed, round(100 * pole), TRUTHS.index(text) if text in TRUTHS else 99])
    values = random_values(PAPER.parse(text).parameters, rng)
    u = excitation(MOTIONS[seed % 3], rng)
    (v,) = reference(text, values, u, E.dt, f_tanh=E.f_tanh)
    noise = NOISE * np.abs(v).max() * coloured_noise(v.size, pole, rng)
    return simulated_recording(u, v + noise), values, float(noise.std())


def false_alarms(runs: int, seed: int) -> Table:
    rows = []
    for pole in POLES:
        patterns, peaks, fits, lost = 0, 0, 0, 0
        kinds: Counter[str] = Counter()
        for k in range(runs):
            text = TRUTHS[k % len(TRUTHS)]
            try:
                recording, values, noise = simulated(text, seed + k, pole)
            except UnsettledError:
                continue
            found = fit(
                PAPER.parse(text), [recording], f_tanh=E.f_tanh, start=values, starts=1, patience=0, initial="rest"
            )
            (output,) = found.train.values()
            if output.rmse > LOST * noise:
                lost += 1
                continue
            titles = [s.title for s in found.symptoms if "is negligible" not in s.title and "mass" not in s.title]
            fits += 1
            peaks += PEAK in titles
            hits = [title for title in titles if title != PEAK]
            patterns += bool(hits)
            kinds.update(hits[:1])
        first = ", ".join(f"{title} {count}" for title, count in kinds.most_common())
        rows.append([f"{pole:g}", f"{fits} ({lost})", share(patterns, fits), share(peaks, fits), first])
        print(*rows[-1], sep="; ", flush=True)
    return Table("False alarms", ["AR pole", "fits (left out)", "pattern", "peak", "first patterns"], rows)


def missing(runs: int, seed: int) -> Table:
    rows = []
    for truth, text in MISSING:
        reported: Counter[str] = Counter()
        drives = 0
        for k in range(runs):
            try:
                recording, _, _ = simulated(truth, seed + k, (0.0, 0.9)[k % 2])
            except UnsettledError:
                continue
            found = fit(PAPER.parse(text), [recording], f_tanh=E.f_tanh, starts=4, patience=0, initial="rest")
            reported.update([s.title for s in found.symptoms] or ["nothing"])
            drives += 1
        titles = ", ".join(f"{title} {count}" for title, count in reported.most_common())
        rows.append([f"`{truth}`", f"`{text}`", str(drives), titles])
        print(*rows[-1], sep="; ", flush=True)
    return Table("Symptoms of fits that lack something", ["truth", "fitted as", "drives", "symptoms"], rows)


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("what", choices=("false", "missing"))
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    table = (false_alarms if given.what == "false" else missing)(given.runs, given.seed)
    publish("symptoms", [table], to_file=given.save)


if __name__ == "__main__":
    main()
