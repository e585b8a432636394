"""Does a planned motion decide what the first recording left open? Random drives, 1 % noise, reference solver.

    python bench/plan.py run 0 20 --seed 5     drives 0 to 19, added to the file of the seed
    python bench/plan.py table --seed 5
    python bench/plan.py demo --save           the demo's drive: information, and intervals identified anew
    python bench/plan.py limits 0 20           two quick plans for each of drives 0 to 19, in open and in closed loop
    python bench/plan.py limits-table --save   share of fresh draws of the parameters that keep the limits

The first recording is a careful one: a random motion at 40 % of the torque, or more where friction needs it to reach
40 % of the speed that the motion has at full torque. A drive counts if it leaves an effect that is there *not
decidable*; a lag of less than a sample is left out, since no motion lets the search call it needed. The limits are the
drive's own: what a reversing motion, a chirp and a multisine reach at full torque. The second recording has the same
length, sensor and noise. It is the planned motion, a chirp, a multisine, or the first motion again, the last three as
large as the limits allow. Both recordings are identified jointly. An effect is decided rightly if it is *needed* then,
or *not needed* and smaller than what matters. Its predicted power is the least over the questions between structures
with and without it: between equivalent ones if there are some, else at the least size that matters. Where all effects
have a power below 0.5, only the planned motion is recorded. The drives have up to `--masses` masses, and the search
offers as many. A plan tries as many motions as the command does. Only wider limits are not tried where nothing decides.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from brightgrey import Result, SettingsError, demo, identify, plan
from brightgrey.api.to_si import identification_task
from brightgrey.arrays import Array
from brightgrey.estimation.problem.scales import scales
from brightgrey.excitation import PAPER_EXPERIMENT
from brightgrey.kit import PAPER, Placed, Structure
from brightgrey.numerics.proportions import wilson_interval
from brightgrey.planning.design import PlanningEffort
from brightgrey.planning.envelope import MotionCommand, envelope
from brightgrey.planning.plan import Plan
from brightgrey.recordings import Recording
from brightgrey.report.charts.chart import Chart, Line, Panel
from brightgrey.report.drawing.matplotlib_figure import draw, picture
from brightgrey.search.decision import decide_structures
from brightgrey.search.lattice import has
from brightgrey.simulation.reference import reference
from support.drives import MORE_MASSES, MOTIONS, RandomDrive, coloured_noise, excitation, rounded, simulated_recording
from support.results import RESULTS, Table, publish
from support.rows import add_rows, drives_left, read_rows
from support.statistics import share, share_of

DIAGRAM = Path(RESULTS).parents[1] / "docs" / "pictures" / "plan-reliability.svg"
NOISE = 1e-2
CONTESTANTS = ("plan", "chirp", "multisine", "repeated")
DEMO_NOISE, DEMO_STEP = 1e-3, 0.01  # of the peak; rad/s: as the demo's recording
CAREFUL = 0.4  # part of the drive's torque and speed that the first recording uses
COMPARED = 0.5  # power from which the other motions are recorded, too
DT = PAPER_EXPERIMENT.dt
HALVINGS = 6  # of the range of the first motion's torque
FRESH_DRAWS = 500
FULL = PlanningEffort(relaxed_log2=None)
CHEAP = PlanningEffort(samples_log2=3, generations=4, population=8, optimised=2, finalists=4, relaxed_log2=None)
BINS = (0.0, 0.2, 0.5, 0.8, 1.01)  # of the predicted power
PREDICTED = 0.8
"""Power from which a plan says that an effect will be decided."""


def speed_of(drive: RandomDrive, u: Array) -> Array:
    """Speed of a drive without noise."""
    return reference(str(drive.truth), drive.values, u, DT, f_tanh=drive.f_tanh)[0]


def careful_torque(drive: RandomDrive) -> Array:
    """Torque of the first motion at a part of its size: that of the torque, or more to reach that of the speed."""
    full, low, high = drive.u[0], CAREFUL, 1.0
    wanted = CAREFUL * np.abs(drive.y[0]).max()
    if np.abs(speed_of(drive, low * full)).max() < wanted:
        for _ in range(HALVINGS):
            mean = 0.5 * (low + high)
            low, high = (low, mean) if np.abs(speed_of(drive, mean * full)).max() >= wanted else (mean, high)
        return high * full
    return low * full


def own_limits(drive: RandomDrive, torques: Iterable[Array]) -> dict[str, float]:
    """Limits of a drive: the most that torques reach with it, SI."""
    inertia = sum(value for name, value in drive.values.items() if name.startswith("J"))
    reached = []
    for u in torques:
        v = speed_of(drive, u)
        reached.append(
            {
                "torque": np.abs(u).max(),
                "rms_torque": np.sqrt(np.mean(u**2)),
                "speed": np.abs(v).max(),
                "acceleration": np.abs(np.diff(v)).max() / DT,
                "jerk": np.abs(np.diff(u)).max() / DT / inertia,
                "travel": np.ptp(DT * np.cumsum(v)),
            }
        )
    return {name: float(max(one[name] for one in reached)) for name in reached[0]}


class Sensor:
    """Sensor of a drive: noise and steps of an encoder as in its first recording."""

    def __init__(self, drive: RandomDrive, u: Array) -> None:
        self.drive, self.peak = drive, float(np.abs(speed_of(drive, u)).max())

    def recorded(self, u: Array, name: str, number: int) -> Recording:
        """Recording of a torque."""
        drive, size = self.drive, NOISE * self.peak
        rng = np.random.default_rng([drive.seed, drive.number, 100 + number])
        y = speed_of(drive, u) + size * coloured_noise(u.size, drive.pole, rng)
        if drive.encoder:
            y = rounded(y, max(1e-3 * self.peak, 0.5 * size))
        return simulated_recording(u, y, name=name)


def identified(recordings: Sequence[Recording], masses: int) -> Result:
    """Result of a search among structures of up to so many masses."""
    return identify(recordings, grammar="paper", exclude=MORE_MASSES[masses - 1 :], check=False)


def verdicts(recordings: Sequence[Recording], masses: int) -> dict[str, tuple[str, str]]:
    """Verdict on every effect, and its reason, by the search of `identify` without the report that follows it."""
    task = identification_task(recordings, None, {}, {}, None)
    found = decide_structures(task, PAPER, exclude=MORE_MASSES[masses - 1 :], ask=False)
    return {card.effect: (card.verdict, card.reason) for card in found.evidence.cards}


def within_limits(made, u: Array) -> Array:
    """A torque that is scaled down until the identified drive keeps the limits with it."""
    model = made.drive.known.model
    values = {name: np.array([value]) for name, value in model.values.items()}
    limits = made.limits
    while True:
        use = envelope(made.drive, model.structure, values, MotionCommand(u, None), limits).use
        if all(float(part.max()) <= 1.0 + 1e-6 for name, part in use.items() if name != "jerk"):
            return u
        u = 0.95 * u


def relative_size(drive: RandomDrive, result: Result, recordings: Sequence[Recording], effect: str) -> float:
    """Size of an effect over the least one that matters in recordings; of a further mass its inertia."""
    placed = Placed.parse(effect)
    least = placed.relevant_size(scales(recordings), result.evidence.questions.model.values)
    if placed.effect.masses:
        name = f"J{placed.effect.masses}"
    else:
        name = next(placed.parameter(p.symbol) for p in placed.effect.parameters if p.size)
    return abs(drive.values[name] / least[name])


def is_short_lag(drive: RandomDrive, effect: str) -> bool:
    """True for a lag of less than a sample: no motion lets the search call it needed."""
    placed = Placed.parse(effect)
    lags = [drive.values[placed.parameter(p.symbol)] for p in placed.effect.parameters if p.lag]
    return bool(lags) and sum(lags) < DT


def predicted(made: Plan, effect: str) -> float:
    """Least power to decide between a structure with the effect and one without it.

    Where structures are tied by it, that is what is asked, for all its sizes; else the least size that matters is.
    """
    pairs = [
        (q, p)
        for q, p in zip(made.drive.known.questions, made.found.powers, strict=True)
        if has(Structure.parse(q.truth), effect) and not has(Structure.parse(q.rival.structure), effect)
    ]
    tied = [p for q, p in pairs if q.kind == "tied"]
    return min(tied or [p for _, p in pairs])


def examine(seed: int, number: int, masses: int) -> Iterator[dict[str, object]]:
    """Rows of one drive: one per effect that is there and not decided."""
    drive = RandomDrive(seed, number, [s for s in PAPER.structures() if s.masses <= masses])
    careful = careful_torque(drive)
    sensor = Sensor(drive, careful)
    first = sensor.recorded(careful, "first", 0)
    result = identified([first], masses)
    left = {c.effect for c in result.evidence.cards if c.verdict == "not decidable"}
    asked = {e for q in result.evidence.questions.questions for e in q.effects}
    targets = sorted(e for e in left & asked if has(drive.truth, e) and not is_short_lag(drive, e))
    about = {"seed": seed, "number": number, "masses": masses, "truth": str(drive.truth)}
    if not targets:
        yield {**about, "effect": None}
        return
    rng, begin = np.random.default_rng([seed, number, 7]), time.perf_counter()
    full = {kind: excitation(kind, rng) for kind in MOTIONS}
    limits = own_limits(drive, [drive.u[0], *full.values()])
    with tempfile.TemporaryDirectory() as folder:
        result.write(folder)
        try:
            made = plan(folder, limits=limits, seed=0, effort=FULL)
        except SettingsError as why:
            yield {**about, "effect": None, "refused": str(why)}
            return
    about |= {"family": made.found.candidate.family.name, "s": round(time.perf_counter() - begin, 1)}
    power = {effect: predicted(made, effect) for effect in targets}
    torques = {"plan": made.found.candidate.torque}
    if max(power.values()) >= COMPARED:
        others = {"repeated": drive.u[0], "chirp": full["chirp"], "multisine": full["multisine"]}
        torques |= {name: within_limits(made, u) for name, u in others.items()}
    pairs = {name: [first, sensor.recorded(u, name, k)] for k, (name, u) in enumerate(torques.items(), 1)}
    second = {name: verdicts(pair, masses) for name, pair in pairs.items()}
    for effect in targets:
        cards = {name: found.get(effect, ("not needed", "")) for name, found in second.items()}
        size = relative_size(drive, result, pairs["plan"], effect)
        row = {**about, "effect": effect, "power": power[effect], "size": size, "reason": cards["plan"][1]}
        yield row | {name: verdict for name, (verdict, _) in cards.items()}


def kept_limits(seed: int, number: int) -> Iterator[dict[str, object]]:
    """Rows of one drive of known structure: what fresh draws of its parameters do with a plan in each loop."""
    drive = RandomDrive(seed, number, [s for s in PAPER.structures() if s.masses <= 2])
    own = [str(p) for p in drive.truth.placed]
    others = [str(p) for p in PAPER.whole.placed if str(p) not in own and p.effect.masses != 1]
    result = identify(drive.recordings(NOISE)[0], grammar="paper", require=own, exclude=others, check=False)
    about = {"seed": seed, "number": number, "truth": str(drive.truth), "draws": FRESH_DRAWS}
    with tempfile.TemporaryDirectory() as folder:
        result.write(folder)
        for loop in ("open", "closed"):
            begin = time.perf_counter()
            try:
                made = plan(folder, loop=loop, seed=0, effort=CHEAP)
            except SettingsError as why:
                yield {**about, "loop": loop, "refused": str(why)}
                continue
            draws = made.drive.draws(FRESH_DRAWS, np.random.default_rng([seed, number, 11]))
            seen = envelope(made.drive, made.drive.known.model.structure, draws, made.command, made.limits)
            use = {name: seen.of_most(part) for name, part in seen.use.items()}
            yield {
                **about,
                "loop": loop,
                "family": made.found.candidate.family.name,
                "own": made.found.envelope.share_kept(),
                "kept": round(seen.share_kept() * FRESH_DRAWS),
                "use": use,
                "s": round(time.perf_counter() - begin, 1),
            }


def limits_words(row: Mapping[str, object]) -> str:
    about = f"{row['number']:4} {row['truth']}, {row['loop']} loop"
    return f"{about}: {row.get('refused') or '{kept} of {draws} kept, {family}, {s} s'.format(**row)}"


def limits_table(rows: Sequence[Mapping]) -> Table:
    """Plans and fresh draws that keep the limits, by loop."""
    lines = []
    for loop in ("open", "closed"):
        some = [r for r in rows if r["loop"] == loop and "kept" in r]
        refused = sum(r["loop"] == loop and "refused" in r for r in rows)
        shares = [r["kept"] / r["draws"] for r in some]
        below = sum(binomtest(r["kept"], r["draws"], 0.99, "less").pvalue < 0.05 for r in some)
        lines.append(
            [
                f"{loop} loop",
                str(len(some)),
                str(refused),
                share(sum(r["kept"] for r in some), sum(r["draws"] for r in some)),
                f"{100.0 * min(shares, default=np.nan):.1f} %",
                str(sum(s >= 0.99 for s in shares)),
                str(below),
            ]
        )
    head = [
        "", "plans", "refused", "fresh draws that keep all limits", "least of a plan", "plans with ≥ 99 %",
        "plans below 99 % beyond chance",
    ]  # fmt: skip
    return Table("Limits and fresh draws of the parameters", head, lines)


def words(row: Mapping[str, object]) -> str:
    if row["effect"] is None:
        return f"{row['number']:4} nothing open that is there"
    shown = ", ".join(f"{name}: {row[name]}" for name in CONTESTANTS if name in row)
    return f"{row['number']:4} {row['truth']}: {row['effect']} power {row['power']:.2f}; {shown}; {row['s']} s"


def is_right(row: Mapping[str, object], name: str) -> bool:
    """True if an effect that is there is called needed; one that is too small to matter may be called not needed."""
    return row[name] == "needed" or (row[name] == "not needed" and row["size"] < 1.0)


def by_power(rows: Sequence[Mapping]) -> Iterator[tuple[tuple[float, float], list[Mapping]]]:
    """Rows of effects that a planned motion was recorded for, by intervals of the predicted power."""
    for low, high in itertools.pairwise(BINS):
        yield (low, high), [r for r in rows if "plan" in r and low <= r["power"] < high]


def reliability(rows: Sequence[Mapping]) -> str:
    """Reliability diagram as SVG: the share decided rightly with its interval over the mean of the predictions."""
    parts = [([r["power"] for r in some], [is_right(r, "plan") for r in some]) for _, some in by_power(rows) if some]
    x, y = (np.array([np.mean(part) for part in side]) for side in zip(*parts, strict=True))
    ends = [np.array(wilson_interval(sum(right), len(right))) for _, right in parts]
    labels = ["95 % interval", *[""] * (len(ends) - 1)]
    bars = [
        Line(np.full(2, mean), end, label, "measured", width=2.0)
        for mean, end, label in zip(x, ends, labels, strict=True)
    ]
    even = Line(np.array([0.0, 1.0]), np.array([0.0, 1.0]), "as predicted", "soft", "dashed")
    points = Line(x, y, "share", "simulated", "points", width=4.0)
    panel = Panel("share decided rightly", (even, *bars, points), "predicted power")
    return picture(draw([Chart("reliability", (panel,))]), "svg").decode()


def against_plan(rows: Sequence[Mapping], name: str) -> list[str]:
    """Share that a motion decides rightly, effects that only the plan or only it decides, and McNemar's exact test."""
    if not rows:
        return ["–", "–", "–"]
    gained = sum(is_right(r, "plan") and not is_right(r, name) for r in rows)
    lost = sum(is_right(r, name) and not is_right(r, "plan") for r in rows)
    test = [f"{gained} / {lost}", f"{binomtest(gained, gained + lost).pvalue:.2g}"] if gained + lost else ["–", "–"]
    return [share_of([is_right(r, name) for r in rows]), *test]


def tables(rows: Sequence[Mapping]) -> list[Table]:
    """Shares of effects that are decided rightly with McNemar's exact test against the plan, and of predictions."""
    found = [r for r in rows if "plan" in r]
    compared = [r for r in found if all(name in r for name in CONTESTANTS)]
    sure = [r for r in compared if r["power"] >= PREDICTED]
    lines = [[name, *against_plan(compared, name), *against_plan(sure, name)] for name in CONTESTANTS]
    bins = []
    for (low, high), within in by_power(rows):
        some = [is_right(r, "plan") for r in within]
        mean = f"{np.mean([r['power'] for r in within]):.2f}" if within else "–"
        bins.append([f"{low:.1f} to {min(high, 1.0):.1f}", str(len(some)), mean, share_of(some) if some else "–"])
    drives, masses = len({r["number"] for r in rows}), max(r["masses"] for r in rows)
    about = f", seed {rows[0]['seed']}" + (f", up to {masses} masses" if masses > 1 else "")
    apart = ["plan alone / it alone", "McNemar p"]
    head = ["a power ≥ 0.5 in the drive", *apart, "a power ≥ 0.8", *apart]
    return [
        Table(f"Effects that are decided rightly{about}", [f"second recording ({drives} drives)", *head], lines),
        Table(
            f"Predicted power and what happened{about}",
            ["predicted power", "effects", "its mean", "decided rightly"],
            bins,
        ),
    ]


def demo_tables() -> list[Table]:
    """Information of a motion planned for the demo, and standard deviations that an identification with it gives."""
    e = PAPER_EXPERIMENT
    with tempfile.TemporaryDirectory() as folder:
        result = demo()
        result.write(folder)
        begin = time.process_time()
        made = plan(folder, seed=0, workers=2)
        seconds = time.process_time() - begin
    old = np.array(made.drive.known.model.information)
    least = [float(np.linalg.eigvalsh(H)[0]) for H in (old, 2.0 * old, made.found.score.information)]
    torque = made.found.candidate.torque
    (v,) = reference(e.structure, e.values, torque, e.dt, f_tanh=e.f_tanh)
    noise = DEMO_NOISE * float(np.abs(result.recordings[0].y).max()) * np.random.default_rng(5).standard_normal(v.size)
    new = simulated_recording(torque, rounded(v + noise, DEMO_STEP), name="planned")
    joint = identify([result.recordings[0], new], e.structure)
    before, after = result.model.parameters, joint.model.parameters
    predicted = {name: gain for name, gain in made.gains.items() if name in after}
    found = {name: (after[name].std or np.nan) / (before[name].std or np.nan) for name in predicted}
    information = [
        ["the recording alone", f"{least[0]:.3g}", "1"],
        ["with the paper's motion once more", f"{least[1]:.3g}", f"{least[1] / least[0]:.1f}"],
        ["with the planned motion", f"{least[2]:.3g}", f"{least[2] / least[0]:.1f}"],
    ]
    rows = [
        ["predicted", *(f"{x:.2f}" for x in predicted.values())],
        ["identified", *(f"{x:.2f}" for x in found.values())],
    ]
    family = (
        f"recordings (planned: {made.found.candidate.family.name}, {made.seconds:.1f} s, in {seconds:.0f} s of CPU)"
    )
    return [
        Table("Smallest eigenvalue of the information on the demo's drive", [family, "value", "ratio"], information),
        Table("Standard deviations over those of the recording alone", ["", *predicted], rows),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    for name in ("run", "limits"):
        one = commands.add_parser(name)
        one.add_argument("first", type=int)
        one.add_argument("last", type=int)
    commands.choices["run"].add_argument("--masses", type=int, default=4, help="largest number of masses")
    for name in ("table", "limits-table", "demo"):
        commands.add_parser(name).add_argument("--save", action="store_true", help="write bench/results/plan.json")
    commands.choices["table"].add_argument("--diagram", action="store_true", help="draw the reliability diagram, too")
    for one in commands.choices.values():
        one.add_argument("--seed", type=int, default=5)
    given = parser.parse_args()
    path = Path(RESULTS) / f"plan_seed{given.seed}.jsonl.gz"
    limits_path = Path(RESULTS) / f"plan_limits_seed{given.seed}.jsonl.gz"
    if given.command == "demo":
        publish("plan", demo_tables(), to_file=given.save)
    elif given.command == "run":
        left = drives_left(path, given.seed, given.first, given.last)
        add_rows(path, left, lambda number: examine(given.seed, number, given.masses), words)
    elif given.command == "limits":
        left = drives_left(limits_path, given.seed, given.first, given.last)
        add_rows(limits_path, left, lambda number: kept_limits(given.seed, number), limits_words)
    elif given.command == "limits-table":
        publish("plan", [limits_table(read_rows(limits_path))], to_file=given.save)
    else:
        publish("plan", tables(read_rows(path)), to_file=given.save)
        if given.diagram:
            DIAGRAM.write_text(reliability(read_rows(path)), encoding="utf-8")


if __name__ == "__main__":
    main()
