"""Pictures of README and explanations, from the demo: the same code gives the same bytes.

python bench/pictures.py        docs/pictures/*.svg and docs/border.svg
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from brightgrey import Result, demo, design
from brightgrey.app.plots.loops import loop_chart
from brightgrey.estimation.problem.simulation_error import SimulationErrorProblem
from brightgrey.report.charts.chart import Chart, Line, Mark, Panel
from brightgrey.report.drawing.matplotlib_figure import draw
from brightgrey.report.drawing.matplotlib_figure import picture as written
from support.pictures import NARROW, kept, picture

ROOT = Path(__file__).parents[1]
PICTURES = ROOT / "docs" / "pictures"
BEGINNINGS = (0.1, 0.3, 1.0)
FACTORS = np.geomspace(0.3, 3.0, 241)


def local_minima(result: Result) -> Chart:
    """Cost over the spring constant, the other parameters as fitted, on beginnings of the recording."""
    fit = result.fit
    problem = SimulationErrorProblem.of(fit.structure, result.recordings)
    values = {n: np.full(FACTORS.size, e.value) for n, e in fit.estimates.items()}
    own = values["c1"][0]
    values["c1"] = own * FACTORS
    lines = []
    for share, colour in zip(BEGINNINGS, ("second", "measured", "simulated"), strict=True):
        cost = problem.truncated(share).costs(values, fit.settings)
        label = "the whole" if share == 1.0 else f"the first {100 * share:.0f} %"
        lines.append(Line(values["c1"], np.sqrt(cost / cost.max()), label, colour))
    panel = Panel(
        "RMS of the residual\nover its largest",
        tuple(lines),
        f"spring constant in {result.model.parameters['c1'].unit}",
        marks=(Mark(own, "fitted"),),
    )
    return Chart("local minima", (panel,))


def speed_loop(result: Result) -> Chart:
    """Speed loop of the suggested cascade."""
    torque = float(np.abs(result.recordings[0].u).max())
    return loop_chart(design(result.model, torque=torque))


DRAWN: dict[str, Callable[[Result], str]] = {
    "demo": lambda result: picture(kept(result)),
    "demo-narrow": lambda result: picture(kept(result), NARROW),
    "local-minima": lambda result: written(draw([local_minima(result)]), "svg").decode(),
    "speed-loop": lambda result: written(draw([speed_loop(result)]), "svg").decode(),
}


def main() -> None:
    """Identify the demo and draw."""
    PICTURES.mkdir(exist_ok=True)
    found = demo(workers=2)
    for name, drawn in DRAWN.items():
        path = PICTURES / f"{name}.svg"
        path.write_text(drawn(found), encoding="utf-8")
        print(path)
    with TemporaryDirectory() as folder:
        found.write(folder)
        subprocess.run([sys.executable, ROOT / "tools" / "border_picture.py", f"{folder}/model.json"], check=True)


if __name__ == "__main__":
    main()
