"""Random drives of the grammar `drive`: every effect anywhere, values of any size, long units and names."""

import random

from brightgrey.drawing.drive import Sensor, ValueText, drive_of, in_unit
from brightgrey.kit import Placed, Structure, grammar_named
from brightgrey.numerics.number_format import with_uncertainty
from brightgrey.recordings.units.signals import KINDS, Units, kind_in_words

UNITS = (Units(), Units("N", "m"), Units("N", "mm"), Units("V", "rev"), Units("mN m", "deg"), Units("A", "µm"))
NAMES = ("speed", "Motor.ActualVelocity_filtered", "load position encoder 2", "v", "Ø Weg (Zähler)")


def random_structure(draw: random.Random) -> Structure:
    """Legal structure with a third of all effects, on one to four masses."""
    grammar = grammar_named("drive").whole
    chain = draw.choice([p for p in grammar.placed if p.effect.masses])
    last = {"drive": 1, "mass": chain.effect.masses, "shaft": chain.effect.masses - 1}
    share = draw.random()
    chosen = {
        p for p in grammar.placed if not p.effect.masses and p.place <= last[p.effect.where] and draw.random() < share
    }
    chosen -= {p for p in chosen if p.effect.excludes and any(p.excludes(other) for other in chosen)}
    chosen |= {Placed(name, p.place) for p in chosen for name in p.effect.requires}
    return grammar.check(Structure((chain, *chosen)))


def random_drive(seed: int):
    """Drive with values, sensors and undecided effects; every tenth is bare."""
    draw = random.Random(seed)
    structure = random_structure(draw)
    if seed % 10 == 0:
        return structure, drive_of(structure, rotary=bool(seed % 20))
    units = draw.choice(UNITS)
    values = {}
    for name, declared in structure.parameters.items():
        value = 10.0 ** draw.uniform(-9.0, 9.0) * draw.choice((1, 1, -1))
        half_width = draw.choice((None, abs(value) * 10.0 ** draw.uniform(-7.0, 2.0)))
        values[name] = ValueText(*with_uncertainty(value, half_width, digits=4), units.of(declared.dimension)[0])
    sensors = [
        Sensor(
            draw.randint(1, structure.masses),
            draw.choice(NAMES),
            in_unit(kind_in_words(draw.choice(list(KINDS))), f"{units.motion}/s"),
        )
        for _ in range(draw.randint(1, 3))
    ]
    grammar = grammar_named("drive").whole
    undecided = [str(p) for p in grammar.placed if draw.random() < 0.15]
    rotary = units.motion in ("rad", "rev", "deg")
    return structure, drive_of(
        structure,
        rotary=rotary,
        values=values,
        sensors=sensors,
        input_text=in_unit(draw.choice(NAMES), units.input),
        undecided=undecided,
        actuator=draw.choice((1, structure.masses)),
    )
