"""Compare what two versions of brightgrey compute for fixed seeds.

    python tools/compare_results.py record before --source ../old/src   run the old code, keep its results in before/
    python tools/compare_results.py record after                        the same with the code of this checkout
    python tools/compare_results.py compare before after --rtol 1e-9    list every number and every word that differs

The commands below cover the demo, a search of all structures with evidence, one genetic run of each preset, given
structures on the demo and on measured recordings, all exports, analysis, control design and two Kalman filters. Numbers
are compared with a relative tolerance, 0 by default. Words that were renamed are read as their new names.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("BRIGHTGREY_DATA", ROOT.parent / "shared" / "data"))
DEMO = ("demo/recording.csv", "--input", "torque", "--output", "velocity")
TRUTH = "two_mass+coulomb+viscous+stribeck"
EMPS = (
    *(str(DATA / "emps" / "DATA_EMPS.mat"), "--time", "t", "--input", "vir", "--output", "qm:position"),
    *("--input-gain", "35.150651", "--unit", "vir=N", "--unit", "qm=m"),
)
MTE = (
    *(str(DATA / "mte360" / "velocity_response_1_5.mat"), "--time", "t", "--input", "u", "--output", "v1:velocity"),
    *("--unit", "u=V", "--unit", "v1=mm/s"),
)
GENETIC = ("--search", "genetic", "--seed", "5", "--generations", "3")
IDENTIFY = {
    "given": (*DEMO, "--structure", TRUTH, "--seed", "2"),
    "gap": (*DEMO, "--structure", f"{TRUTH}+backlash+delay", "--window", "0:0.9"),
    "pattern": (*DEMO, "--structure", "two_mass+coulomb+viscous", "--estimator", "pattern-search", "--profile", "J1"),
    "exhaustive": (*DEMO, "--search", "exhaustive", "--seed", "3"),
    "genetic-paper": (*DEMO, *GENETIC, "--iterations", "40"),
    "genetic-tuned": (*DEMO, *GENETIC, "--preset", "tuned"),
    "emps": (*EMPS, "--decimate", "4", "--structure", "one_mass+coulomb+viscous+gravity"),
    "mte360": (*MTE, "--structure", "two_mass+coulomb+viscous+gravity", "--initial", "estimated"),
}
TARGETS = ("c", "fmu", "matlab", "control", "modelica", "latex")
COMMANDS = {
    "analyse": ("analyse", "given/model.json", "--speed", "5", "--json"),
    "analyse-gap": ("analyse", "gap/model.json", "--speed", "5", "--json"),
    "control": ("control", "given/model.json", "--torque", "8", "--json"),
    "watch": ("watch", "given/model.json", "demo/recording.csv", "--baseline", "demo/recording.csv", "--json"),
    "watch-gap": ("watch", "gap/model.json", "demo/recording.csv", "--baseline", "demo/recording.csv", "--json"),
    "simulate": ("simulate", "gap/model.json", "demo/recording.csv", "--out", "simulated.csv", "--json"),
    "export": ("export", "gap/model.json", *(a for t in TARGETS for a in ("--to", t)), "--out", "export", "--json"),
}
OLD_OPTIONS = {"--preset": "--setting", "tuned": "ours", "--baseline": "--normal"}
RENAMED = {
    "twin": "equivalent model",
    "look-alike": "confounded",
    "invisible": "not observable",
    "relative": "scale unknown",
    "ours": "tuned",
    "relatives": "neighbours",
}
"""Words of results before this house, and what stands there now."""
TIMED = re.compile(r"seconds|time|version|python|folder|file|made|^date|command|request")
"""Keys whose values differ from run to run, or name the machine."""
NUMBER = re.compile(r"[-+]?(?:\d+\.\d*|\.\d+|\d+)(?:[eE][-+]?\d+)?")


def record(out: Path, source: Path) -> None:
    """Run all commands with the code in `source`; results and what was printed go to `out`."""
    out.mkdir(parents=True)
    environment = {**os.environ, "PYTHONPATH": str(source.resolve())}

    def run(name: str, *arguments: str) -> None:
        old = "--setting" in helped
        words = [OLD_OPTIONS.get(a, a) if old else a for a in arguments]
        print(name, *words, flush=True)
        done = subprocess.run(
            [sys.executable, "-m", "brightgrey", *words], cwd=out, env=environment, capture_output=True, text=True
        )
        (out / f"{name}.txt").write_text(done.stdout, encoding="utf-8")
        if done.returncode:
            print(f"  exit code {done.returncode}: {done.stderr.strip()[-600:]}", flush=True)

    helped = ""
    helped = subprocess.run(
        [sys.executable, "-m", "brightgrey", "identify", "--help"], env=environment, capture_output=True, text=True
    ).stdout
    run("demo", "demo", "--out", "demo", "--quiet")
    for name, arguments in IDENTIFY.items():
        if Path(arguments[0]).is_absolute() and not Path(arguments[0]).exists():
            print(f"{name}: left out, its recording is not there")
            continue
        run(name, "identify", *arguments, "--out", name, "--quiet")
    for name, arguments in COMMANDS.items():
        run(name, *arguments)


def values(path: Path) -> dict[str, object]:
    """All numbers and words of a file, by where they stand."""
    if path.suffix == ".json" or (path.suffix == ".txt" and path.read_text(encoding="utf-8").startswith(("{", "["))):
        return dict(_leaves(json.loads(path.read_text(encoding="utf-8")), ""))
    if path.suffix == ".csv":
        rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
        return {f"{i},{j}": _parsed(cell) for i, row in enumerate(rows) for j, cell in enumerate(row)}
    if path.suffix == ".fmu":
        with zipfile.ZipFile(path) as archive:
            texts = {name: archive.read(name) for name in archive.namelist() if name.endswith(".c")}
        return {name: text.decode() for name, text in texts.items()}
    if path.suffix in {".c", ".h", ".m", ".mo", ".tex", ".py"}:
        text = path.read_text(encoding="utf-8")
        numbers = dict(enumerate(_parsed(m) for m in NUMBER.findall(_uncommented(text, path.suffix))))
        return {f"number {i}": v for i, v in numbers.items()}
    return {}


def _uncommented(text: str, suffix: str) -> str:
    marks = {".m": "%", ".py": "#", ".tex": "%"}
    if suffix in marks:
        return re.sub(rf"{marks[suffix]}.*", "", re.sub(r'"""[\s\S]*?"""', "", text))
    return re.sub(r"//.*|/\*[\s\S]*?\*/", "", text)


def _leaves(tree: object, at: str) -> Iterator[tuple[str, object]]:
    if isinstance(tree, dict):
        for key, value in tree.items():
            if not TIMED.search(str(key)):
                yield from _leaves(value, f"{at}/{RENAMED.get(str(key), key)}")
    elif isinstance(tree, list):
        for i, value in enumerate(tree):
            yield from _leaves(value, f"{at}/{i}")
    else:
        yield at, RENAMED.get(tree, tree) if isinstance(tree, str) else tree


def _parsed(text: str) -> object:
    try:
        return float(text)
    except ValueError:
        return RENAMED.get(text, text)


def differs(a: object, b: object, rtol: float) -> float | None:
    """How far two values are apart: relative for numbers, infinite for words; None if they agree."""
    if isinstance(a, int | float) and isinstance(b, int | float):
        if a == b or (math.isnan(a) and math.isnan(b)):
            return None
        apart = abs(a - b) / max(abs(a), abs(b))
        return apart if apart > rtol or math.isnan(apart) else None
    return None if a == b else math.inf


def compare(before: Path, after: Path, rtol: float, words: bool) -> int:
    """Print what differs; returns in how many files a number does."""
    bad = 0
    files = sorted({p.relative_to(d) for d in (before, after) for p in d.rglob("*") if p.is_file()})
    compared = 0
    for file in files:
        if not ((before / file).exists() and (after / file).exists()):
            print(f"{file}: only {'before' if (before / file).exists() else 'after'}")
            bad += file.suffix not in {".lock", ".sqlite", ".png", ".svg"}
            continue
        old, new = values(before / file), values(after / file)
        compared += len(old)
        apart = {k: differs(old[k], new[k], rtol) for k in old.keys() & new.keys()}
        numbers = {k: d for k, d in apart.items() if d is not None and math.isfinite(d)}
        text = [k for k, d in apart.items() if d == math.inf]
        missing = sorted(old.keys() ^ new.keys())
        if numbers or missing:
            bad += 1
        if numbers:
            worst = max(numbers, key=lambda k: numbers[k])
            print(f"{file}: {len(numbers)} of {len(old)} numbers differ, at most by {numbers[worst]:.2g}")
            print(f"    {worst}: was {old[worst]}, is {new[worst]}")
        if missing:
            print(f"{file}: {len(missing)} entries stand on one side only, such as {missing[:4]}")
        if text:
            print(f"{file}: {len(text)} texts differ")
            for k in text if words else text[:0]:
                print(f"    {k}\n      was: {str(old[k])[:300]}\n      is:  {str(new[k])[:300]}")
    print(f"{compared} values in {len(files)} files compared; numbers differ in {bad} files")
    return bad


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    recording = commands.add_parser("record")
    recording.add_argument("out", type=Path)
    recording.add_argument("--source", type=Path, default=ROOT / "src")
    comparing = commands.add_parser("compare")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    comparing.add_argument("--rtol", type=float, default=0.0)
    comparing.add_argument("--words", action="store_true", help="print the texts that differ, too")
    given = parser.parse_args()
    if given.command == "record":
        record(given.out, given.source)
    else:
        sys.exit(compare(given.before, given.after, given.rtol, given.words) > 0)


if __name__ == "__main__":
    main()
