"""The file format, the exporter and the symptom of CONTRIBUTING.md work in a copy of the package."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

J, FRICTION, VISCOUS, IMBALANCE, F_TANH, NOISE, DT = 0.02, 0.1, 0.01, 0.05, 4.0, 0.02, 0.004

pytestmark = pytest.mark.xdist_group("extended package")  # one copy, compiled once


@pytest.fixture(scope="module")
def archive(extended):
    """NumPy archive of a drive with a load out of balance: J v' = u - friction - IMBALANCE sin(q), solved by scipy."""
    t = DT * np.arange(1000)
    u = (np.sin(2.0 * np.pi * 0.5 * t) + 0.8 * np.sin(2.0 * np.pi * 1.3 * t)) * (t > 0.05)

    def rate(at, x):
        q, v = x
        torque = np.interp(at, t, u) - FRICTION * np.tanh(F_TANH * v) - VISCOUS * v - IMBALANCE * np.sin(q)
        return v, torque / J

    v = solve_ivp(rate, (0.0, t[-1]), [0.0, 0.0], t_eval=t, max_step=DT / 2, rtol=1e-8, atol=1e-8).y[1]
    noise = NOISE * np.random.default_rng(0).normal(size=t.size)
    np.savez(extended.folder / "run.npz", t=t, torque=u, speed=v + noise, gain=np.array([3.0]))
    return "run.npz"


@pytest.fixture(scope="module")
def printed(extended, archive):
    """What `identify` prints of the archive, with a structure that lacks the imbalance."""
    columns = (
        "--input",
        "torque",
        "--output",
        "speed",
        "--unit",
        "t=s",
        "--unit",
        "torque=N m",
        "--unit",
        "speed=rad/s",
    )
    structure = ("--structure", "one_mass+coulomb+viscous", "--f-tanh", F_TANH, "--workers", 2)
    return extended("-m", "brightgrey", "identify", archive, *columns, *structure, "--out", "balance")


def test_new_file_format__archive__is_identified(extended, printed):
    model = json.loads((extended.folder / "balance" / "model.json").read_text(encoding="utf-8"))
    assert model["signals"][0]["name"] == "torque"
    assert model["initial_state"][0]["recording"] == "run.npz"


def test_new_file_format__unknown_array__nearest_is_named(extended, archive):
    code = (
        "from brightgrey import RecordingError, read_recording\n"
        f"try: read_recording('{archive}', input='torqe', outputs='speed')\n"
        "except RecordingError as error: print(error)"
    )
    assert "unknown column 'torqe'. Did you mean 'torque'?" in extended("-c", code)


def test_new_symptom__residual_of_an_imbalance__is_reported(printed):
    assert "Load out of balance" in printed


def test_new_exporter__model__is_written_and_checked(extended, printed):
    said = extended("-m", "brightgrey", "export", "balance/model.json", "--to", "json", "--out", "exported")
    assert "json, read back" in said
    content = json.loads((extended.folder / "exported" / "drive.json").read_text(encoding="utf-8"))
    assert np.shape(content["A"]) == (len(content["states"]),) * 2
