"""Properties that every effect of the registry must have. No effect is named, so that a new one is tested at once."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brightgrey.effects import Draft, Scales, registry

EFFECTS = list(registry().values())
LAWS = [e for e in EFFECTS if e.law is not None]
FIXED_SYMBOLS = {  # DESIGN §2
    *("J1", "J2", "J3", "J4", "c1", "c2", "c3", "d1", "d2", "d3"),
    *("f_v", "M_C", "M_S", "omega_S", "M_G", "alpha", "T_1", "T_d"),
}
each = pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.name)
each_law = pytest.mark.parametrize("effect", LAWS, ids=lambda e: e.name)
quick = settings(max_examples=40, deadline=None, derandomize=True)

sizes = st.floats(-3.0, 3.0).map(lambda power: 10.0**power)
scales = st.builds(
    lambda torque, speed, time, steps, share: Scales(
        torque=torque,
        speed=speed,
        acceleration=speed / time,
        travel=speed * time,
        interval=time / steps,
        duration=time,
        inertia=torque * time / speed,
        friction=share * torque,
        viscous=share * torque / speed,
        offset=-share * torque,
    ),
    torque=sizes,
    speed=sizes,
    time=st.floats(0.5, 60.0),
    steps=st.integers(200, 50_000),
    share=st.floats(0.0, 0.9),
)
ports = st.floats(-5.0, 5.0)
positive = st.floats(0.2, 3.0)


@each
def test_symbols__are_inside_their_boxes(effect):
    assert effect.symbols
    for symbol in effect.symbols:
        points = [point for line in symbol.lines for point in line]
        points += [(x + dx, y + dy) for x, y, r in symbol.circles for dx, dy in ((-r, 0), (r, 0), (0, -r), (0, r))]
        assert points
        assert all(0.0 <= x <= symbol.width and 0.0 <= y <= symbol.height for x, y in points)
        shown = {"mass": ("ground", "load"), "shaft": ("series",), "drive": ("input", "body", "spring", "damper")}
        assert symbol.at in shown[effect.where]
        assert set(symbol.shows or ()) <= {q.symbol for q in effect.parameters}


@each
def test_declaration__is_complete(effect):
    for text in (effect.title, effect.about, effect.equation, effect.source):
        assert text.strip()
    assert re.fullmatch(r"[a-z][a-z_]*", effect.name)
    assert registry()[effect.name] is effect
    symbols = [p.symbol for p in effect.parameters]
    assert len(set(symbols)) == len(symbols) > 0
    for parameter in effect.parameters:
        assert parameter.about.strip()
        assert len(parameter.dimension) == 3
    assert sum(p.size for p in effect.parameters) == (effect.masses == 0)
    if effect.law is not None:
        # What a law reads is either a parameter of its effect or fixed upfront.
        assert set(effect.law.parameters) <= {*symbols, "f_tanh"}
        assert 0 <= effect.law.ports <= 2


def test_symbols__are_those_of_the_design():
    assert {p.symbol for e in EFFECTS if e.number <= 11 for p in e.parameters} == FIXED_SYMBOLS


def test_numbers_and_names__are_unique():
    assert len({e.number for e in EFFECTS}) == len(EFFECTS)
    assert [e.number for e in EFFECTS] == sorted(e.number for e in EFFECTS)


@each
@quick
@given(scale=scales)
def test_bounds__any_scales__hold_the_start(effect, scale):
    for parameter in effect.parameters:
        low, high = parameter.bounds(scale)
        start = parameter.start(scale)
        assert np.isfinite([low, high, start]).all()
        assert low < high
        assert low <= start <= high
        if parameter.scale == "log":
            assert low > 0.0


@each
@quick
@given(scale=scales, torque=sizes, motion=sizes, time=sizes)
def test_bounds__other_units__follow_the_dimension(effect, scale, torque, motion, time):
    """The same recording in other units gives the same range: this is what Dimension says."""
    powers = {
        "torque": (1, 0, 0),
        "speed": (0, 1, -1),
        "acceleration": (0, 1, -2),
        "travel": (0, 1, 0),
        "interval": (0, 0, 1),
        "duration": (0, 0, 1),
        "inertia": (1, -1, 2),
        "friction": (1, 0, 0),
        "viscous": (1, -1, 1),
        "offset": (1, 0, 0),
    }
    factor = lambda p: torque ** p[0] * motion ** p[1] * time ** p[2]  # noqa: E731
    other = replace(scale, **{name: getattr(scale, name) * factor(p) for name, p in powers.items()})
    for q in effect.parameters:
        here = np.array([*q.bounds(scale), q.start(scale)])
        there = np.array([*q.bounds(other), q.start(other)])
        np.testing.assert_allclose(there, here * factor(q.dimension), rtol=1e-9, atol=0.0)


def drawn(effect, data):
    law = effect.law
    z = tuple(data.draw(ports) for _ in range(law.ports))
    p = tuple(data.draw(positive) for _ in law.parameters)
    return law, z, p


@pytest.mark.parametrize("effect", [e for e in LAWS if e.limiting_cases], ids=lambda e: e.name)
@quick
@given(data=st.data())
def test_limiting_cases__short_way__together_are_the_tangent_of_the_law(effect, data):
    law, _, p = drawn(effect, data)
    phi, slopes = law.value((0.0,) * law.ports, p)
    tangent = np.zeros(2)
    for case in effect.limiting_cases:
        other = registry()[case.effect].law
        sizes = case.values(dict(zip(law.parameters, p, strict=True)))
        value, slope = other.value((0.0,) * other.ports, tuple(sizes[name] for name in other.parameters))
        tangent += [value, sum(slope)]
    np.testing.assert_allclose(tangent, [phi, sum(slopes)], rtol=1e-9, atol=1e-9)


def moved(values, i, by):
    return tuple(v + by if j == i else v for j, v in enumerate(values))


@each_law
@quick
@given(data=st.data())
def test_law__slopes__are_its_derivatives(effect, data):
    law, z, p = drawn(effect, data)
    h = 1e-6
    _, slopes = law.value(z, p)
    assert len(slopes) == law.ports

    def check(exact, of):
        left, middle, right = of(-h), of(0.0), of(h)
        # A law may have a corner. Its slope is then that of one side; one-sided differences tell.
        sides = sorted([(right - middle) / h, (middle - left) / h])
        slack = 1e-4 * (1.0 + abs(float(exact)))
        assert sides[0] - slack <= float(exact) <= sides[1] + slack

    for i in range(law.ports):
        check(slopes[i], lambda by, i=i: float(law.value(moved(z, i, by), p)[0]))


@each_law
@quick
@given(data=st.data())
def test_law__declared_properties__hold(effect, data):
    law, z, p = drawn(effect, data)
    phi = float(law.value(z, p)[0])
    assert np.isfinite(phi)
    if law.odd:
        mirrored = float(law.value(tuple(-a for a in z), p)[0])
        assert mirrored == pytest.approx(-phi, rel=1e-14, abs=1e-300)
    if law.dissipative:
        assert law.ports == 1
        assert z[0] * phi <= 0.0
    if law.affine:
        constant, slopes = law.value((0.0,) * law.ports, p)
        line = float(constant) + sum(float(s) * a for s, a in zip(slopes, z, strict=True))
        assert phi == pytest.approx(line, rel=1e-13, abs=1e-13)


@each_law
@quick
@given(data=st.data())
def test_law__arrays__equal_floats(effect, data):
    law, z, p = drawn(effect, data)
    phi, slopes = law.value(z, p)
    many, many_slopes = law.value(tuple(np.full(3, a) for a in z), tuple(np.full(3, a) for a in p))
    np.testing.assert_allclose(np.broadcast_to(many, 3), float(phi), rtol=1e-14)
    for one, three in zip(slopes, many_slopes, strict=True):
        np.testing.assert_allclose(np.broadcast_to(three, 3), float(one), rtol=1e-14)


@each
def test_stamp__leaves_the_draft_unchanged(effect):
    chain = next(e for e in EFFECTS if e.masses == 3)
    draft = chain.stamp(Draft(), 1, {p.symbol: 2.0 for p in chain.parameters})
    if effect.masses:
        draft = Draft()
    elif effect.where == "drive":
        draft = replace(draft, B=draft.B[:, :1])
    before = (draft.A.copy(), draft.B.copy(), draft.states, draft.elements, draft.dead_time)
    values = {**{p.symbol: 0.5 for p in effect.parameters}, "f_tanh": 2.0}
    kept = dict(values)
    after = effect.stamp(draft, 1, values)
    assert values == kept
    np.testing.assert_array_equal(draft.A, before[0])
    np.testing.assert_array_equal(draft.B, before[1])
    assert (draft.states, draft.elements, draft.dead_time) == before[2:]
    own_states = len(after.states) - len(draft.states)
    assert effect.has_states == (own_states > 0)
    assert effect.has_hard_limit == any(e.limits is not None for e in after.elements[len(draft.elements) :])
    assert (effect.law is not None) == (len(after.elements) > len(draft.elements))


@each
@quick
@given(scale=scales)
def test_relevant_size__every_place__finite_values_of_known_parameters(effect, scale):
    if effect.relevant_size is None:
        return
    values = {q.symbol: q.start(scale) for e in EFFECTS if e.masses == 4 for q in e.parameters}
    for place in {"drive": (1,), "mass": (1, 2, 3, 4), "shaft": (1, 2, 3)}[effect.where]:
        sizes = effect.relevant_size(scale, values, place)
        assert set(sizes) <= {q.symbol for q in effect.parameters}
        assert {q.symbol for q in effect.parameters if q.size} <= set(sizes)
        assert np.isfinite(list(sizes.values())).all()
