"""model.json: what goes out comes back, and what is wrong in it is named."""

import copy
import json
import pickle
import re
from pathlib import Path

import pytest

from brightgrey.errors import BrightgreyError, SettingsError
from brightgrey.model.model import Model, load_model
from support.models import random_model

DOC = Path(__file__).parents[2] / "docs" / "reference" / "model-json.md"


@pytest.fixture(scope="module")
def example():
    """The example in the documentation."""
    blocks = map(json.loads, re.findall(r"```json\n(.*?)```", DOC.read_text(encoding="utf-8"), re.DOTALL))
    return next(block for block in blocks if "schema" in block)


def linear_axis(example):
    """The same model of a voltage-driven linear axis in mm."""
    data = copy.deepcopy(example)
    units = {"J1": "V s²/mm", "M_C": "V", "f_v": "V s/mm"}
    for name, unit in units.items():
        data["parameters"][name]["unit"] = unit
    data["signals"][0]["unit"] = "V"
    data["signals"][1]["unit"] = "mm/s"
    data["settings"] |= {"friction_width_unit": "mm/s", "speed_scale_unit": "mm/s"}
    return data


def test_model__documented_example__is_read_and_written_unchanged(example):
    model = Model.check(example)
    assert str(model.structure) == "one_mass+coulomb+viscous"
    assert json.loads(model.text()) == example


def test_model__fields__are_those_of_the_documentation_in_order(example):
    table = re.findall(r"^\| `(\w+)` \| ", DOC.read_text(encoding="utf-8").partition("\n## ")[0], re.MULTILINE)
    assert table == list(example) == list(json.loads(Model.check(example).text()))


def test_model__saved_and_loaded__is_equal(example, tmp_path):
    model = Model.check(example)
    model.save(tmp_path / "model.json")
    again = load_model(tmp_path / "model.json")
    assert again == model
    assert again.text() == (tmp_path / "model.json").read_text(encoding="utf-8")
    assert list(tmp_path.iterdir()) == [tmp_path / "model.json"]


def test_load__schema_1_without_certificate__still_read(example, tmp_path):
    old = {name: part for name, part in example.items() if name != "certificate"} | {"schema": "brightgrey/model/1"}
    (tmp_path / "model.json").write_text(json.dumps(old), encoding="utf-8")
    model = load_model(tmp_path / "model.json")
    assert model.certificate is None
    assert model.values_si() == Model.check(example).values_si()


def test_model__linear_axis_in_mm__gives_values_and_settings_in_si(example):
    model = Model.check(linear_axis(example))
    # V s²/mm = 1000 V s²/m, and so on; V stays.
    assert model.values_si() == pytest.approx({"J1": 11.9, "M_C": 0.897, "f_v": 15.1}, rel=1e-12)
    settings = model.settings_si()
    assert settings.f_tanh == pytest.approx(2500.0, rel=1e-12)
    assert settings.speed_scale == pytest.approx(0.04, rel=1e-12)
    assert settings.f_tanh * settings.speed_scale == pytest.approx(100.0, rel=1e-12)


def test_model__gain_of_the_sign_in_an_earlier_file__becomes_the_width(example):
    settings = {k: v for k, v in example["settings"].items() if not k.startswith("friction_width")}
    model = Model.check(example | {"settings": settings | {"f_tanh": 2.5, "f_tanh_unit": "s/rad"}})
    assert model.settings.friction_width == pytest.approx(0.4, rel=1e-12)
    assert model.settings.friction_width_unit == "rad/s"
    assert model.settings.friction_width_ci95 is None


def changed(example, path, value):
    """Copy of `example` with another value at `path`; ... removes the field."""
    data = copy.deepcopy(example)
    *steps, last = path
    part = data
    for step in steps:
        part = part[step]
    if value is ...:
        del part[last]
    else:
        part[last] = value
    return data


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (["parameters", "J1", "value"], -0.01, ["'parameters.J1.value'", "always positive"]),
        (["parameters", "J1", "std"], -0.01, ["'parameters.J1.std'", "-0.01"]),
        (["parameters", "J1", "ci95"], [2.0, 1.0], ["'parameters.J1.ci95'", "low end is above"]),
        (["settings", "bounds"], {"J1": [2.0, 1.0]}, ["'settings.bounds.J1'", "low end is above"]),
        (["settings", "sampling_time"], 0.0, ["'settings.sampling_time'", "greater than 0"]),
        (["settings", "substeps"], 0, ["'settings.substeps'"]),
        (["signals", 1, "unit"], "%", ["'%' of the motion"]),
        (["signals", 0, "gain"], 0.0, ["'signals.0.gain'", "must not be 0"]),
        (["signals", 0, "name"], "\ud800", ["no character"]),
        (["schema"], "brightgrey/model/3", ["'brightgrey/model/3'", "'brightgrey/model/2'"]),
        (["schema"], ..., ["no field 'schema'"]),
        (["signals"], ..., ["'signals'", "missing"]),
        (["parameter"], {}, ["unknown field 'parameter'", "'parameters'"]),
        (["structure"], ["one_mas", "coulomb", "viscous"], ["'structure'", "'one_mas'", "'one_mass'"]),
        (["structure"], ["coulomb", "viscous"], ["'structure'", "exactly one"]),
        (["structure"], ["one_mass", "coulomb"], ["parameter 'f_v'", "Allowed: J1, M_C"]),
        (["parameters", "J1"], ..., ["'parameters.J1'", "missing", "one_mass+coulomb+viscous"]),
        (["parameters", "J1", "value"], "heavy", ["'parameters.J1.value'", "'heavy'"]),
        (["parameters", "J1", "value"], None, ["'parameters.J1.value'"]),
        (["parameters", "J1", "at_bound"], "hgih", ["'parameters.J1.at_bound'", "'hgih'"]),
        (["parameters", "J1", "unit"], "g m²", ["'parameters.J1.unit'", "'g m²'", "'kg m²'"]),
        (["parameters", "J1", "unti"], "kg", ["unknown field 'parameters.J1.unti'"]),
        (["signals", 0, "kind"], "velocity", ["'signals'", "input comes first"]),
        (["signals", 1, "kind"], "velocty", ["'velocty'", "velocity"]),
        (["signals", 1, "unit"], "furlong", ["'furlong'"]),
        (["signals", 1, "hold"], "cubic", ["'signals.1.hold'", "'cubic'"]),
        (["settings", "friction_width_unit"], "mm/s", ["'settings.friction_width_unit'", "'mm/s'", "'rad/s'"]),
        (["settings", "friction_width"], -1.0, ["friction_width", "greater than or equal to 0"]),
        (["settings", "level"], "exact", ["'settings.level'", "'exact'"]),
        (["settings", "substeps"], 0, ["substeps"]),
        (["seed"], 1.5, ["'seed'", "1.5"]),
    ],
)
def test_load__wrong_field__is_named_in_one_line(example, tmp_path, path, value, words):
    file = tmp_path / "model.json"
    file.write_text(json.dumps(changed(example, path, value)), encoding="utf-8")
    with pytest.raises(BrightgreyError) as caught:
        load_model(file)
    message = str(caught.value)
    assert "\n" not in message
    assert "model.json" in message
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "line 1 column 1"),
        (b'{"schema": ', "line 1 column 12"),
        (b"[1, 2]", "JSON object"),
        (b"\xff\xfe\x00\x01", "not text"),
        (b'{"schema": NaN}', "NaN"),
        (b"[" * 5000 + b"]" * 5000, "nested too deeply"),
    ],
)
def test_load__other_file__is_refused(tmp_path, content, words):
    file = tmp_path / "other"
    file.write_bytes(content)
    with pytest.raises(SettingsError, match=words):
        load_model(file)


def test_load__missing_file_or_folder__is_refused(tmp_path):
    with pytest.raises(SettingsError, match="no model file"):
        load_model(tmp_path / "model.json")
    with pytest.raises(SettingsError, match="cannot read"):
        load_model(tmp_path)


def test_model__is_frozen(example):
    model = Model.check(example)
    with pytest.raises(ValueError, match="frozen"):
        model.seed = 1


def test_model__changes__are_refused():
    model = random_model("two_mass+coulomb", 1)
    changes = (
        lambda: model.parameters.pop("J1"),
        lambda: model.parameters.update(J1=model.parameters["J2"]),
        lambda: model.settings.bounds.__setitem__("J1", (0.0, 1.0)),
        lambda: model.settings.fixed.__ior__({"J1": 1.0}),
        lambda: model.fit.train.clear(),
    )
    for change in changes:
        with pytest.raises(TypeError, match="a model cannot be changed"):
            change()
    for copied in (pickle.loads(pickle.dumps(model)), copy.deepcopy(model), Model.check(model.model_dump(mode="json"))):
        assert copied == model
        assert hash(copied) == hash(model)
        with pytest.raises(TypeError, match="a model cannot be changed"):
            copied.parameters.clear()
