"""A small drive, its recording, and one identification of it that many tests look at."""

import contextlib
import io
from types import SimpleNamespace

import numpy as np
import pytest

from brightgrey.cli import main
from brightgrey.kit import PAPER, assemble
from brightgrey.simulation import Settings, response

STRUCTURE = "one_mass+coulomb+viscous"
TRUTH = {"J1": 0.02, "M_C": 0.4, "f_v": 0.05}
NOISE = 0.02


def drive_csv(seed):
    """Recording of a known drive: time in s, torque in N m, speed in rad/s with white noise."""
    t = 0.002 * np.arange(500)
    torque = 2.0 * np.sign(np.sin(2 * np.pi * 2.0 * t)) * np.minimum(1.0, 5 * t)
    system = assemble(PAPER.parse(STRUCTURE), TRUTH, f_tanh=4.0)
    y = response(system, torque, 0.002, system.rest(), Settings(f_tanh=4.0, speed_scale=25.0)).y[0, :, 0]
    y += NOISE * np.random.default_rng(seed).normal(size=t.size)
    rows = [f"{a:.3f},{b:.6f},{c:.6f}\n" for a, b, c in zip(t, torque, y, strict=True)]
    return "t [s],torque [N m],speed [rad/s]\n" + "".join(rows)


def run(*arguments):
    """Run the program in this process; exit code and what it printed."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main([str(a) for a in arguments])
    return SimpleNamespace(code=code, out=out.getvalue(), err=err.getvalue())


@pytest.fixture(scope="session")
def call():
    """Run the program in this process; gives exit code and what it printed."""
    return run


@pytest.fixture(scope="session")
def drive(tmp_path_factory):
    """Folder with two recordings of the drive and the results of one identification."""
    folder = tmp_path_factory.mktemp("drive")
    (folder / "a.csv").write_text(drive_csv(1))
    (folder / "b.csv").write_text(drive_csv(2))
    options = ("--input", "torque", "--output", "speed", "--structure", STRUCTURE, "--f-tanh", "4")
    done = run("identify", folder / "a.csv", *options, "--out", folder / "out")
    assert done.code == 0, done.err
    return SimpleNamespace(
        folder=folder, options=options, out=folder / "out", printed=done.out, truth=TRUTH, noise=NOISE
    )
