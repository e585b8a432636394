"""Symbols of effects as braille characters."""

import sys

from brightgrey.cli.effects import effects
from brightgrey.cli.terminal.symbol_sketch import effect_sketch
from brightgrey.effects import registry


def test_effect_sketch__every_effect__is_a_block_of_its_own_that_fits_a_window():
    sketches = {name: effect_sketch(name) for name in registry()}
    assert len({"\n".join(lines) for lines in sketches.values()}) == len(sketches)
    for lines in sketches.values():
        assert len({len(line) for line in lines}) == 1
        assert len(lines[0]) <= 80
        assert 2 <= len(lines) <= 5
        assert any(0x2800 < ord(c) < 0x2900 for line in lines for c in line)


def test_effect_sketch__masses__are_numbered_in_their_order():
    assert [c for c in "".join(effect_sketch("three_mass")) if c.isdigit()] == ["1", "2", "3"]


def test_effects__terminal__shows_symbols_and_a_pipe_does_not(capsys, monkeypatch):
    effects()
    piped = capsys.readouterr().out
    assert not any(0x2800 <= ord(c) < 0x2900 for c in piped)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    effects()
    shown = capsys.readouterr().out
    for line in effect_sketch("coulomb"):
        assert line.rstrip() in shown
