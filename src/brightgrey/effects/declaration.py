"""What an effect declares: parameters, states, stamp, law and the properties that every effect is tested for.

The form of a model is ``x' = A x + B u + sum_e G_e phi_e(z_e; p_e)`` with ``z_e = H_e x + K_e u``.
An effect changes a :class:`Draft` of it; stamps are pure and work on whole batches of parameter sets at once
(a parameter may be a float or an array; matrices carry the same trailing axes).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects.law import Law, friction_law
from brightgrey.effects.modelica import Modelica, force_on_mass

__all__ = [
    "Caution",
    "Circumstances",
    "Dimension",
    "Draft",
    "Effect",
    "Element",
    "Fault",
    "Law",
    "Limits",
    "Modelica",
    "Parameter",
    "Scales",
    "Stage",
    "State",
    "force_on_mass",
    "friction_law",
]

Values = Mapping[str, Any]
Stage = Literal["masses", "friction", "gravity", "backlash", "current control", "delay"]


class Dimension(NamedTuple):
    """Unit as powers of the input's unit, the unit of motion (rad, m) and the second."""

    input: int
    motion: int
    time: int


@dataclass(frozen=True)
class Scales:
    """What a recording says about the size of things, in SI units. Bounds and starts are declared in these.

    Attributes
    ----------
    torque, speed, acceleration, travel : float
        Largest magnitude of input and motion; travel is the range of position. N m (N), rad/s (m/s), ...
    interval, duration : float
        Sampling time and length of the recording in s.
    inertia, friction, viscous, offset : float
        Regression of the input on acceleration, sign of speed, speed and a constant: total inertia, Coulomb
        friction, viscous friction and the constant part of the input that does not move anything.
    """

    torque: float
    speed: float
    acceleration: float
    travel: float
    interval: float
    duration: float
    inertia: float
    friction: float
    viscous: float
    offset: float


class Fault(NamedTuple):
    """What a change of a parameter is called when a machine is watched; parameters of one subject change together.

    Attributes
    ----------
    subject : str
        What people call it, e.g. ``friction``.
    grows : bool
        Only growth is a fault; else any change is reported.
    """

    subject: str
    grows: bool = True


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Attributes
    ----------
    symbol : str
        Fixed name, e.g. ``M_C``; at another place than 1 it is written ``M_C@2``.
    dimension : Dimension
        Unit as powers of input unit, motion unit and second.
    about : str
        One sentence for people.
    bounds : callable
        ``bounds(scales) -> (low, high)``, the range worth searching, from the recording, SI.
    start : callable
        ``start(scales) -> value``, a first guess within the bounds, SI.
    scale : {'log', 'linear'}
        How to step through the range. ``log`` only for parameters that are always positive.
    lag : bool
        A time by which the input comes late, to first order: below a sampling interval it is sampling, and of
        several of them a recording may show the sum only.
    size : bool
        At zero its effect is not there.
    fault : Fault or None
        What its change means when a machine is watched; None where nothing wears or is exchanged.
    """

    symbol: str
    dimension: Dimension
    about: str
    bounds: Callable[[Scales], tuple[float, float]]
    start: Callable[[Scales], float]
    scale: Literal["log", "linear"] = "log"
    lag: bool = False
    size: bool = False
    fault: Fault | None = None


@dataclass(frozen=True)
class State:
    """One state: its name, its dimension and the value it has at rest.

    ``at_rest`` says where the initial value comes from: the recording's first position or speed, zero, or the
    first input.
    """

    name: str
    dimension: Dimension
    at_rest: Literal["position", "speed", "zero", "input"]


@dataclass(frozen=True)
class Limits:
    """Makes an element an integrator with saturation: `state` is kept in [lower, upper].

    The element's first port is the rate of the state between the limits, its law gives the rate everywhere.
    """

    state: int
    lower: Any
    upper: Any


@dataclass(frozen=True)
class Element:
    """One scalar non-linearity in feedback.

    Attributes
    ----------
    name : str
        The placed effect it belongs to.
    law : Law
        phi(z; p).
    H : ndarray, shape (ports, n, ...)
        Ports read from the states.
    K : ndarray, shape (ports, ...)
        Ports read from the input.
    G : ndarray, shape (n, ...)
        Where phi acts on x'.
    p : tuple
        Parameter values in the order of ``law.parameters``, each a float or an array over the batch.
    limits : Limits or None
        Set when the element is an integrator with saturation.
    """

    name: str
    law: Law
    H: Array
    K: Array
    G: Array
    p: tuple[Any, ...]
    limits: Limits | None = None

    def grown(self) -> Element:
        """The same in a system with one state more, without any connection to it."""
        H = np.zeros((self.H.shape[0], self.H.shape[1] + 1, *self.H.shape[2:]))
        G = np.zeros((len(self.G) + 1, *self.G.shape[1:]))
        H[:, :-1], G[:-1] = self.H, self.G
        return Element(self.name, self.law, H, self.K, G, self.p, self.limits)


@dataclass(frozen=True)
class Draft:
    """The system as built so far. Every operation returns a new one.

    Attributes
    ----------
    states : tuple of State
        In the order q, q', lambda, T.
    masses : int
        Number of masses N.
    A : ndarray, shape (n, n, ...)
    B : ndarray, shape (n, inputs, ...)
        Until the inputs are selected there is one input per mass (paper eq. 8).
    elements : tuple of Element
    dead_time : float or ndarray
        Delay of the input in s.
    """

    states: tuple[State, ...] = ()
    masses: int = 0
    A: Array = field(default_factory=lambda: np.zeros((0, 0)))
    B: Array = field(default_factory=lambda: np.zeros((0, 0)))
    elements: tuple[Element, ...] = ()
    dead_time: Any = 0.0

    @property
    def batch(self) -> tuple[int, ...]:
        """Trailing shape of all matrices: () for one parameter set, (K,) for K of them."""
        return self.A.shape[2:]

    def index(self, name: str) -> int:
        """Position of the state called `name`."""
        return next(i for i, state in enumerate(self.states) if state.name == name)

    def unit_row(self, name: str) -> Array:
        """Row, shape (n, ...), that reads the state called `name`."""
        row = np.zeros((len(self.states), *self.batch))
        row[self.index(name)] = 1.0
        return row

    def with_state(self, state: State) -> Draft:
        """Append a state without any connection."""
        n = len(self.states)

        batch = self.batch
        A, B = np.zeros((n + 1, n + 1, *batch)), np.zeros((n + 1, *self.B.shape[1:]))
        if n:
            A[:n, :n], B[:n] = self.A, self.B
        elements = tuple(e.grown() for e in self.elements)
        return Draft((*self.states, state), self.masses, A, B, elements, self.dead_time)

    def with_element(
        self,
        name: str,
        law: Law,
        H: tuple[Array, ...],
        G: Array,
        values: Values,
        limits: Limits | None = None,
    ) -> Draft:
        """Add an element whose ports read states only."""
        rows = np.array(H) if H else np.zeros((0, len(self.states), *self.batch))
        K = np.zeros((len(H), *self.batch))
        p = tuple(values[symbol] for symbol in law.parameters)
        elements = (*self.elements, Element(name, law, rows, K, G, p, limits))
        return Draft(self.states, self.masses, self.A, self.B, elements, self.dead_time)


Stamp = Callable[[Draft, int, Values], Draft]


@dataclass(frozen=True)
class Circumstances:
    """What a caution judges by, after an estimation; all in SI.

    Attributes
    ----------
    values : mapping of str to float
        The effect's own parameters by bare symbol.
    scales : Scales
    f_tanh : float
    beside : tuple of Law
        Laws of the other effects at the same place.
    reverses : bool
        Whether the drive moves both ways in the recordings.
    """

    values: Mapping[str, float]
    scales: Scales
    f_tanh: float
    beside: tuple[Law, ...]
    reverses: bool


@dataclass(frozen=True)
class Caution:
    """What a recording cannot tell of an effect, and when.

    Attributes
    ----------
    kind : {'confounded', 'not observable'}
        Something else looks the same, or nothing is to be seen.
    symbols : tuple of str
        The effect's parameters that it is about.
    applies : callable
        ``applies(circumstances) -> bool``.
    text : str
        What to tell people, without the parameter's name in front.
    """

    kind: Literal["confounded", "not observable"]
    symbols: tuple[str, ...]
    applies: Callable[[Circumstances], bool]
    text: str


@dataclass(frozen=True)
class Effect:
    """A submodel of the function set: all that the rest of the package knows of a physical effect.

    Attributes
    ----------
    name : str
        Fixed name, e.g. ``coulomb``.
    number : int
        Number in the paper's figure 7; later effects go on counting.
    title : str
        Name for people.
    about : str
        What the effect is, and when it is not the right one.
    equation : str
        The law in plain text.
    source : str
        Equation of the paper, or DOI.
    stage : str
        When it is stamped; the order of the paper's section 2.2.
    where : {'drive', 'mass', 'shaft'}
        What it is placed at. The place is counted from the motor, from 1.
    parameters : tuple of Parameter
    stamp : callable
        ``stamp(draft, place, values) -> Draft``; `values` maps bare symbols and ``f_tanh`` to floats or arrays.
    law : Law or None
        The law it adds, if it adds one.
    masses : int
        Number of masses it brings; every structure has exactly one effect that brings any.
    memory : bool
        Has states of its own.
    spread : callable or None
        ``spread(scales, share) -> values``: plausible values of all parameters, shape (parameters, K), from points of
        the unit cube of that shape. For effects whose parameters are plausible only together; without it, each
        is drawn from its own range.
    regroup : callable or None
        ``regroup(values, share, turning) -> values``: other parameters that would show much the same, for an effect
        whose parts can change roles, so that a search does not take one order for the only one; shape
        (parameters, K), and shares as for `spread`. The part that is new rings at `turning`, rad/s, shape (K,); not a
        number if it may be anything.
    fewer : callable or None
        ``fewer(values, masses) -> {symbol: value}``, SI: what shows much the same with so many masses, for an effect
        with more of them; `values` by symbol.
    ways : callable or None
        ``ways(values, turning) -> values``: what `regroup` can do, gone through without chance, from values of shape
        (parameters,); for each of the frequencies, shape (K,), equally many ways, shape (parameters, K, ways).
    noticeable : callable or None
        ``noticeable(scales, values) -> {symbol: value}``, SI: the effect at the least size that matters for control,
        with `values` of the model without it by name. It may change values that are there (an inertia that is split).
    cautions : tuple of Caution
    modelica : Modelica or None
        How it is drawn in Modelica; without it, a model with this effect is exported as equations.
    follows : str
        What residuals follow where this effect is missing, for laws of at most one port, a speed.
    """

    name: str
    number: int
    title: str
    about: str
    equation: str
    source: str
    stage: Stage
    where: Literal["drive", "mass", "shaft"]
    parameters: tuple[Parameter, ...]
    stamp: Stamp
    law: Law | None = None
    masses: int = 0
    memory: bool = False
    spread: Callable[[Scales, Array], Array] | None = None
    noticeable: Callable[[Scales, Values], Mapping[str, float]] | None = None
    cautions: tuple[Caution, ...] = ()
    regroup: Callable[[Array, Array, Array], Array] | None = None
    fewer: Callable[[Mapping[str, float], int], Mapping[str, float]] | None = None
    ways: Callable[[Array, Array], Array] | None = None
    modelica: Modelica | None = None
    follows: str = ""
