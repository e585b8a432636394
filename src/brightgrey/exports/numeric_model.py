"""A model lowered to numbers, as the kernel takes it: the exports to other languages write these down.

The scheme is that of :mod:`brightgrey.simulation.kernel.radau_step` at level ``accurate``. The matrix exponentials are
computed here, once, so that the target needs none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm

from brightgrey.arrays import Array
from brightgrey.effects import Dimension, Element, Law
from brightgrey.kit import StateSpace, assemble
from brightgrey.model.model import Model
from brightgrey.recordings.recording import Hold
from brightgrey.recordings.units.parser import parse_unit
from brightgrey.recordings.units.signals import Units
from brightgrey.simulation import Settings
from brightgrey.simulation.kernel.lowering import Lowered, lower
from brightgrey.simulation.response import parts_per_sample
from brightgrey.simulation.settings import Tolerances, tolerances

__all__ = [
    "ModelOutput",
    "NumericModel",
    "PortLaw",
    "PropagatorTables",
    "amplitude_of",
    "numeric_model",
    "propagator_tables",
]

SMOOTHED_WIDTH = 1e-4
"""Speed within which friction reverses where a target cannot stop a mass, in parts of the largest speed."""

_COHERENT_MOTIONS = ("rad", "m")
_COHERENT_INPUTS = ("N m", "N", "V", "A")


@dataclass(frozen=True)
class ModelOutput:
    """One output of the exported model."""

    #: As in the recording.
    name: str
    kind: str
    unit: str
    row: int  #: Row of x, or n + row of x' for an acceleration.
    differenced: bool  #: Difference of this and the sample before, over the sampling interval.
    factor: float  #: Shown value over SI value.
    mass: int = 1  #: Mass that it is the motion of.


class PortLaw(NamedTuple):
    """Law that exports call at a port."""

    element: Element  #: Of one port. Of dry friction its law is the amplitude, for speeds >= 0.
    port: int
    dry: bool


@dataclass(frozen=True)
class NumericModel:
    """A model lowered to numbers; SI inside, inputs and outputs in the recording's units."""

    model: Model
    system: StateSpace  #: As assembled.
    low: Lowered  #: With one parameter set on the last axes.
    dt: float  #: Sampling interval in s.
    settings: Settings  #: Level ``accurate``.
    tolerance: Tolerances
    base_steps: int  #: Base steps per sample.
    input_factor: float  #: SI value over shown value.
    outputs: tuple[ModelOutput, ...]

    @property
    def hold(self) -> Hold:
        """Input between samples."""
        return self.settings.hold

    @property
    def n(self) -> int:
        """Number of states."""
        return int(self.low.A.shape[0])

    @property
    def m(self) -> int:
        """Number of channels: ports that friction laws act at."""
        return int(self.low.G.shape[0])

    @property
    def limited(self) -> tuple[Element, ...]:
        """Integrators with saturation."""
        return self.low.limited

    @cached_property
    def laws(self) -> tuple[PortLaw, ...]:
        """Laws of all ports."""
        return tuple(
            PortLaw(amplitude_of(e), k, True) if e.has_exact_sign else PortLaw(e, k, False) for e, k in self.low.smooth
        )

    def smoothed(self) -> NumericModel:
        """Same model with a smoothed sign of dry friction, for targets that cannot stop a mass."""
        if not self.low.dry:
            return self
        f_tanh = 1.0 / (SMOOTHED_WIDTH * self.settings.speed_scale)
        return _lowered(self.model, replace(self.settings, f_tanh=f_tanh))

    @property
    def delay(self) -> tuple[int, float]:
        """Dead time in samples: whole ones, and the part of one."""
        samples = float(np.ravel(self.low.delay)[0])
        whole = int(np.floor(samples))
        return whole, samples - whole

    @property
    def step_error(self) -> float:
        """Error of a step that is accepted, in rad/s (m/s)."""
        return self.tolerance.error * self.settings.speed_scale

    @property
    def step_change(self) -> float:
        """Change of speed within a step that is accepted, in rad/s (m/s)."""
        return self.tolerance.change * self.settings.speed_scale

    @property
    def title(self) -> str:
        """Title of the export: one line that names the structure."""
        return f"Drive train model {self.model.structure}"

    @cached_property
    def units(self) -> Units | None:
        """Coherent SI units of this model; None if the input's has no name."""
        shown = self.model.units
        motion = next(
            base for base in _COHERENT_MOTIONS if parse_unit(base).dimension == parse_unit(shown.motion).dimension
        )
        names = (shown.input, *_COHERENT_INPUTS)
        fitting = (
            u for u in map(parse_unit, names) if u.dimension == parse_unit(shown.input).dimension and u.si == 1.0
        )
        found = next(fitting, None)
        return Units(found.text, motion) if found else None

    def unit(self, dimension: Dimension) -> str:
        """SI unit of a quantity."""
        return self.units.of(dimension)[0] if self.units else "SI"

    def rate(self, b: int) -> Array:
        """Row that reads the free rate of limited state b."""
        return np.asarray(self.limited[b].H[0], float).reshape(-1)

    def limits(self, b: int) -> tuple[int, float, float]:
        """State, lower and upper limit of limited state b."""
        limits = self.limited[b].limits
        assert limits is not None
        return limits.state, float(np.ravel(limits.lower)[0]), float(np.ravel(limits.upper)[0])

    def column(self, b: int) -> Array:
        """Column by which the free rate of limited state b acts on all states, shape (n,)."""
        return np.asarray(self.limited[b].G, float).reshape(-1)

    def arrays(self) -> dict[str, Array]:
        """All arrays of a simulation by name, m ports, l limited states and r outputs.

        ``A`` (n, n), ``B`` (n,) and ``c`` (n,) of ``x' = A x + B u + c + G' F``; ``G``, ``H`` (m, n) and ``K`` (m,) of
        the ports; ``gain`` (m,), largest entry of each row of G; ``rate``, ``column`` (l, n), ``low``, ``high`` and
        ``limited`` (l,), limits and state; ``stopped`` and ``held`` (m,), speed that dry friction stops and its
        position, or -1; ``rest`` (n,), states at rest over the input; ``row``, ``differenced`` and
        ``output_factor`` (r,).
        """
        low, b = self.low, range(len(self.limited))
        G = low.G[:, :, 0]
        ends = [self.limits(k) for k in b]
        return {
            "A": low.A[:, :, 0],
            "B": low.B[:, 0],
            "c": low.c[:, 0],
            "G": G,
            "H": low.H[:, :, 0],
            "K": low.through[:, 0],
            "gain": np.abs(G).max(axis=1, initial=0.0),
            "rate": np.array([self.rate(k) for k in b]).reshape(-1, self.n),
            "column": np.array([self.column(k) for k in b]).reshape(-1, self.n),
            "low": np.array([end[1] for end in ends]),
            "high": np.array([end[2] for end in ends]),
            "limited": np.array([end[0] for end in ends], np.int64),
            "stopped": np.array(low.stopped, np.int64),
            "held": np.array(low.held, np.int64),
            "rest": np.array([float(state.at_rest == "input") for state in self.system.states]),
            "row": np.array([o.row for o in self.outputs], np.int64),
            "differenced": np.array([o.differenced for o in self.outputs], np.bool_),
            "output_factor": np.array([o.factor for o in self.outputs]),
        }

    def shown(self, y: Array, x0: Array) -> Array:
        """Outputs of a simulation from `x0` in the recording's units, differenced where the recording's are.

        Parameters
        ----------
        y : ndarray, shape (outputs, samples)
            Rows of x or x' that the outputs read, SI.
        x0 : ndarray, shape (n,)
        """
        out = np.array(y)
        names = self.system.state_names
        for row, output in enumerate(self.outputs):
            if output.differenced:
                speed = x0[names.index(f"v{names[output.row][1:]}")]
                out[row] = np.diff(out[row], prepend=out[row, 0] - self.dt * speed) / self.dt
            out[row] *= output.factor
        return out


@dataclass(frozen=True)
class PropagatorTables:
    """Weights of a step over 2^level ticks, by mode (bit b: limited state b is free) and level."""

    #: Weights of the state at the end and at a third of the step. The columns belong to x, the input, its slope, 1, F
    #: at a third, F at the end, and the jump and change of slope of the input at its knot. Shape (modes, levels, n, n
    #: + 5 + 2 m).
    end: Array
    third: Array
    coupling: Array  #: Ports at both stages from F at both stages, shape (modes, levels, 2 m, 2 m).


def amplitude_of(element: Element) -> Element:
    """Dry friction as an element of its amplitude."""
    amplitude = element.law.amplitude
    assert amplitude is not None

    def value(z: tuple[Any, ...], p: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
        a, slope = amplitude(z[0], p)
        return a, (slope,)

    return replace(element, law=Law(element.law.parameters[:-1], value), p=element.p[:-1])


def numeric_model(model: Model, f_tanh: float | None = None) -> NumericModel:
    """Lower `model`; level ``accurate`` whatever the model was fitted at.

    Parameters
    ----------
    model : Model
    f_tanh : float, optional
        Gain of friction's sign in s/rad (s/m) instead of the model's; ``math.inf`` for exact friction.
    """
    own = model.settings_si()
    return _lowered(model, Settings(own.f_tanh if f_tanh is None else f_tanh, own.speed_scale, "accurate", own.hold))


def _lowered(model: Model, settings: Settings) -> NumericModel:
    natural = [signal.simulated for signal in model.outputs]
    system = assemble(model.structure, model.values_si(), settings.f_tanh, natural, model.input.mass)
    dt = model.settings.sampling_time
    low = lower(system, dt)
    outputs = tuple(
        ModelOutput(  # of a speed without sign the velocity is exported
            s.name,
            "velocity" if s.kind == "speed" else s.kind,
            s.unit,
            int(row),
            s.kind == "velocity-differenced",
            s.factor,
            s.mass,
        )
        for s, row in zip(model.outputs, low.outputs, strict=True)
    )
    return NumericModel(
        model=model,
        system=system,
        low=low,
        dt=dt,
        settings=settings,
        tolerance=tolerances("accurate", bool(low.limited)),
        base_steps=int(parts_per_sample(system, low, dt, settings)[0]),
        input_factor=1.0 / model.input.factor,
        outputs=outputs,
    )


def _mode_matrix(numeric: NumericModel, mode: int) -> Array:
    """System matrix, shape (n, n), of a mode."""
    A = np.array(numeric.low.A[:, :, 0])
    for b, element in enumerate(numeric.limited):
        if mode >> b & 1:
            A += np.outer(np.asarray(element.G).reshape(-1), numeric.rate(b))
    return A


def _propagator(numeric: NumericModel, mode: int, span: float) -> Array:
    """Top rows of the exponential: weights of x, u, its slope, 1, F at the start, its slope."""
    n, m = numeric.n, numeric.m
    M = np.zeros((n + 3 + 2 * m, n + 3 + 2 * m))
    M[:n, :n] = _mode_matrix(numeric, mode)
    M[:n, n], M[n, n + 1], M[:n, n + 2] = numeric.low.B[:, 0], 1.0, numeric.low.c[:, 0]
    M[:n, n + 3 : n + 3 + m] = numeric.low.G[:, :, 0].T
    M[n + 3 : n + 3 + m, n + 3 + m :] = np.eye(m)
    return np.asarray(expm(M * span))[:n]


def _weights(numeric: NumericModel, mode: int, span: float, h: float, after: float) -> Array:
    """Table over `span` of a step of `h`, where a knot of the input lies `after` before its end (0: none)."""
    n, m = numeric.n, numeric.m
    P = _propagator(numeric, mode, span)
    value, slope = P[:, n + 3 : n + 3 + m], P[:, n + 3 + m :] * 1.5 / h
    knot = _propagator(numeric, mode, after)[:, n : n + 2] if after > 0.0 else np.zeros((n, 2))
    return np.hstack([P[:, : n + 3], 1.5 * value - slope, slope - 0.5 * value, knot])


def propagator_tables(numeric: NumericModel) -> PropagatorTables:
    """Step tables of all modes and levels."""
    n, m, top = numeric.n, numeric.m, numeric.tolerance.ticks
    ticks = 2**top
    tick = numeric.dt / (ticks * numeric.base_steps)
    knot = numeric.delay[1] * ticks * numeric.base_steps
    knot -= int(knot / ticks) * ticks
    modes = 2 ** len(numeric.limited)
    end = np.empty((modes, top + 1, n, n + 5 + 2 * m))
    third = np.empty_like(end)
    coupling = np.empty((modes, top + 1, 2 * m, 2 * m))
    H = numeric.low.H[:, :, 0]
    for mode in range(modes):
        for level in range(top + 1):
            size = 2**level
            h = size * tick
            after = size - (knot - int(knot / size) * size) if numeric.delay[1] > 0.0 else 0.0
            early = max(after - size * (2.0 / 3.0), 0.0)
            end[mode, level] = _weights(numeric, mode, h, h, after * tick)
            third[mode, level] = _weights(numeric, mode, h / 3.0, h, early * tick)
            forces = slice(n + 3, n + 3 + 2 * m)
            coupling[mode, level] = np.vstack([H @ third[mode, level][:, forces], H @ end[mode, level][:, forces]])
    return PropagatorTables(end, third, coupling)
