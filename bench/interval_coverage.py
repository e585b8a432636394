"""Coverage of the 95 % intervals, for white and for coloured noise, by family of parameters.

Random drives of several structures, their motion by the reference solver, noise of 0.3 % of the peak (white, or a
first-order autoregression of the same size), speeds rounded to 0.01 rad/s. The descents start at the truth and end at
the optimum beside it: it is the interval that is tested here, not the search. Parameters at a bound or declared not
identifiable are left out, as are fits that did not converge; they are counted.

    python bench/interval_coverage.py [--truths 10] [--draws 10] [--skip 0] [--structures 5] [--seed 1]
    python bench/interval_coverage.py --sensor position
"""

from __future__ import annotations

import argparse
import collections

import numpy as np

from brightgrey.estimation.optimisation.least_squares import fit_to_convergence
from brightgrey.estimation.problem.parameter_space import parameter_space
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.estimation.uncertainty.estimates import estimates_of
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.excitation.random_drives import random_values
from brightgrey.kit import PAPER
from brightgrey.numerics.proportions import wilson_interval
from brightgrey.recordings import Recording
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference
from support.drives import coloured_noise, simulated_recording
from support.results import Table, arguments, publish

STRUCTURES = (
    "one_mass+coulomb+viscous+gravity",
    "one_mass+coulomb+viscous+stribeck+delay",
    "two_mass+coulomb+viscous",
    "two_mass+coulomb+viscous+stribeck",
    "two_mass+coulomb+viscous+backlash+current_control",
)
POLES = (0.0, 0.5, 0.9, 0.95)
NOISE = 3e-3
FAMILIES = {
    "inertia": ("J1", "J2"),
    "shaft": ("c1", "d1"),
    "friction": ("M_C", "f_v", "M_S", "omega_S"),
    "gravity": ("M_G",),
    "gap": ("alpha",),
    "lag": ("T_1", "T_d"),
}


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--truths", type=int, default=10, help="drives per structure")
    parser.add_argument("--draws", type=int, default=10, help="draws of noise per drive and kind of noise")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--structures", type=int, default=len(STRUCTURES), help="only the first so many")
    parser.add_argument("--sensor", choices=("velocity", "position"), default="velocity")
    parser.add_argument("--skip", type=int, default=0, help="leave out the first so many structures")
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    counts: dict[tuple[float, str], collections.Counter[str]] = collections.defaultdict(collections.Counter)
    e = PAPER_EXPERIMENT
    for text in STRUCTURES[options.skip : options.structures]:
        for _ in range(options.truths):
            truth = random_values(PAPER.parse(text).parameters, rng)
            clean = reference(text, truth, e.torque(), e.dt, f_tanh=e.f_tanh, outputs=(options.sensor,))
            for pole in POLES:
                for _ in range(options.draws):
                    r = noisy(clean.reshape(-1), options.sensor, pole, rng)
                    tally(counts, text, truth, r, pole)
    publish("coverage", tables(counts, options), to_file=options.save)


def noisy(clean: np.ndarray, sensor: str, pole: float, rng: np.random.Generator) -> Recording:
    """Recording with noise whose size does not depend on its colour."""
    y = clean + NOISE * np.abs(clean).max() * coloured_noise(len(clean), pole, rng, settling=500)
    return simulated_recording(
        PAPER_EXPERIMENT.torque(), np.round(y, 2) if sensor == "velocity" else y, sensors=[sensor]
    )


def tally(counts: dict, text: str, truth: dict[str, float], r: Recording, pole: float) -> None:
    """Fit from the truth and count which intervals hold it."""
    structure = PAPER.parse(text)
    wide = {n: (v / 100, v * 100) if structure.parameters[n].scale == "log" else (-8.0, 8.0) for n, v in truth.items()}
    wide |= {"T_d": (0.0, 0.18)} if "T_d" in truth else {}
    settings = Settings(PAPER_EXPERIMENT.f_tanh, PAPER_EXPERIMENT.speed)
    problem = SimulationErrorProblem.of(structure, [r])
    search = parameter_space(structure, scales(r), wide, {}, problem.nuisances)
    start = truth | {nuisance.name: nuisance.start for nuisance in problem.nuisances}
    found = fit_to_convergence(problem, search, settings, np.array([start[n] for n in search.names]))
    estimates = estimates_of(problem, search, settings, found)
    hidden = {search.names[i] for direction in estimates.unidentifiable for i in direction.indices}
    for family, names in FAMILIES.items():
        for name in names:
            if name not in truth:
                continue
            e, count = estimates.by_name[name], counts[pole, family]
            count["all"] += 1
            if found.converged and not e.at_bound and name not in hidden:
                low, high = e.ci95
                count["judged"] += 1
                count["held"] += low <= truth[name] <= high
    counts[pole, "fits"]["judged" if found.converged else "not converged"] += 1


def tables(counts: dict, options: argparse.Namespace) -> list[Table]:
    """Shares of intervals that hold the truth, and how many fits and parameters were left out."""
    covered, left_out = [], []
    for pole in POLES:
        families = [counts[pole, family] for family in FAMILIES]
        total = sum(families, collections.Counter())
        fits = counts[pole, "fits"]
        covered.append([f"{pole:g}", *(cell(count) for count in (*families, total))])
        left_out.append(
            [f"{pole:g}", *(str(n) for n in (fits["judged"], fits["not converged"], total["all"] - total["judged"]))]
        )
    asked = STRUCTURES[options.skip : options.structures]
    gaps = ["backlash" in text for text in asked]
    kind = "all structures" if any(gaps) and not all(gaps) else f"structures with{'' if any(gaps) else 'out'} a gap"
    kind += ", a position measured" if options.sensor == "position" else ""
    columns = ["AR pole", "fits judged", "fits not converged", "parameters left out"]
    return [
        Table(f"Intervals that hold the truth in %, {kind}", ["AR pole", *FAMILIES, "all"], covered),
        Table(f"Left out, {kind}", columns, left_out),
    ]


def cell(count: collections.Counter[str]) -> str:
    if not count["judged"]:
        return "–"
    low, high = (100 * limit for limit in wilson_interval(count["held"], count["judged"]))
    return f"{100 * count['held'] / count['judged']:.1f} ({low:.1f}–{high:.1f}), n {count['judged']}"


if __name__ == "__main__":
    main()
