"""Gallery of measured drives: what brightgrey finds in recordings that others have published, nothing given.

    python bench/gallery.py run [NAME ...]     identify; into bench/results/gallery_<name>.json
    python bench/gallery.py pages              docs/gallery/ from these files

The recordings stay where they are (see `support.measured`). The pages hold thinned pictures of them.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

from brightgrey import Recording, identify
from support.measured import emps_recording, kuka_recording, pendulum_recordings, two_mass_recordings
from support.pictures import NARROW, kept, picture
from support.results import RESULTS, code_version

PAGES = Path(__file__).parents[1] / "docs" / "gallery"


class Drive(NamedTuple):
    """A measured drive, and who has recorded it."""

    title: str
    about: str
    source: str
    recordings: Callable[[], Sequence[Recording]]
    options: Mapping[str, Any] = {}


DRIVES = {
    "emps": Drive(
        "A linear axis on a ball screw",
        "The EMPS benchmark: a motor drives a carriage by a ball screw, 24.8 s in closed loop. The input is the force.",
        "Janot, Gautier, Brunot 2019, *Data set and reference models of EMPS*, Workshop on Nonlinear System "
        "Identification Benchmarks",
        lambda: [emps_recording()],
    ),
    "mte360": Drive(
        "Two carts coupled by a spring",
        "A motor drives the first cart. The three recordings, a square and two sines, are identified jointly. The "
        "input is the motor's voltage, so that inertias stand in V s²/mm.",
        "Laboratory of the course MTE 360, University of Waterloo",
        lambda: list(two_mass_recordings().values()),
    ),
    "pendulum": Drive(
        "An arm on a motor",
        "A pendulum on a quasi direct drive, moved by the system identification motion of its authors.",
        "Wiebe et al. 2022, doi:10.21105/joss.03884 (BSD-3-Clause)",
        lambda: [pendulum_recordings()["system_identification"]],
    ),
    "kuka": Drive(
        "A robot's second axis",
        "Axis 2 of a KUKA KR300 along its trajectory A. The other axes move at the same time, and gravity depends on "
        "the pose of all of them: a hard case, which one axis cannot explain wholly.",
        "Weigand, Ulmen, Janot, Ruskowski (MIT licence)",
        lambda: [kuka_recording(2)],
    ),
}


def run(names: Sequence[str]) -> None:
    """Identify drives and keep what their pages need."""
    for name in names:
        drive, begun = DRIVES[name], time.perf_counter()
        result = identify(list(drive.recordings()), workers=2, **drive.options)
        seconds = time.perf_counter() - begun
        found = kept(result) | {"seconds": round(seconds), "commit": code_version()}
        path = RESULTS / f"gallery_{name}.json"
        path.write_text(json.dumps(found, ensure_ascii=False, indent=1) + "\n", encoding="utf-8")
        print(f"{name}: {found['structure']}, {seconds:.0f} s", flush=True)


def pages() -> None:
    """Write a page and a picture for every drive that has been identified."""
    PAGES.mkdir(exist_ok=True)
    done = [name for name in DRIVES if (RESULTS / f"gallery_{name}.json").exists()]
    for name in done:
        found = json.loads((RESULTS / f"gallery_{name}.json").read_text(encoding="utf-8"))
        (PAGES / f"{name}.svg").write_text(picture(found), encoding="utf-8")
        (PAGES / f"{name}-narrow.svg").write_text(picture(found, NARROW), encoding="utf-8")
        (PAGES / f"{name}.md").write_text(page(name, DRIVES[name], found), encoding="utf-8")
    (PAGES / "index.md").write_text(index(done), encoding="utf-8")


def page(name: str, drive: Drive, found: Mapping[str, Any]) -> str:
    """One drive in Markdown."""
    lines = [f"# {drive.title}", "", *fill(drive.about, 118).splitlines(), "", *_pictures(name, drive), ""]
    for sentence in found["headline"]:
        lines += fill(sentence, 118, break_on_hyphens=False, initial_indent="- ", subsequent_indent="  ").splitlines()
    lines.append("")
    lines += ["```{table}", ":class: values", "", "| parameter | value | unit | meaning |", "|---|---|---|---|"]
    lines += [f"| `{n}` | {value} | {unit} | {about} |" for n, value, unit, about in found["parameters"]]
    lines += ["```", "", "| effect | verdict | reason |", "|---|---|---|"]
    lines += [f"| {title} | {verdict} | {reason} |" for title, verdict, reason in found["verdicts"]]
    lines += ["", *fill(f"Recording: {drive.source}.", 118).splitlines(), ""]
    lines += [
        f"Nothing was given but the recording. `python bench/gallery.py run {name}`, commit {found['commit']}.",
        "",
    ]
    return "\n".join(lines)


def _pictures(name: str, drive: Drive) -> list[str]:
    """The picture of a drive, wide and narrow, of which a page shows one."""
    return [f"![{drive.title}]({name}.svg){{.wide}}", f"![{drive.title}]({name}-narrow.svg){{.narrow}}"]


def index(names: Sequence[str]) -> str:
    """Page with all drives."""
    lines = ["# Gallery", "", "Measured drives, identified with nothing given but their recordings.", ""]
    for name in names:
        drive = DRIVES[name]
        lines += [f"## [{drive.title}]({name}.md)", "", *fill(drive.about, 118).splitlines(), ""]
        lines += [f"[{shown}]({name}.md)" for shown in _pictures(name, drive)]
        lines.append("")
    lines += ["```{toctree}", ":hidden:", "", *names, "```", ""]
    return "\n".join(lines)


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("run", "pages"))
    parser.add_argument("names", nargs="*", choices=[*DRIVES, []])
    asked = parser.parse_args()
    if asked.what == "run":
        run(asked.names or list(DRIVES))
    pages()


if __name__ == "__main__":
    main()
