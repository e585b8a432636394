"""How a search grows: fits, time and memory over the number of effects that may be there.

    python bench/growth.py [--atoms 8 12 16 20 24] [--save]

The function set is the paper's with friction and gravity at every mass and a gap in every shaft, in this order. The
drive has three effects that the paper's function set lacks. Its recording is as long as the demo's, with 0.2 % noise.
The kernel itself simulates it at level `accurate`, because the reference solver knows the paper's places only.
"""

from __future__ import annotations

import resource
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from brightgrey.estimation import predict
from brightgrey.estimation.problem.scales import scales
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER, Grammar, Structure
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.search.decision import decide_structures
from brightgrey.search.lattice import Lattice
from brightgrey.search.task import IdentificationTask
from brightgrey.simulation import Settings
from support.drives import excitation, simulated_recording
from support.results import Table, arguments, publish

TRUTH = "two_mass+coulomb+viscous+coulomb@2+viscous@2+gravity@2"
VALUES = {
    "J1": 0.012,
    "J2": 0.008,
    "c1": 60.0,
    "d1": 0.03,
    "M_C": 0.5,
    "f_v": 0.01,
    "M_C@2": 0.6,
    "f_v@2": 0.02,
    "M_G@2": 0.5,
}
FURTHER = (
    *(("coulomb", 2), ("viscous", 2), ("gravity", 2), ("stribeck", 2), ("backlash", 2)),
    *(("coulomb", 3), ("viscous", 3), ("gravity", 3), ("stribeck", 3), ("backlash", 3)),
    *(("coulomb", 4), ("viscous", 4), ("gravity", 4), ("stribeck", 4)),
)
STATES = ("q1", "q2", "v1", "v2")
NOISE = 2e-3


def function_set(atoms: int) -> Grammar:
    """The paper's effects and as many further places as make so many atoms; the paper has 10."""
    places = {name: list(at) for name, at in PAPER.places.items()}
    for name, place in FURTHER[: atoms - 10]:
        places[name].append(place)
    return Grammar(f"{atoms} atoms", {name: tuple(at) for name, at in places.items()})


def main() -> None:
    limit_blas_threads()
    parser = arguments(__doc__)
    parser.add_argument("--atoms", type=int, nargs="*", default=[13, 16, 20, 24])
    options = parser.parse_args()
    e, rng = PAPER_EXPERIMENT, np.random.default_rng(7)
    u = excitation("reversing", rng)
    truth = Structure.parse(TRUTH)
    bare = simulated_recording(u, np.zeros(u.size))
    v = predict(truth, VALUES, bare, Settings(e.f_tanh, e.speed, "accurate"), dict.fromkeys(STATES, 0.0))[0]
    y = v + NOISE * float(np.abs(v).max()) * rng.standard_normal(v.size)
    recording = simulated_recording(u, np.round(y, 4))
    known = scales([recording])
    task = IdentificationTask((recording,), known, Settings(e.f_tanh, known.speed, "fast"))
    rows = []
    for atoms in options.atoms:
        grammar = function_set(atoms)
        began, cpu = time.perf_counter(), time.process_time()
        with ThreadPoolExecutor(2) as workers:
            found = decide_structures(task, grammar, executor=workers)
        wall, cpu = time.perf_counter() - began, time.process_time() - cpu
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        minimal = [r.structure for r in found.evidence.minimal]
        needed = [c.effect for c in found.evidence.cards if c.verdict == "needed"]
        true = sum(m == truth for m in minimal)
        rows.append(
            [
                str(atoms),
                f"{Lattice.of(grammar).size:,}",
                str(found.evidence.certificate.fitted),
                f"{wall:.0f}",
                f"{cpu:.0f}",
                f"{memory:.0f}",
                f"{len(minimal)}{', the truth among them' if true else ''}",
                ", ".join(needed),
            ]
        )
        print(rows[-1], minimal, flush=True)
    header = ["atoms", "structures", "fits", "wall s", "CPU s", "memory MB", "minimal structures", "needed"]
    publish("growth", [Table(f"Effects that may be there; the drive is `{TRUTH}`", header, rows)], to_file=options.save)


if __name__ == "__main__":
    main()
