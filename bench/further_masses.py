"""How much do further masses explain by chance? Rows of bench/recovery.py with noise, of drives that were found.

    python bench/further_masses.py --seeds 216 218

The true structure is compared with the best fit that has as many masses as it, one more, and so on: the excess of its
deviance, or of that of a structure within it, against chi-squared with as many degrees of freedom as the largest
structure has parameters more. Left out are drives whose fit is worse than the true values: there an optimum was missed.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from brightgrey.kit import PAPER, Structure
from recovery import REACHED
from support.results import RESULTS, Table, arguments, publish
from support.rows import read_rows
from support.statistics import share

LEVELS = (0.1, 0.02, 0.005, 0.001)


def probability(row: dict, further: int) -> float | None:
    """Probability of so large an excess by chance, if the resonances lay at known frequencies; None without a fit."""
    truth: Structure = PAPER.parse(row["truth"])
    masses = truth.masses + further
    excess = row["excess_by_masses"].get(str(masses))
    if excess is None or not np.isfinite(excess):
        return None
    most = max(len(s.parameters) for s in PAPER.structures() if s.masses == masses)
    return float(stats.chi2.sf(max(excess, 0.0), max(most - len(truth.parameters), 1)))


def table(rows: list[dict]) -> Table:
    """Shares of the drives in which the truth would be refuted at several levels."""
    lines = []
    for further in range(4):
        for coloured in (False, True):
            some = [r for r in rows if (r["pole"] > 0.0) == coloured]
            found = [p for r in some if (p := probability(r, further)) is not None]
            if found:
                kind = "coloured" if coloured else "white"
                lines.append([str(further), kind, *(share(sum(p < a for p in found), len(found), 1) for a in LEVELS)])
    return Table("Chance of an excess", ["further masses", "noise", *(f"below {100 * a:g} %" for a in LEVELS)], lines)


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[216])
    options = parser.parse_args()
    rows = [r for seed in options.seeds for r in read_rows(RESULTS / f"recovery_seed{seed}.jsonl.gz")]
    known = [r for r in rows if r["noise"] > 0.0 and "excess_by_masses" in r and r["reached"] <= REACHED]
    publish("further-masses", [table(known)], to_file=options.save)


if __name__ == "__main__":
    main()
