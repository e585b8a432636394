"""Units as people write them, and the units of parameters that follow from those of a recording."""

from __future__ import annotations

import math

import pytest

from brightgrey.effects import registry
from brightgrey.errors import RecordingError
from brightgrey.recordings.units.parser import COMMON_UNITS, parse_unit
from brightgrey.recordings.units.signals import KINDS, Units, assumed_unit, base_of, kind_of, motion_unit

SPELLINGS = {
    ("N m", 1.0): ["N m", "Nm", "N*m", "N·m", "N⋅m", "N.m", "N-m", " N  m ", "newton meter", "newton_meter"],
    ("mN m", 1e-3): ["mNm", "mN m"],
    ("kN m", 1e3): ["kNm"],
    ("N mm", 1e-3): ["Nmm", "N mm"],
    ("N cm", 1e-2): ["Ncm"],
    ("lbf in", 0.1129848290276167): ["lbf in", "lb in", "lb-in", "lbin"],
    ("ozf in", 0.1129848290276167 / 16): ["oz in", "ozin", "ozf in"],
    ("rad/s", 1.0): ["rad/s", "rad s-1", "rad s^-1", "rad s⁻¹", "rad·s⁻¹", "rad*s**-1", "radians/second"],
    ("rad/s²", 1.0): ["rad/s²", "rad/s^2", "rad/s**2", "rad/s2", "rad s-2", "rad/s/s", "rad/(s s)"],
    ("deg", math.pi / 180): ["deg", "°", "degree", "degrees", "Grad", "Deg"],
    ("deg/s", math.pi / 180): ["deg/s", "°/s", "dps", "deg per s", "deg_per_s"],
    ("rpm", math.pi / 30): ["rpm", "RPM", "1/min", "U/min", "r/min", "rev/min", "min^-1", "min⁻¹", "min-1"],
    ("rev/s", 2 * math.pi): ["rev/s", "turn/s"],
    ("rps", 2 * math.pi): ["rps", "Rps"],
    ("count", 1.0): ["count", "Ink", "INC", "cnt", "steps", "LSB", "qc"],
    ("pps", 1.0): ["pps"],
    ("A", 1.0): ["A", "Arms", "AMPS"],
    ("rad", 1.0): ["rad", "RAD"],
    ("‰", 1e-3): ["‰", "0.1%", "0,1 %"],
    ("day", 86400.0): ["days"],
    ("Mrad", 1e6): ["Mrad"],
    ("mm/s", 1e-3): ["mm/s", "mm s^-1"],
    ("m/min", 1 / 60): ["m/min"],
    ("µm", 1e-6): ["µm", "μm", "um", "micrometer"],
    ("V", 1.0): ["V", "volt", "volts"],
    ("mA", 1e-3): ["mA", "milliampere"],
    ("%", 1e-2): ["%", "percent", "pct"],
    ("1", 1.0): ["1", "-"],
    ("min", 60.0): ["min", "minute", "Min"],
    ("kg m²", 1.0): ["kg m²", "kg m^2", "kg*m**2"],
    ("g", 9.80665): ["g"],
}


@pytest.mark.parametrize(
    ("spelling", "text", "si"),
    [(spelling, text, si) for (text, si), spellings in SPELLINGS.items() for spelling in spellings],
)
def test_parse_unit__spellings__mean_one_unit(spelling: str, text: str, si: float) -> None:
    unit = parse_unit(spelling)
    assert unit.text == text
    assert unit.si == pytest.approx(si, rel=1e-15)
    assert parse_unit(unit.text) == unit


@pytest.mark.parametrize(
    ("text", "guess"),
    [
        ("Nmx", "N m"),
        ("", None),
        ("[]", None),
        ("/", None),
        ("N//m", None),
        ("N m)", "N m"),
        ("2 N", None),
        ("s^", None),
        ("s^99", None),
        ("__import__('os')", None),
        ("log(3)", None),
    ],
)
def test_parse_unit__unknown__is_refused_with_the_nearest(text: str, guess: str | None) -> None:
    with pytest.raises(RecordingError) as error:
        parse_unit(text)
    message = str(error.value)
    assert "\n" not in message
    assert "rad/s" in message  # what is allowed
    if guess:
        assert f"'{guess}'" in message


def test_parse_unit__ambiguous_denominator__is_refused() -> None:
    with pytest.raises(RecordingError, match="two ways"):
        parse_unit("N/m s")
    assert parse_unit("N/(m s)").dimension != parse_unit("N s/m").dimension


def test_parse_unit__angle__is_a_dimension() -> None:
    assert parse_unit("rad/s").dimension != parse_unit("1/s").dimension
    assert parse_unit("N m").dimension != parse_unit("N m/rad").dimension


def test_parse_unit__common_units__are_known() -> None:
    assert [parse_unit(unit).text for unit in COMMON_UNITS] == list(COMMON_UNITS)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("base", ["rad", "m"])
def test_assumed_unit__kind__fits_no_other_order(kind: str, base: str) -> None:
    unit = parse_unit(assumed_unit(kind, base))
    assert unit.si == 1.0
    assert base_of(unit, kind) == base
    assert [k for k in KINDS if base_of(unit, k)] == [k for k in KINDS if KINDS[k] == KINDS[kind]]
    assert kind_of(unit) == next(k for k in KINDS if KINDS[k] == KINDS[kind])


def test_kind_of__unit_of_no_motion__is_none() -> None:
    for text in ("N m", "1/s", "V", "%", "%/s", "s", "m²"):
        assert kind_of(parse_unit(text)) is None


@pytest.mark.parametrize(
    ("unit", "motion"),
    [
        ("mm/s", "mm"),
        ("deg", "deg"),
        ("rad/s²", "rad"),
        ("rpm", "rad"),
        ("rev/s", "rev"),
        ("m/min", "m"),
        ("g", "m"),
    ],
)
def test_motion_unit__unit_of_an_output__is_its_length_or_angle(unit: str, motion: str) -> None:
    assert motion_unit(parse_unit(unit)) == motion


@pytest.mark.parametrize(
    ("units", "dimension", "text", "factor"),
    [
        (Units("N m", "rad"), (1, -1, 2), "kg m²", 1.0),
        (Units("Nm", "rad"), (1, -1, 2), "kg m²", 1.0),
        (Units("N", "m"), (1, -1, 2), "kg", 1.0),
        (Units("N m", "rad"), (1, -1, 1), "N m s/rad", 1.0),
        (Units("N m", "rad"), (1, -1, 0), "N m/rad", 1.0),
        (Units("N m", "rad"), (0, 1, -1), "rad/s", 1.0),
        (Units("N m", "rad"), (0, 0, 1), "s", 1.0),
        (Units("N m", "rad"), (0, 0, 0), "1", 1.0),
        (Units("V", "mm"), (1, -1, 2), "V s²/mm", 1e-3),
        (Units("V", "mm"), (0, 1, -2), "mm/s²", 1e3),
        (Units("mN m", "deg"), (1, -1, 0), "mN m/deg", 1e3 * math.pi / 180),
        (Units("%", "mm"), (1, 0, 0), "%", 100.0),
        (Units("mV/V", "m"), (1, -1, 2), "mV s²/(V m)", 1e3),
    ],
)
def test_units__parameters__have_the_textbook_unit(
    units: Units, dimension: tuple[int, int, int], text: str, factor: float
) -> None:
    found, value = units.of(dimension)
    assert found == text
    assert value == pytest.approx(factor, rel=1e-14)


@pytest.mark.parametrize("effect", registry().values(), ids=lambda effect: effect.name)
@pytest.mark.parametrize("units", [Units(), Units("N", "mm"), Units("V", "deg")])
def test_units__every_parameter__has_a_unit_that_can_be_parsed(effect, units: Units) -> None:
    for parameter in effect.parameters:
        text, factor = units.of(parameter.dimension)
        assert parse_unit(text).si * factor == pytest.approx(1.0, rel=1e-14)


def test_units__no_motion__is_refused() -> None:
    with pytest.raises(RecordingError, match="neither an angle nor a length"):
        Units("N m", "V")
