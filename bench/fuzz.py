"""Wrong inputs, drawn by a seed: mutated files, models, calls from Python and command lines.

    python bench/fuzz.py run text 100000 --seed 91      go on until so many cases of a target have been tried
    python bench/fuzz.py table --seed 91 [--save]       counts of all targets

Targets are `text` (files of the own readers), `libraries` (MAT, TDMS, MDF), `model` (model.json), `calls` (from Python)
and `commands`. Every case must end with a result, or with an error of one printable line, within 10 s, and within
200 MB for files. What a plain text, or a block of plain numbers in a file, says by itself is compared with the numbers
that are read. Counts and findings are
kept in bench/results/fuzz_seed<N>.json; a run goes on where it stopped.
"""

from __future__ import annotations

import contextlib
import gzip
import io
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import asammdf
import h5py
import nptdms
import numpy as np
import scipy.io

import brightgrey as bg
from brightgrey.cli import main as program
from brightgrey.recordings.file import open_table
from brightgrey.recordings.formats import child_process
from support.fuzzing import VALUES, mutated_bytes, mutated_json, outcomes_of
from support.measured import DATA
from support.results import RESULTS, Table, arguments, code_version, publish

CUTS = Path(__file__).parents[1] / "tests" / "recordings" / "data"
FOLDER = Path(tempfile.gettempdir()) / "brightgrey_fuzz"
K = np.arange(60)
PLAIN = "\n".join(["t [s],torque [N m],velocity [rad/s]", *(f"{i / 100:g},{np.sin(i):.5g},{np.cos(i):.5g}" for i in K)])
NUMBER = re.compile(r"[+-]?[0-9]{1,15}([.,][0-9]{1,15})?(e[+-]?[0-9]{1,2})?")
WRONG: list[Any] = [
    *VALUES,
    float("nan"),
    float("inf"),
    3,
    b"x",
    ("a",),
    {"torque": 1},
    {"t": "m"},
    np.eye(3),
    object(),
]
WORDS = [
    "",
    "nan",
    "inf",
    "1e308",
    "-1",
    "0",
    "x",
    "+",
    "torque",
    "t",
    "velocity:position",
    "=",
    "a=b",
    "J1=1",
    "J1=-1:2",
]
WORDS += [
    "\x00",
    "é\x1b[31m",
    "9" * 3000,
    "%",
    "torque=%",
    "0:1",
    "1e-300",
    "/dev/full",
    "axis.csv",
    "model.json",
    "none",
]
REPEATED = 3
"""Findings of one kind that are kept."""


def texts() -> list[bytes]:
    """Texts to mutate: cut exports, and delimited text with names, plain and compressed; exports of other programs."""
    german = PLAIN.replace(",", ";").replace(".", ",").encode()
    cuts = [path.read_bytes() for path in sorted(CUTS.rglob("*.csv"))]
    return [*cuts, PLAIN.encode(), german, gzip.compress(PLAIN.encode(), mtime=0), *exports()]


def exports() -> list[bytes]:
    """LabVIEW, Rigol, clock times past midnight, sources merged by time, and a logger that was started again."""
    head, *rows = PLAIN.split("\n")
    tags = ["LabVIEW Measurement", "Separator\tComma", "X_Columns\tOne", "***End_of_Header***", "", "Channels\t2"]
    labview = [*tags, "Y_Unit_Label\tNm\trad/s", "Delta_X\t0.01\t0.01", "***End_of_Header***", "X_Value\ttorque\tspeed"]
    labview = [line.replace("\t", ",") for line in labview]
    clock = [
        f"{23 * (k < 30)}:{59 * (k < 30):02d}:{(30 + k) % 60:02d}.5,{r.partition(',')[2]}" for k, r in enumerate(rows)
    ]
    cells = [row.split(",") for row in rows]
    merged = [f"{t},{u},\n{float(t) + 0.005:g},,{v}" for t, u, v in cells]
    again = [head, *rows[:30], head, *rows[30:], "Min,-1,-1", "Max,1,1"]
    rigol = [
        "X,CH1,CH2,Start,Increment,",
        "Sequence,Volt,Volt,-0.5,0.01",
        *(f"{k},{u},{v}," for k, (_, u, v) in enumerate(cells)),
    ]
    texts = [[*labview, *rows], rigol, ["stamp,torque,velocity", *clock], [head, *merged], again]
    return ["\n".join(lines).encode() for lines in texts]


def library_files() -> list[bytes]:
    """Files of libraries to mutate: of every format one or more that are written here, and recorded ones."""
    cell = np.empty(2, object)
    cell[:] = [{"a": 1.0}, np.zeros(3)]
    content = {"t": K / 100, "u": np.sin(K), "v": {"w": np.cos(K), "c": cell}, "s": scipy.sparse.eye(60).tocsc()}
    written = []
    for options in ({}, {"do_compression": True}, {"format": "4"}):
        plain = {name: value for name, value in content.items() if options.get("format") != "4" or name in "tu"}
        file = io.BytesIO()
        scipy.io.savemat(file, plain, **options)
        written.append(file.getvalue())
    written += [hdf5_file(compression) for compression in (None, "gzip")]
    channels = [nptdms.ChannelObject("axis", name, value) for name, value in content.items() if name in "tu"]
    with nptdms.TdmsWriter(file := io.BytesIO()) as writer:
        writer.write_segment(channels)
    written.append(file.getvalue())
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append([asammdf.Signal(np.sin(K), K / 100, unit="N m", name="u")])
        mdf.save(FOLDER / "written.mf4", overwrite=True)
    written.append((FOLDER / "written.mf4").read_bytes())
    recorded = [p for p in sorted(DATA.glob("formats/*")) if p.suffix in (".tdms", ".mf4")]
    return [*written, *(p.read_bytes() for p in recorded if p.stat().st_size < 200_000)]


def hdf5_file(compression: str | None) -> bytes:
    """File as MATLAB 7.3 writes it: a header of 512 bytes before HDF5, classes as attributes, a struct as a group."""
    with h5py.File(file := io.BytesIO(), "w", userblock_size=512) as written:
        for name, value in (("t", K / 100), ("u", np.sin(K)), ("v/w", np.cos(K))):
            data = written.create_dataset(name, data=value[None, :], compression=compression)
            data.attrs["MATLAB_class"] = np.bytes_("double")
        written["v"].attrs["MATLAB_class"] = np.bytes_("struct")
    return b"MATLAB 7.3 MAT-file".ljust(512) + file.getvalue()[512:]


def blocks_of(data: bytes) -> dict[str, tuple[int, str, int]]:
    """Place, type and number of the values of every channel that a file holds as one block of plain numbers."""
    path = FOLDER / "original"
    path.write_bytes(data)
    table, _ = open_table(path)
    found = {}
    for index, column in enumerate(table.columns):
        values = table.load([index])[0]
        for kind in ("<f8", "<f4", "<i4", "<i2") if column.name and np.isfinite(values).all() else ():
            with np.errstate(invalid="ignore"):
                block = values.astype(kind)
            if np.array_equal(block, values) and data.count(block.tobytes()) == 1:
                found[column.name] = (data.index(block.tobytes()), kind, values.size)
                break
    return found


def untouched_but_for(blocks: dict[str, tuple[int, str, int]], old: bytes, new: bytes) -> bool:
    """Return True if a mutated file differs from the old one in plain numbers only, so that it says what they are."""
    if len(old) != len(new):
        return False
    changed = np.flatnonzero(np.frombuffer(old, np.uint8) != np.frombuffer(new, np.uint8))
    inside = np.zeros(changed.size, bool)
    for at, kind, number in blocks.values():
        inside |= (changed >= at) & (changed < at + number * np.dtype(kind).itemsize)
    return bool(inside.all())


def library_case(files: list[bytes], blocks: list[dict[str, tuple[int, str, int]]], seed: int, number: int) -> str:
    """Read a mutated file by its library, and compare with plain numbers where the file has them."""
    old, plain = files[number % len(files)], blocks[number % len(files)]
    data = mutated_bytes(old, np.random.default_rng([seed, number]))
    path = FOLDER / "file"
    path.write_bytes(data)
    try:
        table, _ = open_table(path)
        found = {c.name: table.load([i])[0] for i, c in list(enumerate(table.columns))[:50] if c.name}
    except bg.BrightgreyError as error:
        return verdict_on(error)
    if not plain or not untouched_but_for(plain, old, data):
        return "read"
    said = {name: np.frombuffer(data, kind, count, at).astype(float) for name, (at, kind, count) in plain.items()}
    same = all(name in found and np.array_equal(found[name], said[name], equal_nan=True) for name in said)
    return "read as it says" if same else "misread"


def forked(command: list[str], **options: Any) -> subprocess.CompletedProcess[bytes]:
    """Run the child of `child_process` in a fork of this process, which spares the start of Python and the imports."""
    child = os.fork()
    if child == 0:
        sys.argv = command[2:]
        code = 1
        try:
            child_process.run()
            code = 0
        except SystemExit as end:
            code = int(end.code or 0)
        finally:
            os._exit(code)
    _, status = os.waitpid(child, 0)
    return subprocess.CompletedProcess(command, os.waitstatus_to_exitcode(status))


def mostly_forked(case: Callable[[int], str]) -> Callable[[int], str]:
    """Return a case that is read in a fork, but for every twentieth one in a new process, as users do."""
    start = subprocess.run

    def run(number: int) -> str:
        subprocess.run = start if number % 20 == 0 else forked  # type: ignore[assignment]
        return case(number)

    return run


def within_memory(case: Callable[[int], str], most: float) -> Callable[[int], str]:
    """Return a case that counts as over its memory once a child process of it takes more than `most`, in 2^10 bytes."""

    def watched(number: int) -> str:
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
        outcome = case(number)
        after = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
        return "memory" if before <= most < after else outcome

    return watched


def verdict_on(error: bg.BrightgreyError) -> str:
    """Outcome of a case that was refused."""
    text = str(error)
    if "does not fit into the memory" in text:
        return "memory"
    return "refused" if text.isprintable() and 0 < len(text) <= 1000 else f"bad message {text[:100]!r}"


def plainly(data: bytes) -> np.ndarray | None:
    """Numbers of a text that says them without any doubt, shape (rows, 3); None for any other."""
    with contextlib.suppress(UnicodeDecodeError):
        head, *lines = data.decode("ascii").rstrip("\n").split("\n")
        mark = ";" if ";" in head else ","
        rows = [line.split(mark) for line in lines]
        if head == PLAIN.split("\n")[0].replace(",", mark) and all(
            len(row) == 3 and all(NUMBER.fullmatch(cell) for cell in row) for row in rows
        ):
            return np.array([[float(cell.replace(",", ".")) for cell in row] for row in rows])
    return None


def read_case(files: list[bytes], seed: int, number: int) -> str:
    """Read a mutated file."""
    data = mutated_bytes(files[number % len(files)], np.random.default_rng([seed, number]))
    path = FOLDER / "file"
    path.write_bytes(data)
    try:
        table, _ = open_table(path)
        found = table.load([i for i, column in enumerate(table.columns) if column.name][:50])
    except bg.BrightgreyError as error:
        return verdict_on(error)
    said = plainly(data)
    if said is None:
        return "read"
    return "read as it says" if np.array_equal(found.T, said) else "misread"


@cache
def model_text() -> str:
    """Text of a model with every part that a model of a search has."""
    return (Path(FOLDER) / "model.json").read_text(encoding="utf-8")


def impossible(model: bg.Model) -> str:
    """What a model says that cannot be; empty if nothing."""
    for name, part in model.parameters.items():
        positive = model.structure.parameters[name].scale == "log"
        ordered = part.ci95 is None or part.ci95[0] <= part.ci95[1]
        if (positive and part.value <= 0.0) or (part.std or 0.0) < 0.0 or not ordered:
            return f"accepted: {name}"
    signals = (model.input, *model.outputs)
    wrong = model.settings.sampling_time <= 0.0 or any(s.gain == 0.0 for s in signals)
    return "accepted: signals" if wrong or any(low > high for low, high in model.settings.bounds.values()) else ""


def model_case(seed: int, number: int) -> str:
    """Load a mutated model, and use it."""
    rng = np.random.default_rng([seed, number])
    path = FOLDER / "mutated.json"
    if number % 4 == 0:
        path.write_bytes(mutated_bytes(model_text().encode(), rng))
    else:
        text = json.dumps(mutated_json(json.loads(model_text()), rng))
        path.write_text(text.replace('"nested"', "[" * 3000 + "]" * 3000))
    recording = recorded()
    uses = (
        lambda m: bg.simulate(m, recording),
        lambda m: bg.analyse(m, speed=float(rng.choice([1.0, -3.0, 1e3]))),
        lambda m: bg.design(m, torque=2.0),
        lambda m: (m.save(FOLDER / "saved.json"), m._repr_html_()),
    )
    try:
        model = bg.load_model(path)
        if wrong := impossible(model):
            return wrong
        uses[number % len(uses)](model)
    except bg.BrightgreyError as error:
        return verdict_on(error)
    return "taken"


@cache
def recorded() -> bg.Recording:
    """The recording of the model."""
    return bg.read_recording(FOLDER / "axis.csv", input="torque", outputs="velocity")


def calls() -> list[tuple[Callable[..., Any], dict[str, Any]]]:
    """Functions with arguments that are right."""
    model, recording = bg.load_model(FOLDER / "model.json"), recorded()
    reading = {"input": "torque", "outputs": "velocity", "dt": 0.01, "input_gain": 1.0, "units": {"torque": "N m"}}
    reading |= {
        "window": (0.0, 5.0),
        "decimate": 1,
        "hold": "zoh",
        "gear": {"velocity": 1.0},
        "shift": {"velocity": 0.0},
    }
    columns = {"torque": recording.u, "velocity": recording.y[0]}
    given = {
        "structure": "one_mass",
        "bounds": {"J1": (0.01, 0.1)},
        "f_tanh": 10.0,
        "starts": 2,
        "seed": 0,
        "workers": 1,
    }
    given |= {"initial": "rest", "level": "fast", "profile": (), "test": recording, "start": model, "check": False}
    return [
        (bg.read_recording, {"path": FOLDER / "axis.csv", **reading, "delimiter": ",", "decimal": ".", "header": True}),
        (bg.recording_from, {"columns": columns, **reading, "name": "a"}),
        (bg.recording_from, {"columns": columns | {"t": recording.t}, "input": "torque", "outputs": "velocity"}),
        (bg.simulate, {"model": model, "recording": recording}),
        (bg.analyse, {"model": model, "speed": 1.0, "contact": "forward"}),
        (
            bg.design,
            {"model": model, "torque": 2.0, "sampling_time": 0.01, "computing_time": 0.0, "settling_time": 0.1},
        ),
        (bg.check, {"recordings": recording}),
        (bg.inspect, {"path": FOLDER / "axis.csv"}),
        (bg.load_model, {"path": FOLDER / "model.json"}),
        (bg.Compensator.of, {"numerator": [1.0, 2.0], "denominator": [1.0, 0.0]}),
        (bg.identify, {"recordings": recording, **given}),
    ]


def call_case(seed: int, number: int) -> str:
    """Call a function with one or two wrong arguments."""
    rng = np.random.default_rng([seed, number])
    known = calls()
    function, right = known[number % len(known)]
    wrong = dict(right)
    for name in rng.choice(list(right), size=min(len(right), int(rng.integers(1, 3))), replace=False):
        value = WRONG[int(rng.integers(len(WRONG)))]
        nested = isinstance(right[name], dict) and rng.random() < 0.5
        wrong[str(name)] = dict.fromkeys(right[name], value) if nested else value
    try:
        function(**wrong)
    except bg.BrightgreyError as error:
        return verdict_on(error)
    return "taken"


COMMANDS = (
    "inspect axis.csv --json",
    "check axis.csv --input torque --output velocity --dt 0.01 --window 0:5 --json",
    "check axis.csv --input torque --output velocity --unit torque=mN_m --gear velocity=2 --decimate 2",
    "check axis.csv --input torque --output velocity --hold zoh --shift velocity=0.01 --time t --input-gain 2",
    "simulate model.json axis.csv --dt 0.01 --unit velocity=rpm --json",
    "analyse model.json --speed 2 --contact forward --json",
    "control model.json --torque 2 --dt 0.01 --computing 0.001 --json",
    "export model.json --to latex --recording axis.csv --out export",
    "identify axis.csv --input torque --output velocity --structure one_mass --bound J1=0.01:0.1 --seed 1 --out out",
    "identify axis.csv --input torque --output velocity --structure one_mass --fix J1=0.05 --f-tanh 3 --out out",
    "fleet fleet.csv --input torque --output velocity --structure one_mass --out fleet",
    "runs . --json",
    "plan out --seconds 2 --out plan",
)


def command_case(seed: int, number: int) -> str:
    """Run a command line with one or two words changed, left out or doubled."""
    rng = np.random.default_rng([seed, number])
    words = COMMANDS[number % len(COMMANDS)].split()
    for _ in range(int(rng.integers(1, 3))):
        at, kind = int(rng.integers(1, len(words))), int(rng.integers(0, 6))
        token = WORDS[int(rng.integers(len(WORDS)))]
        words[at : at + 1] = ([], [words[at]] * 2, [words[at][::-1]], *([[token]] * 3))[kind]
    out, err = io.StringIO(), io.StringIO()
    with contextlib.chdir(FOLDER), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = program(words)
        except SystemExit as end:
            return f"SystemExit {end.code}"
    said = err.getvalue().splitlines()
    if code == 2 and (len(said) != 1 or not said[0].startswith("brightgrey: ") or not said[0].isprintable()):
        return f"{len(said)} lines of error: {' '.join(words)[:150]!r}"
    if code not in (0, 1, 2) or (code != 2 and said):
        return f"code {code} with errors {said[:1]}: {' '.join(words)[:150]!r}"
    if code == 0 and "--json" in words and "--help" not in words and "-h" not in words:
        json.loads(out.getvalue())
    return "refused" if code == 2 else "taken"


def prepare() -> None:
    """Write the recording and the model that calls and commands use."""
    FOLDER.mkdir(exist_ok=True)
    rng = np.random.default_rng(1)
    k = np.arange(600)
    u = np.sin(0.05 * k) + 0.6 * np.sin(0.17 * k)
    v = np.zeros(600)
    for i in k[:-1]:
        v[i + 1] = v[i] + 0.2 * (u[i] - 0.05 * v[i] - 0.2 * np.tanh(20.0 * v[i]))
    rows = [f"{0.01 * i:g},{a:.6f},{b:.6f}" for i, a, b in zip(k, u, v + 0.01 * rng.normal(size=600), strict=True)]
    (FOLDER / "axis.csv").write_text("\n".join(["t [s],torque [N m],velocity [rad/s]", *rows]))
    (FOLDER / "fleet.csv").write_text("name,recording\na,nothing.csv\n")
    if not (FOLDER / "model.json").exists():
        bg.identify(recorded(), "two_mass+coulomb+viscous+backlash", starts=2).model.save(FOLDER / "model.json")


def target_case(name: str, seed: int) -> tuple[Callable[[int], str], float, int]:
    """Case of a target, with its limits of time in s and memory in 2^20 bytes."""
    if name == "text":
        files = texts()
        return lambda number: read_case(files, seed, number), 10.0, 200
    if name == "libraries":
        files = library_files()
        blocks = [blocks_of(data) for data in files]
        case = mostly_forked(lambda number: library_case(files, blocks, seed, number))
        own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # which a fork begins with
        case = within_memory(case, own + 200 * 1024)
        return case, 10.0, 200
    prepare()
    case = {"model": model_case, "calls": call_case, "commands": command_case}[name]
    return lambda number: case(seed, number), 30.0, 2000


def run(name: str, until: int, seed: int) -> None:
    """Try the cases of a target that have not been tried, and keep what came of them."""
    FOLDER.mkdir(exist_ok=True)
    file = RESULTS / f"fuzz_seed{seed}.json"
    case, seconds, megabytes = target_case(name, seed)
    known = json.loads(file.read_text()) if file.exists() else {}
    state = known.setdefault(name, {"cases": 0, "ends": {}, "longest": 0.0, "findings": [], "commit": code_version()})
    kinds = Counter(finding.split(": ", 1)[1][:60] for finding in state["findings"])
    for number, outcome, taken in outcomes_of(case, state["cases"], until, seconds=seconds, megabytes=megabytes):
        good = outcome in ("read", "read as it says", "refused", "taken")
        key = outcome if good or outcome in ("hang", "memory", "misread") else "other"
        state["ends"][key] = state["ends"].get(key, 0) + 1
        state["longest"], state["cases"] = max(state["longest"], taken), number + 1
        if not good:
            kinds[outcome[:60]] += 1
            if kinds[outcome[:60]] <= REPEATED:
                state["findings"].append(f"{number}: {outcome}")
                print(f"{name} {number}: {outcome}", flush=True)
        if not good or number % 500 == 499 or number == until - 1:
            current = json.loads(file.read_text()) if file.exists() else {}
            file.write_text(json.dumps(current | {name: state}, indent=1, sort_keys=True) + "\n")


def rows_of(seed: int) -> list[list[str]]:
    """Rows of the counts of all targets."""
    known = json.loads((RESULTS / f"fuzz_seed{seed}.json").read_text())
    titles = {"text": "own readers", "libraries": "libraries", "model": "model.json", "calls": "calls from Python"}
    rows = []
    for name in ("text", "libraries", "model", "calls", "commands"):
        if state := known.get(name):
            ends = state["ends"]
            taken = sum(ends.get(key, 0) for key in ("read", "read as it says", "taken"))
            compared = f"{ends.get('misread', 0)} of {ends.get('read as it says', 0) + ends.get('misread', 0)}"
            bad = [str(ends.get(key, 0)) for key in ("other", "hang", "memory")]
            counts = [str(state["cases"]), str(taken), str(ends.get("refused", 0)), *bad]
            text = compared if name in ("text", "libraries") else ""
            rows.append([titles.get(name, "command lines"), *counts, text, f"{state['longest']:.1f}"])
    return rows


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("what", choices=("run", "table"))
    parser.add_argument("target", nargs="?", choices=("text", "libraries", "model", "calls", "commands"))
    parser.add_argument("until", nargs="?", type=int)
    parser.add_argument("--seed", type=int, default=91)
    options = parser.parse_args()
    if options.what == "run":
        run(options.target, options.until, options.seed)
        return
    columns = ["inputs", "number", "taken", "refused", "other end", "over time", "over memory", "misread", "longest s"]
    publish("fuzz", [Table("Mutated inputs", columns, rows_of(options.seed))], to_file=options.save)


if __name__ == "__main__":
    main()
