"""Make the demo recording that ships with the package: python tools/make_demo_recording.py.

The paper's experiment (brightgrey.excitation.PAPER_EXPERIMENT), solved by the reference solver. The paper has
no noise; a recording without any would flatter every result, so velocity gets a modest one: white, standard
deviation 0.1 % of the peak, then rounding to 0.01 rad/s, which is a quarter of it. The torque is rounded to
0.001 N m before it is applied, so that the file holds exactly what drove the drive. Same seed, same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.simulation.reference import reference

NOISE = 1e-3
SEED = 20
TARGET = Path(__file__).parents[1] / "src/brightgrey/excitation/data/demo.csv"


def main() -> None:
    """Write the file."""
    e = PAPER_EXPERIMENT
    torque = np.round(e.torque(), 3) + 0.0  # no minus zero
    (velocity,) = reference(e.structure, e.values, torque, e.dt, f_tanh=e.f_tanh, method="fixed")
    noise = NOISE * np.max(np.abs(velocity)) * np.random.default_rng(SEED).standard_normal(e.samples)
    measured = np.round(velocity + noise, 2) + 0.0
    rows = (f"{k * e.dt:.3f},{torque[k]:.3f},{measured[k]:.2f}\n" for k in range(e.samples))
    TARGET.write_text("t,torque,velocity\n" + "".join(rows), encoding="utf-8")
    print(f"{TARGET.name}: {e.samples} samples, peak {np.max(np.abs(velocity)):.3f} rad/s")


if __name__ == "__main__":
    main()
