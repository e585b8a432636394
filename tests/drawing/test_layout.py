"""Layouts of 300 random drives: nothing overlaps, everything is inside, and every effect is there once."""

import xml.etree.ElementTree as ET
from collections import Counter
from functools import cache

import numpy as np
import pytest
from matplotlib import get_data_path
from matplotlib.ft2font import FT2Font, LoadFlags

from brightgrey.drawing.drive import ValueText, drive_of
from brightgrey.drawing.items import Label, PlacedSymbol, Wire
from brightgrey.drawing.layout import lay_out
from brightgrey.drawing.svg import svg
from brightgrey.drawing.text_width import WIDTHS
from brightgrey.kit import Structure
from support.drawn_drives import random_drive

SVG = "{http://www.w3.org/2000/svg}"
WIDTH_OF_PAGES = (376.0, 640.0, 1100.0)
SEEDS = range(300)


@cache
def laid_out(seed, *width):
    return lay_out(random_drive(seed)[1], *width)


def overlapping(items, others, margin=0.0):
    """Pairs of items whose boxes share more than their edges, those of the first with a margin cut off."""
    a = np.array([item.box for item in items]).reshape(-1, 1, 4) + margin * np.array([1.0, 1.0, -1.0, -1.0])
    b = np.array([item.box for item in others]).reshape(1, -1, 4)
    shared = np.minimum(a[..., 2:], b[..., 2:]) - np.maximum(a[..., :2], b[..., :2])
    return [(items[i], others[j]) for i, j in np.argwhere((shared > 1e-6).all(axis=-1)) if items[i] is not others[j]]


@pytest.mark.parametrize("width", WIDTH_OF_PAGES)
def test_layout__of_random_drives__has_no_overlap_and_stays_inside(width):
    for seed in SEEDS:
        layout = laid_out(seed, width)
        labels, symbols, wires = ([i for i in layout.items if isinstance(i, k)] for k in (Label, PlacedSymbol, Wire))
        assert overlapping([*labels, *symbols], [*labels, *symbols]) == [], seed
        assert overlapping(labels, wires) == [], seed
        assert overlapping(symbols, wires, margin=1.0) == [], seed
        left, top, right, bottom = np.array([item.box for item in layout.items]).T
        assert min(left.min(), top.min()) >= 0.0, seed
        assert right.max() <= layout.width, seed
        assert bottom.max() <= layout.height, seed


@pytest.mark.parametrize("width", WIDTH_OF_PAGES)
def test_layout__is_no_wider_than_asked(width):
    assert max(laid_out(seed, width).width for seed in SEEDS) <= width


def test_layout__has_the_symbol_of_every_effect_once_at_its_place():
    for seed in SEEDS:
        structure, drive = random_drive(seed)
        layout = laid_out(seed)
        shown = Counter(i.effect for i in layout.items if isinstance(i, PlacedSymbol) and i.effect)
        for placed in structure.beside:
            assert shown[str(placed)] == len(placed.effect.symbols) == 1, (seed, placed)
        chain = next(p for p in drive.parts if p.symbol.at == "body").effect
        assert shown[chain] == drive.masses + 2 * (drive.masses - 1)
        letters = [i.letters.rstrip("?") for i in layout.items if isinstance(i, PlacedSymbol) and i.effect == chain]
        assert [x for x in letters if x] == [str(i + 1) for i in range(drive.masses)]


def test_svg__is_well_formed_repeatable_and_loads_nothing():
    for seed in SEEDS:
        text = svg(laid_out(seed, 640.0))
        assert text == svg(lay_out(random_drive(seed)[1], 640.0))
        root = ET.fromstring(text)
        assert root.tag == f"{SVG}svg"
        assert root.find(f"{SVG}title").text
        assert root.find(f"{SVG}desc").text
        words = text.replace("http://www.w3.org/2000/svg", "")
        assert not [bad for bad in ("http", "href", "url(", "@import", "<script", "<image") if bad in words]


def test_svg__has_every_value_as_text():
    for seed in SEEDS:
        drive = random_drive(seed)[1]
        root = ET.fromstring(svg(laid_out(seed, 376.0)))
        texts = " ".join("".join(e.itertext()) for e in root.iter(f"{SVG}text"))
        for part in drive.parts:
            for _, value in part.values:
                assert value is None or f"= {value.value}" in texts
                assert value is None or not value.half_width or f"± {value.half_width}" in texts


def test_undecided_effects__are_dashed():
    for seed in SEEDS:
        drive = random_drive(seed)[1]
        dashed = {i.effect for i in laid_out(seed).items if isinstance(i, PlacedSymbol) and i.dashed and i.effect}
        assert dashed == {part.effect for part in drive.parts if part.undecided}


def test_text_width__is_that_of_the_font():
    font = FT2Font(f"{get_data_path()}/fonts/ttf/DejaVuSans.ttf")
    for character, width in WIDTHS.items():
        glyph = font.load_char(ord(character), flags=LoadFlags.NO_SCALE)
        exact = 1000.0 * glyph.horiAdvance / font.units_per_EM
        assert exact <= width < exact + 1.0, character


def test_wires__that_lead_to_undecided_parts_only__are_dashed():
    structure = Structure.parse("two_mass+coulomb+viscous@2")
    layout = lay_out(drive_of(structure, undecided=["two_mass", "viscous@2", "ground_spring"]))
    first = next(i for i in layout.items if isinstance(i, PlacedSymbol) and i.symbol.at == "body")
    axis = 0.5 * (first.box[1] + first.box[3])
    along = [i for i in layout.items if isinstance(i, Wire) and i.y1 == i.y2 == axis]
    assert [wire.dashed for wire in along] == [wire.x1 >= first.box[2] for wire in along]
    assert len(along) > 4
    stems = [i for i in layout.items if isinstance(i, Wire) and i.x1 == i.x2 and i.y1 >= first.box[3]]
    assert [stem.dashed for stem in stems] == [False, True, True]  # to Coulomb friction, beyond it, below mass 2


def test_input_on_another_mass__its_letter_stands_at_both_ends():
    layout = lay_out(drive_of(Structure.parse("three_mass"), input_text="force in N", actuator=2))
    marks = [i for i in layout.items if isinstance(i, PlacedSymbol) and i.letters == "u"]
    bodies = [i for i in layout.items if isinstance(i, PlacedSymbol) and i.symbol.at == "body"]
    assert len(marks) == 2
    assert marks[0].box[2] < bodies[0].x
    assert bodies[1].x < marks[1].x < bodies[2].x
    assert [i.plain for i in layout.items if isinstance(i, Label)].count("force in N") == 2
    assert "input at mass 2" in layout.title


def test_value__too_long_for_a_line__unit_stands_beside_its_half_width():
    values = {"J1": ValueText("12345.678", "0.012", "kg m²")}
    layout = lay_out(drive_of(Structure.parse("one_mass"), values=values))
    assert [i.plain for i in layout.items if isinstance(i, Label)] == ["torque", "J1 = 12345.678", "± 0.012 kg m²"]
