"""The system that effects are stamped into, while it is being built.

A model has the form ``x' = A x + B u + sum_e G_e phi_e(z_e; p_e)`` with the ports ``z_e = H_e x + K_e u``.
Each effect turns one :class:`Draft` of it into the next. A parameter may be a float or an array over a batch of
parameter sets; the matrices then carry the same trailing axes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects.law import Law
from brightgrey.effects.quantities import POSITION, SPEED, Dimension

__all__ = ["Draft", "Element", "Limits", "Stamp", "State", "Values", "friction_stamp", "position_stamp"]

Values = Mapping[str, Any]


@dataclass(frozen=True)
class State:
    """One state of the system.

    Attributes
    ----------
    name : str
        For example ``q1``, ``v1``, ``lambda1`` or ``T``.
    dimension : Dimension
    at_rest : {'position', 'speed', 'zero', 'input'}
        Source of the initial value: the recording's first position or speed, zero, or the first input.
    """

    name: str
    dimension: Dimension
    at_rest: Literal["position", "speed", "zero", "input"]


@dataclass(frozen=True)
class Limits:
    """Hard limits of a state: its element is an integrator with saturation that keeps it in [lower, upper].

    The element's first port is the rate of the state between the limits; its law gives the rate everywhere.

    Attributes
    ----------
    state : int
        Index of the limited state.
    lower, upper : float or ndarray
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
        The placed effect that it belongs to, always with its place: ``coulomb@1``.
    law : Law
        phi(z; p).
    H : ndarray, shape (ports, n, ...)
        Rows that read the ports from the states.
    K : ndarray, shape (ports, ...)
        Entries that read the ports from the input.
    G : ndarray, shape (n, ...)
        Column through which phi acts on x'.
    p : tuple
        Parameter values in the order of ``law.parameters``, each a float or an array over the batch.
    limits : Limits or None
        Limits of the state that the element integrates, if it is an integrator with saturation.
    """

    name: str
    law: Law
    H: Array
    K: Array
    G: Array
    p: tuple[Any, ...]
    limits: Limits | None = None

    @property
    def has_exact_sign(self) -> bool:
        """It is dry friction that reverses at once: its mass may stick."""
        return self.law.amplitude is not None and bool(np.all(np.isinf(self.p[-1])))

    def with_state(self) -> Element:
        """Return the element in a system with one more state, to which it is not connected."""
        H = np.zeros((self.H.shape[0], self.H.shape[1] + 1, *self.H.shape[2:]))
        G = np.zeros((len(self.G) + 1, *self.G.shape[1:]))
        H[:, :-1], G[:-1] = self.H, self.G
        return replace(self, H=H, G=G)


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
        One input per mass (paper eq. 8) until the actuator is selected.
    elements : tuple of Element
    dead_time : float or ndarray
        Delay of the input in s.
    owner : str
        The placed effect that is being stamped; the elements that it adds get this name.
    """

    states: tuple[State, ...] = ()
    masses: int = 0
    A: Array = field(default_factory=lambda: np.zeros((0, 0)))
    B: Array = field(default_factory=lambda: np.zeros((0, 0)))
    elements: tuple[Element, ...] = ()
    dead_time: Any = 0.0
    owner: str = ""

    @classmethod
    def mass_chain(cls, J: Sequence[Any], c: Sequence[Any], d: Sequence[Any]) -> Draft:
        """Masses in a row, coupled by springs and dampers (eq. 7, 8): M is diagonal, C and D are tridiagonal.

        Parameters
        ----------
        J : sequence of float or ndarray
            Moments of inertia of the N masses.
        c, d : sequence of float or ndarray
            Spring and damper constants of the N - 1 shafts.
        """
        masses = len(J)
        batch = np.broadcast_shapes(*(np.shape(v) for v in (*J, *c, *d)))
        A = np.zeros((2 * masses, 2 * masses, *batch))
        B = np.zeros((2 * masses, masses, *batch))
        for i in range(masses):
            A[i, masses + i] = 1.0
            B[masses + i, i] = 1.0 / J[i]
        for k in range(masses - 1):
            for block, constant in ((0, c[k]), (masses, d[k])):
                for i, j in ((k, k + 1), (k + 1, k)):
                    A[masses + i, block + i] -= constant / J[i]
                    A[masses + i, block + j] += constant / J[i]
        states = tuple(State(f"q{i + 1}", POSITION, "position") for i in range(masses))
        states += tuple(State(f"v{i + 1}", SPEED, "speed") for i in range(masses))
        return cls(states, masses, A, B)

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
        A, B = np.zeros((n + 1, n + 1, *self.batch)), np.zeros((n + 1, *self.B.shape[1:]))
        if n:
            A[:n, :n], B[:n] = self.A, self.B
        return replace(
            self, states=(*self.states, state), A=A, B=B, elements=tuple(e.with_state() for e in self.elements)
        )

    def with_element(
        self, law: Law, H: tuple[Array, ...], G: Array, values: Values, limits: Limits | None = None
    ) -> Draft:
        """Add an element whose ports read states only.

        Parameters
        ----------
        law : Law
        H : tuple of ndarray, each of shape (n, ...)
            One row per port of the law; see `unit_row`.
        G : ndarray, shape (n, ...)
            Column through which the law acts on x'.
        values : mapping of str to float or ndarray
            Parameter values by symbol.
        limits : Limits, optional
        """
        rows = np.array(H) if H else np.zeros((0, len(self.states), *self.batch))
        K = np.zeros((len(H), *self.batch))
        p = tuple(values[symbol] for symbol in law.parameters)
        return replace(self, elements=(*self.elements, Element(self.owner, law, rows, K, G, p, limits)))


Stamp = Callable[[Draft, int, Values], Draft]


def friction_stamp(law: Law) -> Stamp:
    """Stamp of a law that gives a torque on the mass at its place, from that mass's speed (eq. 11)."""
    return partial(_torque_on_mass, law=law, reads="v")


def position_stamp(law: Law) -> Stamp:
    """Stamp of a law that gives a torque on the mass at its place, from that mass's position."""
    return partial(_torque_on_mass, law=law, reads="q")


def _torque_on_mass(draft: Draft, place: int, values: Values, *, law: Law, reads: str) -> Draft:
    return draft.with_element(law, (draft.unit_row(f"{reads}{place}"),), draft.B[:, place - 1], values)
