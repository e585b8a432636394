"""Does the tool find the true structure? Random drives of the paper's grammar, all candidates fitted and weighed.

    python bench/recovery.py run 0 50 --seed 18 --noise 0.01    drives 0 to 49, added to the file of the seed
    python bench/recovery.py run 0 50 --noise 0.01 --masses 2 --without backlash delay --out small.jsonl.gz
    python bench/recovery.py run 0 50 --seed 41 --noise 0.01 --grammar drive --out drive.jsonl.gz
    python bench/recovery.py run 0 50 --seed 75 --noise 0.01 --grammar drive --truths drive
    python bench/recovery.py run 0 100 --seed 83 --noise 0.01 --grammar drive --sensors velocity velocity@2
    python bench/recovery.py run 0 60 --seed 84 --noise 0.01 --grammar drive --sensors speed@2
    python bench/recovery.py table --seed 18
    python bench/recovery.py table --seed 105 --with-seeds 106 107    rows of several seeds together

A drive is known by its number: true structure (of the candidates), values over wide ranges
(`brightgrey.excitation.random_drives`), motion (reversing, chirp, multisine, in turn), sharpness of friction's sign
(exact, or a gain of 1,000, 100 or 30 over the largest speed, in turn), colour of the noise, encoder or not. Drives with
a sensor at mass 2 have two masses, and half of them a gap. Data come from the reference solver. `--noise` is the
standard deviation over the peak speed.

Rows are kept in bench/results/recovery_seed<seed>.jsonl.gz; `run` skips those that the file already holds, so that
several processes may add to one file. Held-out error is that on another motion of the same drive with the same noise.
An effect matters if removing it alone from the true structure and fitting anew raises that error by more than 5 %
(noise counts as at least 1e-4 of the standard deviation, or nothing but rounding would be left to compare with).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from brightgrey.api.to_si import identification_task
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.kit import GRAMMARS, PAPER, Grammar, Placed, Structure, function_set, grammar_named
from brightgrey.recordings import Recording
from brightgrey.runs.blas_threads import limit_blas_threads
from brightgrey.search.decision import Decision, decide_structures
from brightgrey.search.fitting.fit_table import FitTable
from brightgrey.search.fitting.structure_fit import StructureFit
from brightgrey.search.lattice import added_effects, contains, has
from brightgrey.search.task import IdentificationTask
from support.drives import RandomDrive, drawn_structure, largest_within, lumped
from support.results import RESULTS, Table, code_version, publish
from support.rows import add_rows, read_rows, row_arguments
from support.statistics import share_of

MATTERS = 1.05
GAP_ERROR = 0.05
REACHED = 1.02  # times the RSS at the true values
FLOOR = 1e-4


def held_out(
    task: IdentificationTask, fitted: Mapping[Structure, StructureFit], test: Recording
) -> dict[Structure, float]:
    """Mean squared error of every structure on another recording, with the floor."""
    other = replace(task, recordings=(test,))
    floor = (FLOOR * float(test.y.std())) ** 2
    found = {}
    for s, f in fitted.items():
        values = {name: np.array([v]) for name, v in {**task.default_start(s), **f.values}.items()}
        problem = SimulationErrorProblem.of(s, other.recordings, initial="rest")
        cost = float(problem.costs(values, other.settings)[0])
        found[s] = cost / problem.weights[0] ** 2 / test.samples + floor
    return found


def visible(structure: Structure, truth: Structure, optional: Iterable[str]) -> bool:
    """Return True if `structure` is within the truth, and everything that it lacks is optional."""
    if not contains(truth, structure):
        return False
    missing = {str(p) for p in truth.placed if not p.effect.masses} - set(structure.names)
    return missing | masses_beyond(structure, truth) <= set(optional)


def masses_beyond(structure: Structure, truth: Structure) -> set[str]:
    """Names of the multiple-mass systems from one mass more than a structure has up to those of the truth."""
    return {str(p) for p in PAPER.placed if structure.masses < p.effect.masses <= truth.masses}


def visible_if_lumped(structure: Structure, truth: Structure, optional: Iterable[str]) -> bool:
    """The same, where masses of the truth that a stiff shaft joins may be one mass of the structure.

    What stands in such a shaft does not show either.
    """
    known = set(optional)
    masses = masses_beyond(structure, truth)
    return any(
        structure.beside <= smaller.beside and {str(p) for p in smaller.beside - structure.beside} | masses <= known
        for smaller in (lumped(truth, structure.masses) if structure.masses <= truth.masses else ())
    )


def is_there(effect: str, row: Mapping) -> bool:
    """Return True if the truth has an effect, or what contains it, or may have it where some of its masses are one."""
    truth, masses = function_set().parse(row["truth"]), function_set().parse(row["minimal"][0]).masses
    alike = lumped(truth, masses) if masses < truth.masses else ()
    asked, found = Placed.parse(effect).name, function_set().parse(row["minimal"][0])
    containing = [p for p in truth.placed if asked in p.effect.contains and p not in found.placed]
    return bool(containing) or any(has(s, effect) for s in (truth, *alike))


def examine(
    drive: RandomDrive, noise: float, pool: ThreadPoolExecutor, how: str, grammar: Grammar
) -> dict[str, object]:
    """One row of the file."""
    train, test = drive.recordings(noise)
    task = identification_task([train], None, {}, {}, None)
    begin = time.process_time()
    found = decide_structures(task, grammar, how=how, seed=drive.seed, executor=pool)
    seconds = time.process_time() - begin
    return row(drive, noise, task, found, test, pool) | {
        "seconds": round(seconds, 1),
        "how": how,
        "grammar": grammar.name,
        "offered": list(found.evidence.certificate.offered),
        "unexplained": list(found.evidence.certificate.unexplained),
        "held_back": dict(found.evidence.certificate.held_back),
    }


def row(
    drive: RandomDrive,
    noise: float,
    task: IdentificationTask,
    decision: Decision,
    test: Recording,
    pool: ThreadPoolExecutor,
) -> dict[str, object]:
    """One row of the file: everything that is kept of one drive at one noise."""
    truth, found = drive.truth, decision.evidence
    task = task.with_friction_of(*(f.values for f in decision.fitted.values()))
    undecided = [*found.optional, *(e for e, said in found.certificate.held_back.items() if said == "not decidable")]
    structures = [r.structure for r in found.minimal]
    smaller = [s for s in largest_within(truth) if s.masses >= max(signal.mass for signal in test.outputs)]
    by_multistart = [truth, *(s for s in smaller if s.masses < truth.masses)]
    fits = FitTable(task, (), seed=drive.seed, anchors=by_multistart)
    fits.done.update(decision.fitted)
    fits.add([truth, *smaller], pool)
    error = held_out(task, {s: fits.done[s] for s in (truth, *smaller)}, test)
    first = (
        "truth" if structures[0] == truth else "visible" if visible(structures[0], truth, found.optional) else "other"
    )
    matters = losses(truth, {s: float(np.sqrt(error[s] / error[truth])) for s in smaller})
    problem = task.problem(truth)
    exact = {name: np.array([value]) for name, value in drive.values.items()}
    exact |= {part.name: np.clip([0.0], part.low, part.high) for part in problem.unknown_initial}
    if problem.friction_width is not None:
        width = problem.friction_width
        exact[width.name] = np.clip([1.0 / drive.f_tanh], width.low if np.isfinite(drive.f_tanh) else 0.0, width.high)
    inside = min((r.deviance for m, r in found.refined.items() if contains(truth, m)), default=np.inf)
    ahead = {n: [r.deviance for m, r in found.refined.items() if m.masses <= n] for n in range(truth.masses, 5)}
    return {
        "code": code_version(),
        "seed": drive.seed,
        "number": drive.number,
        "noise": noise,
        "truth": str(truth),
        "motion": drive.motion,
        "pole": drive.pole,
        "encoder": drive.encoder,
        "sharpness": round(drive.sharpness) if np.isfinite(drive.sharpness) else "exact",
        "values": drive.values,
        "fits": len(decision.fitted),
        "reached": fits.done[truth].cost / max(float(problem.costs(exact, task.settings)[0]), 1e-300),
        "excess": inside - min(r.deviance for r in found.refined.values()),
        "excess_by_masses": {n: inside - min(deviances, default=np.inf) for n, deviances in ahead.items()},
        "minimal": [str(s) for s in structures],
        "estimates": dict(found.minimal[0].values),
        "sensors": list(drive.sensors),
        "optional": list(found.optional),
        "verdicts": {c.effect: c.verdict for c in found.cards},
        "reasons": {c.effect: c.reason for c in found.cards},
        "one_of_several": [c.effect for c in (*found.cards, *found.held_back) if c.why.kind == "one of several"],
        "matters": matters,
        "covered": any(visible(s, truth, undecided) for s in structures),
        "first": {"evidence": first},
        "unexplained": list(found.certificate.unexplained),
        "refuted": [[list(r.without), r.excess, r.threshold, r.agreeing] for r in found.certificate.refuted],
    }


def losses(truth: Structure, ratios: Mapping[Structure, float]) -> dict[str, float]:
    """By effect: the ratio of the structure that lacks it, and as little else as possible.

    A gap in the last shaft is also gone with the last mass. That says nothing about the gap.
    """
    ordered = sorted(ratios, key=lambda s: len(added_effects(truth, s)), reverse=True)
    return {name: ratios[s] for s in ordered for name in added_effects(truth, s)}


def marks(r: Mapping) -> list[str]:
    """Everything that is wrong with a row."""
    wrong = [e for e, v in r["verdicts"].items() if v == "needed" and not is_there(e, r)]
    lost = [e for e, v in r["verdicts"].items() if v == "not needed" and r["matters"].get(e, 0.0) > MATTERS]
    trifles = "LACKS WHAT DOES NOT MATTER" if covered_but_for_trifles(r) else "NOT COVERED"
    missed = [] if covered_if_lumped(r) else [trifles]
    return missed + [f"NEEDED BUT ABSENT {e}" for e in wrong] + [f"NOT NEEDED BUT MATTERS {e}" for e in lost]


def line(r: Mapping) -> str:
    """One drive in words."""
    kind = f"{r['motion']}{' coloured' if r['pole'] else ''}{' encoder' if r['encoder'] else ''}"
    return (
        f"{r['number']:4d} {r['noise']:5g} {r['truth']} ({kind}) {r['seconds']} s, {r['fits']} fits,"
        f" reached {r.get('reached', np.nan):.4g}:"
        f" {len(r['minimal'])} minimal, first {r['first']['evidence'] if 'first' in r else '?'} {', '.join(marks(r))}"
    )


def tables(rows: Sequence[Mapping]) -> list[Table]:
    """Shares of all rows by noise: of the structures, and of the verdicts for every effect."""
    columns = columns_of(rows)
    asked: dict[str, Callable[[Sequence[Mapping]], str]] = {
        "a minimal structure ⊆ truth ⊆ it ∪ optional": lambda some: share_of([r["covered"] for r in some], 1),
        "... or so if masses on stiff shafts count as one": lambda some: share_of(
            [covered_if_lumped(r) for r in some], 1
        ),
        "... or all it lacks does not matter": lambda some: share_of([covered_but_for_trifles(r) for r in some], 1),
        "minimal structures, median (most)": lambda some: sizes([len(r["minimal"]) for r in some]),
        "optimum of the truth reached": lambda some: share_of([r["reached"] <= REACHED for r in some]),
        "effects called *needed* that are there": lambda some: share_of(flat(by_effect(some, "needed")), 1),
        "effects that matter called *needed*": lambda some: share_of(flat(by_effect(some, "matters")), 1),
        "... or said to be one of several of which one is needed": lambda some: share_of(
            flat(by_effect(some, "one of several")), 1
        ),
        "effects that matter called *not needed*": lambda some: share_of(flat(by_effect(some, "not needed")), 1),
        "minimal structures, mean": lambda some: f"{np.mean([len(r['minimal']) for r in some]):.1f}",
        "optional effects, mean": lambda some: f"{np.mean([len(r['optional']) for r in some]):.1f}",
        "CPU seconds, mean (95 %)": lambda some: (
            f"{np.mean(cpu_seconds(some)):.0f} ({np.quantile(cpu_seconds(some), 0.95):.0f})"
        ),
        "gaps that are found within 5 %": lambda some: share_of(
            [abs(r["estimates"].get("alpha", 0.0) / r["values"]["alpha"] - 1.0) < GAP_ERROR for r in gaps_in(some)], 1
        ),
        "truth first by evidence": lambda some: share_of([r["first"]["evidence"] == "truth" for r in some]),
    }
    if "reached" not in rows[0]:  # rows of the code before: nothing but what it said is known
        del asked["optimum of the truth reached"], asked["truth first by evidence"]
    for name in reversed(rows[0].get("first", ())):
        asked[f"truth or its visible part first by {name}"] = lambda some, name=name: share_of(
            [r["first"][name] != "other" for r in some]
        )
    cells = {"rows": [str(len(some)) for some in columns.values()]}
    cells["drives"] = [str(len({(r["seed"], r["number"]) for r in some})) for some in columns.values()]
    cells["rows with a gap"] = [
        str(sum(has(function_set().parse(r["truth"]), "backlash") for r in some)) for some in columns.values()
    ]
    cells |= {what: [cell(some) for some in columns.values()] for what, cell in asked.items()}
    made = [Table(title_of(rows), ["", *columns], [[what, *shares] for what, shares in cells.items()])]
    for title, hits in (
        ("Effects called *needed*: is there", lambda some: by_effect(some, "needed")),
        ("Effects that are there: called *needed*", recalled),
        ("Effects that matter: called *not needed*", lambda some: by_effect(some, "not needed")),
    ):
        found = [hits(some) for some in columns.values()]
        shares = [[f"`{e}`", *(share_of(one.get(e, [])) for one in found)] for e in rows[0]["verdicts"]]
        made.append(Table(title + title_of(rows).removeprefix("Structures"), ["", *columns], shares))
    return made


def gaps_in(rows: Sequence[Mapping]) -> list[Mapping]:
    """Rows of drives with a gap that matters and two sensors, one on each of its sides."""
    return [
        r
        for r in rows
        if len(r.get("sensors", ())) > 1 and "alpha" in r["values"] and r["matters"].get("backlash", 0.0) > MATTERS
    ]


def title_of(rows: Sequence[Mapping]) -> str:
    """Title of the table: where the sharpness of friction differs, rows of one seed and one noise are asked for it."""
    sharpness, seeds, noises = ({r.get(key) for r in rows} for key in ("sharpness", "seed", "noise"))
    if len(sharpness) == 1:
        return "Structures"
    shown = [", ".join(f"{100 * n:g} %" for n in sorted(noises)), ", ".join(map(str, sorted(seeds)))]
    fixed = "".join(f", gain fixed at {gain}" for gain in sorted({r["fixed_gain"] for r in rows if "fixed_gain" in r}))
    return f"Structures, by the sharpness of friction (seed {shown[1]}, {shown[0]} noise{fixed})"


def columns_of(rows: Sequence[Mapping]) -> dict[str, Sequence[Mapping]]:
    """Rows by noise, and by the sharpness of friction's sign, if there are several; and all."""
    found: dict[str, Sequence[Mapping]] = {}
    for key, title in (("noise", lambda n: f"{100 * n:g} %"), ("sharpness", str)):
        kinds = sorted({r.get(key) for r in rows} - {None}, key=lambda kind: -np.inf if kind == "exact" else kind)
        if len(kinds) > 1:
            found |= {title(kind): [r for r in rows if r.get(key) == kind] for kind in kinds}
    return found | {"all": rows}


def table(paths: Sequence[Path], *, to_file: bool) -> None:
    """Print everything that was collected, and every row with something wrong."""
    rows = [row for path in paths for row in read_rows(path)]
    if not rows:
        print(f"no rows in {', '.join(map(str, paths))}")
        return
    publish("recovery", tables(rows), to_file=to_file)
    for r in filter(marks, rows):
        print(line(r))


def flat(hits: Mapping[str, Sequence[bool]]) -> list[bool]:
    """Of all effects together."""
    return [h for some in hits.values() for h in some]


def cpu_seconds(rows: Sequence[Mapping]) -> list[float]:
    """CPU seconds of each row; the earlier search is given in two parts."""
    return [float(np.sum(r["seconds"])) for r in rows]


def sizes(counts: Sequence[int]) -> str:
    """Median and largest."""
    return f"{np.median(counts):g} ({max(counts)})"


def recalled(rows: Sequence[Mapping]) -> dict[str, list[bool]]:
    """Of effects that are there: whether each is called needed."""
    found: dict[str, list[bool]] = {}
    for r in rows:
        truth = function_set().parse(r["truth"])
        for effect, verdict in r["verdicts"].items():
            if has(truth, effect):
                found.setdefault(effect, []).append(verdict == "needed")
    return found


def covered_if_lumped(r: Mapping, trifles: Iterable[str] = ()) -> bool:
    """Return True if a minimal structure is within the truth and everything it lacks is optional or a trifle."""
    held_back = (effect for effect, said in r.get("held_back", {}).items() if said == "not decidable")
    known, truth = {*r["optional"], *held_back, *trifles}, function_set().parse(r["truth"])
    return any(visible_if_lumped(function_set().parse(s), truth, known) for s in r["minimal"])


def covered_but_for_trifles(r: Mapping) -> bool:
    """The same, if what does not matter counts as a trifle."""
    return covered_if_lumped(r, (effect for effect, rise in r["matters"].items() if rise <= MATTERS))


def by_effect(rows: Sequence[Mapping], what: str) -> dict[str, list[bool]]:
    """Of effects called needed: whether each is there. Of those that matter: whether each is called not needed."""
    found: dict[str, list[bool]] = {}
    for r in rows:
        for effect, verdict in r["verdicts"].items():
            if what == "needed" and verdict == "needed":
                found.setdefault(effect, []).append(is_there(effect, r))
            elif what != "needed" and r["matters"].get(effect, 0.0) > MATTERS:
                wanted = "not needed" if what == "not needed" else "needed"
                one_of = what == "one of several" and effect in r.get("one_of_several", ())
                found.setdefault(effect, []).append(verdict == wanted or one_of)
    return found


def run(options: argparse.Namespace, path: Path) -> None:
    code_version()  # before anybody changes it while rows are made
    known = [s for s in PAPER.structures() if not set(s.names) & set(options.without)]
    behind = any("@2" in sensor for sensor in options.sensors)
    candidates = [s for s in known if (s.masses == 2 if behind else s.masses <= options.masses)]
    draw = drawn_structure if options.truths == "drive" else None
    done = {(r["seed"], r["number"], r["noise"]) for r in read_rows(path)}
    left = {
        number: [noise for noise in options.noise if (options.seed, number, noise) not in done]
        for number in range(options.first, options.last)
    }

    def rows(number: int) -> Iterator[dict[str, object]]:
        drive = RandomDrive(options.seed, number, candidates, draw=draw, sensors=options.sensors)
        yield from (
            examine(drive, noise, pool, options.search, grammar_named(options.grammar)) for noise in left[number]
        )

    with ThreadPoolExecutor(options.workers) as pool:
        add_rows(path, [number for number, noises in left.items() if noises], rows, line)


def main() -> None:
    limit_blas_threads()
    parser = row_arguments(__doc__, last=10, seed=18)
    parser.add_argument("--with-seeds", type=int, nargs="*", default=[], help="whose rows the table has, too")
    parser.add_argument("--noise", type=float, nargs="*", default=[0.0, 1e-3, 1e-2, 5e-2])
    parser.add_argument("--masses", type=int, default=4, help="at most, in all candidates")
    parser.add_argument("--without", nargs="*", default=[], help="effects that no candidate has")
    parser.add_argument("--search", choices=("border", "exhaustive"), default="border")
    parser.add_argument("--grammar", choices=GRAMMARS, default="paper", help="function set that is searched")
    parser.add_argument(
        "--truths", choices=("paper", "drive"), default="paper", help="448 structures, or 2 to 6 effects of all kinds"
    )
    parser.add_argument(
        "--sensors", nargs="+", default=["velocity"], help="velocity, velocity@2 or speed@2; two masses with the latter"
    )
    parser.add_argument("--workers", type=int, default=1, help="threads")
    parser.add_argument("--out", type=Path, help="file of the rows, instead of that of the seed in bench/results/")
    options = parser.parse_args()
    first, *others = (RESULTS / f"recovery_seed{seed}.jsonl.gz" for seed in (options.seed, *options.with_seeds))
    path = options.out or first
    if options.what == "run":
        run(options, path)
    table([path, *others], to_file=options.save)


if __name__ == "__main__":
    main()
