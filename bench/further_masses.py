"""How much do further masses explain by chance? Rows of bench/recovery.py with noise, of drives that were found.

    python bench/further_masses.py --seeds 220

The true structure is compared with the best fit that has as many masses as it, one more, and so on: the excess of its
deviance, or of that of a structure within it, against chi-squared with as many degrees of freedom as the largest
structure has parameters more. Left out are drives whose fit is worse than the true values: there an optimum was missed.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import stats

from brightgrey.kit import PAPER, Structure
from brightgrey.search.adequacy import Round
from brightgrey.search.fitting.anchors import largest_by_masses
from brightgrey.search.lattice import Lattice
from recovery import REACHED, covered_if_lumped
from support.results import RESULTS, Table, arguments, publish
from support.rows import read_rows
from support.statistics import share_of

LEVELS = (0.1, 0.02, 0.005, 0.001)


def free(structure: Structure) -> int:
    """Number of estimated parameters, with the width of friction's reversal."""
    return len(structure.parameters) + any(p.effect.law for p in structure.placed)


LATTICE = Lattice.of(PAPER)
MOST = {s.masses: free(s) for s in largest_by_masses(LATTICE)}
RULE = Round(LATTICE, 1, MOST, 0.0)


def excesses(row: Mapping) -> dict[int, float]:
    """Excess of the true structure over the best fit, by masses."""
    known = {int(masses): excess for masses, excess in row["excess_by_masses"].items()}
    return {masses: max(excess, 0.0) for masses, excess in known.items() if np.isfinite(excess)}


def probability(row: Mapping, further: int) -> float | None:
    """Probability of so large an excess by chance, if the resonances lay at known frequencies; None without a fit."""
    truth = PAPER.parse(row["truth"])
    masses = truth.masses + further
    excess = excesses(row).get(masses)
    return None if excess is None else float(stats.chi2.sf(excess, max(MOST[masses] - free(truth), 1)))


def is_refuted(row: Mapping) -> bool:
    """True if the rule rejects the true structure, and nothing within it is minimal."""
    truth = PAPER.parse(row["truth"])
    found = excesses(row).items()
    rejected = any(excess > RULE.chance_beyond(free(truth), truth.masses, masses) for masses, excess in found)
    return rejected and not covered_if_lumped(row)


def table(rows: list[dict]) -> Table:
    """Shares of the drives in which the truth would be refuted at several levels, and by the rule."""
    lines = []
    for kind, some in (
        ("white", [r for r in rows if r["pole"] == 0.0]),
        ("coloured", [r for r in rows if r["pole"] > 0.0]),
    ):
        for further in range(4):
            found = [p for r in some if (p := probability(r, further)) is not None]
            lines.append([kind, str(further), *(share_of([p < level for p in found], 1) for level in LEVELS)])
        lines.append([kind, "refuted by the rule", share_of([is_refuted(r) for r in some], 1), *[""] * 3])
    return Table("Chance of an excess", ["noise", "further masses", *(f"below {100 * a:g} %" for a in LEVELS)], lines)


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[220])
    options = parser.parse_args()
    rows = [r for seed in options.seeds for r in read_rows(RESULTS / f"recovery_seed{seed}.jsonl.gz")]
    known = [r for r in rows if r["noise"] > 0.0 and "excess_by_masses" in r and r["reached"] <= REACHED]
    if not known:
        raise SystemExit(f"no rows with noise and `excess_by_masses` of seeds {options.seeds}")
    publish("further-masses", [table(known)], to_file=options.save)


if __name__ == "__main__":
    main()
