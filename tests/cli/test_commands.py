"""The commands as a user meets them."""

import csv
import json
import subprocess
import sys

import numpy as np
import pytest

import brightgrey
from brightgrey.effects import registry

STRUCTURE = "one_mass+coulomb+viscous"
RESULTS = {"model.json", "ranking.csv", "report.html", "fit.svg", "run.json"}
RUN = {"run.sqlite", "run.lock"}


def model_of(folder):
    return json.loads((folder / "model.json").read_text(encoding="utf-8"))


def test_identify_finds_the_drive(drive):
    assert {p.name for p in drive.out.iterdir()} == RESULTS | RUN
    model = model_of(drive.out)
    assert model["structure"] == STRUCTURE.split("+")
    for name, truth in drive.truth.items():
        part = model["parameters"][name]
        # Normal errors stay within five standard deviations in all but 6e-7 of the seeds.
        assert abs(part["value"] - truth) < 5 * part["std"]
        assert part["at_bound"] is None
    assert model["parameters"]["J1"]["unit"] == "kg m²"
    # 497 degrees of freedom: RMSE is the noise within 1/sqrt(2·497) = 3.2 %, here five times that.
    assert model["fit"]["train"]["speed"]["rmse"] == pytest.approx(drive.noise, rel=0.16)
    assert model["fit"]["test"] is None
    assert model["settings"]["friction_width"] == pytest.approx(0.25, rel=1e-12)
    assert model["settings"]["friction_width_ci95"] is None


def test_ranking_has_the_one_structure(drive):
    (row,) = csv.DictReader((drive.out / "ranking.csv").read_text(encoding="utf-8").splitlines())
    model = model_of(drive.out)
    assert (row["rank"], row["structure"], row["n_parameters"]) == ("1", STRUCTURE, "3")
    assert float(row["rss"]) == model["fit"]["train"]["speed"]["rss"]
    assert float(row["fit_percent"]) == model["fit"]["train"]["speed"]["fit_percent"]
    assert float(row["criterion"]) == model["criterion"]["value"]


def test_terminal_shows_parameters_fit_and_files(drive):
    for word in (*drive.truth, "kg m²", "N m s/rad", "±", "speed", "rad/s", "report.html"):
        assert word in drive.printed
    assert max(map(len, drive.printed.splitlines()[:-1])) <= 120


def test_same_seed_gives_same_bytes(drive, tmp_path, call):
    done = call("identify", drive.folder / "a.csv", *drive.options, "--workers", 2, "--out", tmp_path, "--quiet")
    assert (done.code, done.out, done.err) == (0, "", "")
    for name in RESULTS:
        assert (tmp_path / name).read_bytes() == (drive.out / name).read_bytes()


def test_json_is_the_model(drive, tmp_path, call):
    done = call("identify", drive.folder / "a.csv", *drive.options, "--out", tmp_path, "--json")
    assert json.loads(done.out) == model_of(tmp_path)


def test_all_options_at_once(drive, tmp_path, call):
    done = call(
        *("identify", drive.folder / "a.csv", drive.folder / "b.csv", *drive.options),
        *("--output", "speed:velocity", "--time", "t", "--input-gain", "-1", "--fix", "f_v=0.05")[2:],
        *("--bound", "M_C=0.1:1", "--window", "0:0.9", "--decimate", "2", "--hold", "linear"),
        *("--test-recording", drive.folder / "b.csv", "--start", drive.out / "model.json"),
        *("--unit", "torque=mN m", "--seed", "3", "--no-check", "--out", tmp_path / "deep" / "out"),
    )
    assert done.code == 0, done.err
    model = model_of(tmp_path / "deep" / "out")
    assert model["settings"]["fixed"] == {"f_v": pytest.approx(0.05, rel=1e-12)}
    assert model["settings"]["bounds"]["M_C"] == pytest.approx([0.1, 1.0], rel=1e-12)
    assert model["settings"]["sampling_time"] == pytest.approx(0.004)
    assert model["signals"][0] | {"sampling_time": 0} == {
        "name": "torque",
        "kind": "input",
        "unit": "mN m",
        "gain": -1.0,
        "sampling_time": 0,
        "hold": "linear",
        "mass": 1,
    }
    assert len(model["initial_state"]) == 2
    assert set(model["fit"]["test"]) == {"speed"}
    assert model["seed"] == 3


def test_bounds_and_values_stand_in_the_recordings_units(drive, tmp_path, call):
    lines = (drive.folder / "a.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    degrees = "\n".join(f"{a},{1e3 * float(b)},{np.rad2deg(float(c)):.5f}" for a, b, c in rows)
    (tmp_path / "deg.csv").write_text("t [s],torque [mN m],speed [deg/s]\n" + degrees + "\n")
    f_tanh = 4 * np.pi / 180
    done = call(
        *(
            "identify",
            tmp_path / "deg.csv",
            "--input",
            "torque",
            "--output",
            "speed",
            "--structure",
            STRUCTURE,
        ),
        *("--f-tanh", f_tanh, "--bound", "M_C=100:1000", "--out", tmp_path / "out"),
    )
    assert done.code == 0, done.err
    model, expected = model_of(tmp_path / "out"), model_of(drive.out)
    factors = {"J1": 1e3 * np.pi / 180, "M_C": 1e3, "f_v": 1e3 * np.pi / 180}
    units = {"J1": "mN m s²/deg", "M_C": "mN m", "f_v": "mN m s/deg"}
    for name, factor in factors.items():
        part, other = model["parameters"][name], expected["parameters"][name]
        assert part["unit"] == units[name]
        # The same optimum, reached from other numbers: far within its uncertainty.
        assert part["value"] / factor == pytest.approx(other["value"], abs=0.05 * other["std"])
        assert part["std"] / factor == pytest.approx(other["std"], rel=0.05)
    assert model["settings"]["friction_width"] == pytest.approx(1.0 / f_tanh, rel=1e-12)
    assert model["settings"]["friction_width_unit"] == "deg/s"


def test_simulate_gives_the_fit_of_the_identification(drive, tmp_path, call):
    csv_file = tmp_path / "sim.csv"
    done = call("simulate", drive.out / "model.json", drive.folder / "a.csv", "--json", "--out", csv_file)
    assert done.code == 0, done.err
    fit = model_of(drive.out)["fit"]["train"]["speed"]
    assert json.loads(done.out)["speed"] == pytest.approx(fit, rel=1e-6)
    table = np.genfromtxt(csv_file, delimiter=",", names=True)
    residual = table["speed_rads"] - table["speed_simulated_rads"]
    assert np.sum(residual**2) == pytest.approx(fit["rss"], rel=1e-6)


def test_simulate_on_another_recording(drive, call):
    done = call("simulate", drive.out / "model.json", drive.folder / "b.csv")
    assert done.code == 0
    assert "b.csv" in done.out
    assert "rad/s" in done.out


def test_simulate_minds_the_units_of_the_header(drive, tmp_path, call):
    text = (drive.folder / "a.csv").read_text().replace("rad/s", "deg/s", 1)
    (tmp_path / "deg.csv").write_text(text)
    done = call("simulate", drive.out / "model.json", tmp_path / "deg.csv")
    assert done.code == 2
    assert "deg/s" in done.err
    assert "rad/s" in done.err
    done = call("simulate", drive.out / "model.json", tmp_path / "deg.csv", "--unit", "speed=rad/s", "--json")
    fit = model_of(drive.out)["fit"]["train"]["speed"]
    assert json.loads(done.out)["speed"] == pytest.approx(fit, rel=1e-6)


def test_effects_lists_the_registry(call):
    shown = call("effects")
    listed = json.loads(call("effects", "--json").out)
    assert [row["name"] for row in listed] == list(registry())
    for effect, row in zip(registry().values(), listed, strict=True):
        assert effect.equation == row["equation"]
        assert effect.equation in " ".join(shown.out.split())  # lines are broken at the terminal's width
        assert [p["name"] for p in row["parameters"]] == [p.symbol for p in effect.parameters]


@pytest.mark.parametrize("command", ["identify", "effects", "simulate"])
def test_narrow_window_cuts_nothing(drive, tmp_path, monkeypatch, command, call):
    monkeypatch.setenv("COLUMNS", "40")
    arguments = {
        "identify": (drive.folder / "a.csv", *drive.options, "--out", tmp_path),
        "effects": (),
        "simulate": (drive.out / "model.json", drive.folder / "a.csv"),
    }[command]
    shown = call(command, *arguments).out
    lines = [line for line in shown.splitlines() if not line.startswith("Results are in")]
    assert max(map(len, lines)) <= 40
    assert "…" not in shown


def test_version_and_module(call):
    assert call("--version").out == f"brightgrey {brightgrey.__version__}\n"
    done = subprocess.run([sys.executable, "-m", "brightgrey", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"brightgrey {brightgrey.__version__}\n"


def test_terminal_that_knows_ascii_only(monkeypatch):
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    done = subprocess.run([sys.executable, "-m", "brightgrey", "effects"], capture_output=True, check=True)
    assert done.stdout.isascii()
    assert done.stderr == b""


def test_reader_that_stops_early():
    with subprocess.Popen(
        [sys.executable, "-m", "brightgrey", "effects", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as program:
        program.stdout.close()
        assert program.stderr.read() == b""


def test_identify_searches_for_the_structure(drive, tmp_path, call):
    few = ("--population", 6, "--generations", 2, "--iterations", 10, "--elite", 1)
    search = ("--search", "genetic", "--criterion", "bic", *few, "--decimate", 4)
    options = [o for o in drive.options if o not in ("--structure", STRUCTURE)]
    for folder, workers in (("one", 1), ("two", 2)):
        arguments = (drive.folder / "a.csv", *options, *search, "--workers", workers, "--out", tmp_path / folder)
        done = call("identify", *arguments)
        assert done.code == 0, done.err
    names = {p.name for p in (tmp_path / "one").iterdir()} - RUN
    assert names == RESULTS | {"history.csv"}
    assert all((tmp_path / "one" / n).read_bytes() == (tmp_path / "two" / n).read_bytes() for n in names)
    rows = list(csv.DictReader((tmp_path / "one" / "ranking.csv").read_text(encoding="utf-8").splitlines()))
    model = model_of(tmp_path / "one")
    assert rows[0]["structure"].split("+") == model["structure"]
    assert float(rows[0]["rss"]) == model["fit"]["train"]["speed"]["rss"]
    assert float(rows[0]["criterion"]) == model["criterion"]["value"]
    assert model["criterion"]["name"] == "bic"
    assert len({row["structure"] for row in rows}) == len(rows) > 6
    values = [float(row["criterion"]) for row in rows]
    assert values == sorted(values, reverse=True)
    assert model["evidence"] is None
    assert "structures tried" in done.out


def test_a_search_takes_no_start_model(drive, call, tmp_path):
    options = [o for o in drive.options if o not in ("--structure", STRUCTURE)]
    search = ("--search", "genetic", "--start", drive.out / "model.json", "--out", tmp_path)
    done = call("identify", drive.folder / "a.csv", *options, *search)
    assert done.code == 2
    assert "without a structure" in done.err


def test_reproduce(tmp_path, call):
    small = ("--generations", 1, "--iterations", 2, "--population", 3)
    done = call("reproduce", "--seeds", 2, *small, "--out", tmp_path)
    assert done.code == 0, done.err
    assert {p.name for p in tmp_path.iterdir()} == {
        *("figure6.png", "figure7.png", "figure8.png", "figure9.png"),
        *("runs.csv", "generations.csv", "history.csv"),
    }
    rows = list(csv.DictReader((tmp_path / "generations.csv").read_text(encoding="utf-8").splitlines()))
    assert [(row["seed"], row["generation"]) for row in rows] == [("0", "0"), ("0", "1"), ("1", "0"), ("1", "1")]
    assert "of 2 runs" in done.out


def test_no_verdict_on_what_was_not_asked(drive, call, tmp_path):
    """All structures tried have what is required, and nothing else is left to try."""
    others = ("two_mass", "stribeck", "gravity", "backlash", "current_control", "delay")
    asked = [word for name in others for word in ("--exclude", name)] + ["--require", "coulomb", "--require", "viscous"]
    file = drive.folder / "a.csv"
    done = call("identify", file, "--input", "torque", "--output", "speed", *asked, "--out", tmp_path / "out")
    assert done.code == 0
    assert "One structure tried." in done.out
    assert "reason" not in done.out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--search", "genetics"), "Did you mean 'genetic'"),
        (("--search", "genetic", "--structure", STRUCTURE), "--structure cannot be combined with --search"),
        (("--structure", STRUCTURE, "--k-p", 1), "--k-p belongs to a search"),
        (("--search", "genetic", "--mutation", "points=0.1"), "Did you mean 'point'"),
        (("--search", "genetic", "--mutation", "point"), "NAME=PROBABILITY"),
        (("--search", "genetic", "--population", 0), "population is 0"),
        (("--search", "genetic", "--preset", "tune"), "Did you mean 'tuned'"),
    ],
)
def test_wrong_searches(drive, call, options, message):
    done = call("identify", drive.folder / "a.csv", "--input", "torque", "--output", "speed", *options)
    assert done.code == 2
    assert message in done.err
