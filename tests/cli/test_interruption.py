"""What ends a command early, or before it begins: a signal, closed streams, numbers and folders that are none."""

import signal
import subprocess
import sys
import time

import pytest

from brightgrey.excitation.demo import demo_recording
from brightgrey.runs.store import FILE
from support.small_runs import start

MOST = 60.0  # s until a test has failed
LONG = "four_mass+coulomb+viscous+stribeck+gravity+backlash+current_control+delay"
COLUMNS = ("--input", "torque", "--output", "velocity")


@pytest.fixture
def demo(tmp_path):
    path = tmp_path / "demo.csv"
    path.write_text(demo_recording())
    return path


@pytest.mark.system
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_identify__signal_while_a_given_structure_is_fitted__ends_and_leaves_no_result(demo, tmp_path, number):
    process = start("identify", demo, *COLUMNS, "--structure", LONG, "--out", tmp_path / "out")
    end = time.monotonic() + MOST
    while not (tmp_path / "out" / FILE).exists() and time.monotonic() < end:
        time.sleep(0.05)
    process.send_signal(number)
    _, err = process.communicate(timeout=MOST)
    # A shell sees 130 either way: Python ends by the signal itself if that came while it executed a text (as the
    # code that dataclasses write is), although the program had dealt with it.
    assert process.returncode in ((130, -number) if number == signal.SIGINT else (-number,))
    if number == signal.SIGINT:
        assert err == "brightgrey: interrupted, nothing written\n"
    assert not (tmp_path / "out" / "model.json").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="another signal there")
def test_program__interrupted_while_it_is_loaded__one_line():
    loading = (
        "import sys, os, signal, brightgrey.__main__ as m\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
    )
    # the first module of the command line that is loaded interrupts the program
    finder = "type('F', (), {'find_spec': lambda *a: os.kill(os.getpid(), signal.SIGINT) if 'cli' in a[1] else None})"
    code = f"{loading}sys.meta_path.insert(0, {finder}())\nsys.exit(m.run())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "brightgrey: interrupted, nothing written\n")


@pytest.mark.system
@pytest.mark.skipif(sys.platform == "win32", reason="a shell that closes streams")
def test_identify__closed_output__ends_well(demo, tmp_path):
    words = [sys.executable, "-m", "brightgrey", "identify", str(demo), *COLUMNS, "--structure", "one_mass"]
    command = f"{' '.join(words)} --out {tmp_path / 'out'} >&- 2>&-"
    assert subprocess.run(command, shell=True, check=False).returncode == 0
    assert (tmp_path / "out" / "model.json").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--out", ""), "'--out': it is empty; name a folder"),
        (("--f-tanh", "nan"), "--f-tanh nan: a finite number is expected"),
        (("--input-gain", "inf"), "--input-gain inf: a finite number is expected"),
    ],
)
def test_identify__option_that_is_none__one_line(demo, call, options, message):
    done = call("identify", demo, *COLUMNS, "--structure", "one_mass", *options)
    assert done.code == 2
    assert message in done.err
    assert done.err.count("\n") == 1


def test_fleet__no_axis_can_be_identified__says_why_even_if_quiet(tmp_path, call):
    (tmp_path / "fleet.csv").write_text("recording,input,output\nnone.csv,u,v\n")
    done = call("fleet", tmp_path / "fleet.csv", "--out", tmp_path / "out", "--quiet")
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith("brightgrey: no axis could be identified; none: ")
