"""A fleet of simulated axes with broken files and axes that differ."""

import csv
import json

import numpy as np
import pytest

from brightgrey.api.fleet.manifest import read_manifest
from brightgrey.errors import SettingsError
from brightgrey.excitation import PAPER_EXPERIMENT as E
from support.small_runs import STRUCTURE, VALUES, call, recording_csv

SPREAD = 0.03  # of the siblings' parameters


def build(folder, count, broken, different, seed):
    """Axes alike but for `SPREAD`; `different` ones have their own factors, `broken` ones unusable files."""
    rng = np.random.default_rng(seed)
    damage = [
        lambda text: text[:200],
        lambda text: text.replace("velocity", "speed"),
        lambda text: "\x00\xff not a recording",
    ]
    rows = ["name,recording"]
    for number in range(count):
        values = {name: value * np.exp(SPREAD * rng.standard_normal()) for name, value in VALUES.items()}
        for name, factor in different.get(number, {}).items():
            values[name] *= factor
        text = recording_csv(values, seed=1000 * seed + number)
        if number in broken:
            text = damage[broken.index(number) % 3](text)
        (folder / f"axis{number:02d}.csv").write_text(text, encoding="latin-1")
        rows.append(f"axis{number:02d},axis{number:02d}.csv")
    (folder / "fleet.csv").write_text("\n".join(rows) + "\n")
    return folder / "fleet.csv"


def run(manifest, out, *more):
    columns = ("--input", "torque", "--output", "velocity", "--f-tanh", repr(E.f_tanh))
    return call("fleet", manifest, *columns, "--structure", STRUCTURE, "--out", out, *more)


def check(folder, out, count, broken, different):
    rows = list(csv.DictReader((out / "summary.csv").read_text().splitlines()))
    assert [row["name"] for row in rows] == [f"axis{n:02d}" for n in range(count)]
    failed = [n for n, row in enumerate(rows) if row["state"] == "failed"]
    assert failed == list(broken)
    assert all(f"axis{n:02d}.csv" in rows[n]["error"] for n in broken)
    assert not any(row["error"] for n, row in enumerate(rows) if n not in broken)
    for n, row in enumerate(rows):
        if n not in broken:
            model = json.loads((out / f"axis{n:02d}" / "model.json").read_text())
            assert float(row["J1"]) == model["parameters"]["J1"]["value"]
    flagged = {n: row["differs"] for n, row in enumerate(rows) if row["differs"]}
    assert set(flagged) == set(different)
    for n, factors in different.items():
        assert all(name in flagged[n] for name in factors)


def test_fleet__two_axes__too_few_to_compare(tmp_path):
    manifest = build(tmp_path, 2, (), {1: {"M_C": 1.6}}, seed=1)
    done = run(manifest, tmp_path / "out")
    assert "2 of 2 axes identified, 0 failed, too few to say which one differs" in done.out


def test_a_fleet_with_broken_and_different_axes(tmp_path):
    broken, different = (2, 5, 9), {3: {"M_C": 1.6}, 7: {"J1": 1.5}}
    manifest = build(tmp_path, 13, broken, different, seed=1)
    done = run(manifest, tmp_path / "out")
    assert done.code == 0, done.err
    assert "10 of 13 axes identified, 3 failed, 2 differ" in done.out
    check(tmp_path, tmp_path / "out", 13, broken, different)
    before = (tmp_path / "out" / "summary.csv").read_bytes()
    assert run(manifest, tmp_path / "out", "--quiet").code == 0
    assert (tmp_path / "out" / "summary.csv").read_bytes() == before


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
def test_a_fleet_of_fifty(tmp_path, seed):
    broken, different = (4, 17, 33), {11: {"M_C": 1.6}, 40: {"J1": 1.5, "f_v": 2.0}}
    manifest = build(tmp_path, 50, broken, different, seed)
    done = run(manifest, tmp_path / "out")
    assert done.code == 0, done.err
    assert "47 of 50 axes identified, 3 failed, 2 differ" in done.out
    check(tmp_path, tmp_path / "out", 50, broken, different)


@pytest.mark.long
def test_a_searched_fleet_is_compared_by_the_structure_found_most_often(tmp_path):
    manifest = build(tmp_path, 4, (), {}, seed=3)
    rows = manifest.read_text().splitlines()
    (tmp_path / "fleet.toml").write_text(
        "\n".join(
            f"[[axis]]\nname = '{name}'\nrecording = '{file}'\ninput = 'torque'\noutput = ['velocity']\n"
            for name, file in (row.split(",") for row in rows[1:])
        )
    )
    without = [o for e in ("two_mass", "stribeck", "current_control", "delay", "gravity") for o in ("--exclude", e)]
    options = (*without, "--f-tanh", repr(E.f_tanh), "--out", tmp_path / "out")
    done = call("fleet", tmp_path / "fleet.toml", *options, "--json")
    assert done.code == 0, done.err
    assert [row["name"] for row in json.loads(done.out)] == [f"axis{n:02d}" for n in range(4)]
    assert all(row["error"] is None and row["differs"] == [] for row in json.loads(done.out))
    rows = list(csv.DictReader((tmp_path / "out" / "summary.csv").read_text().splitlines()))
    assert all(row["J1"] and row["M_C"] for row in rows)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "names no axis"),
        ("recording,colour\na.csv,red\n", "unknown column 'colour'"),
        ("recording\na.csv\nb/a.csv\n", "stands more than once"),
        ("name,recording\n../x,a.csv\n", "no name of a folder"),
        ("name,recording\nx\n", "row 2"),
        ("recording,dt\na.csv,fast\n", "dt 'fast' is not a number"),
    ],
)
def test_wrong_manifests_are_refused(tmp_path, text, said):
    (tmp_path / "fleet.csv").write_text(text)
    with pytest.raises(SettingsError, match=said):
        read_manifest(tmp_path / "fleet.csv")


def test_manifest__files_beside_a_recording__are_those_beside_the_manifest(tmp_path):
    (tmp_path / "fleet.csv").write_text("recording, beside\na/u.csv, a/v.csv; a/w.csv\n")
    (axis,) = read_manifest(tmp_path / "fleet.csv")
    assert axis.options["beside"] == [str(tmp_path / "a" / "v.csv"), str(tmp_path / "a" / "w.csv")]


def test_a_manifest_in_csv(tmp_path):
    (tmp_path / "fleet.csv").write_text("name, recording, output, dt\nx, a.csv; b.csv, v:velocity; a, 0.001\n")
    (axis,) = read_manifest(tmp_path / "fleet.csv")
    assert axis.recordings == (tmp_path / "a.csv", tmp_path / "b.csv")
    assert axis.options == {"output": ["v:velocity", "a"], "dt": 0.001}
