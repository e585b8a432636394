"""Short recordings by the reference solver, and the program in this process and in another one."""

import contextlib
import io
import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np

from brightgrey.cli import main
from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.simulation.reference import reference

STRUCTURE = "one_mass+coulomb+viscous"
VALUES = {"J1": 0.02, "M_C": 1.0, "f_v": 0.02}
FILES = ("model.json", "ranking.csv", "report.html")


def recording_csv(values=VALUES, seed=0, samples=600, structure=STRUCTURE):
    """Torque and quantised, noisy velocity of a known drive."""
    u = E.torque()[:samples]
    (y,) = reference(structure, values, u, E.dt, f_tanh=E.f_tanh)
    y = y + 2e-3 * np.abs(y).max() * np.random.default_rng(seed).standard_normal(y.shape)
    y = 1e-3 * np.round(y / 1e-3)
    rows = [f"{k * E.dt:.6f},{a:.9g},{b:.6f}\n" for k, (a, b) in enumerate(zip(u, y, strict=True))]
    return "t [s],torque [N m],velocity [rad/s]\n" + "".join(rows)


def results(folder):
    """Bytes of what has to be the same."""
    return {name: (folder / name).read_bytes() for name in FILES}


def call(*arguments):
    """Run the program in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main([str(a) for a in arguments])
    return SimpleNamespace(code=code, out=out.getvalue(), err=err.getvalue())


def start(*arguments, **how):
    """Start the program in another process."""
    environment = {**os.environ, "MPLBACKEND": "agg"}
    command = [sys.executable, "-m", "brightgrey", *map(str, arguments)]
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **how)
