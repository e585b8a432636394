"""Linear analysis at an operating point: poles, stability, controllability, resonances, frequency response."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.linalg import eig

from brightgrey.arrays import Array, Complex
from brightgrey.control.dry_friction import breakaway_torque
from brightgrey.control.linear.controllability import (
    Controllability,
    controllability,
    minimal_realisation,
    observability,
)
from brightgrey.control.linear.margins import (
    Compensator,
    Margins,
    frequency_grid,
    frequency_response,
    stability_margins,
)
from brightgrey.control.linear.operating_point import OperatingPoint, contact_mode, trim_point
from brightgrey.control.linear.python_control import state_space
from brightgrey.control.linear.twist_coordinates import TwistModel, to_twist_coordinates
from brightgrey.control.policy import ANALYSIS
from brightgrey.errors import SettingsError
from brightgrey.kit import Linear, StateSpace

__all__ = ["Analysis", "OscillatoryMode", "analyse_system", "invariant_zeros", "oscillatory_modes"]


class OscillatoryMode(NamedTuple):
    """Conjugate pair of poles or zeros: frequency in Hz, damping ratio (negative for an unstable one)."""

    frequency: float
    damping: float


@dataclass(frozen=True)
class Analysis:
    """Linear model of a drive at an operating point, SI.

    Attributes
    ----------
    operating_point : OperatingPoint
        Steady motion, with its input and its state in twist coordinates.
    linear : Linear
        Exact linearisation for deviations from it. In contact it has no state for the position in the gap.
    states, outputs : tuple of str
        Names of the states and outputs of `linear`.
    dead_time : float
        Of the input, s. It is not part of `linear`.
    """

    operating_point: OperatingPoint
    linear: Linear
    states: tuple[str, ...]
    outputs: tuple[str, ...]
    dead_time: float

    @property
    def sticking_torque(self) -> float:
        """Largest torque beside the operating point's input under which the drive sticks, N m (N); 0 if it slides.

        With exact dry friction and at standstill, `linear` is the sliding drive. It holds once the drive has broken
        away.
        """
        point = self.operating_point
        return breakaway_torque(point.contact_mode.system) if point.speed == 0.0 else 0.0

    @property
    def depends_on_position(self) -> bool:
        """True if a load depends on the position: the linear model holds at the one of the operating point."""
        states = self.operating_point.contact_mode.system.states
        column = [i for i, state in enumerate(states) if state.at_rest == "position"]
        slope = self.operating_point.contact_mode.jacobian(self.operating_point.z, self.operating_point.u).A
        return bool(np.abs(slope[:, column]).max(initial=0.0) > 0.0)

    @cached_property
    def poles(self) -> Complex:
        """Poles in 1/s, slowest first."""
        found = np.linalg.eigvals(self.linear.A)
        rounding = ANALYSIS.axis_tolerance * max(1.0, float(np.abs(found).max(initial=0.0)))
        found = np.where(np.abs(found) <= rounding, 0.0, found)
        return np.asarray(found[np.argsort(np.abs(found), kind="stable")])

    @property
    def stability(self) -> Literal["stable", "marginal", "unstable"]:
        """Stability of the drive; ``marginal`` is a pole on the imaginary axis, an integrator, and none beyond it."""
        edge = ANALYSIS.axis_tolerance * max(1.0, float(np.abs(self.poles).max(initial=0.0)))
        largest = float(self.poles.real.max(initial=-np.inf))
        return "unstable" if largest > edge else "marginal" if largest >= -edge else "stable"

    @cached_property
    def controllability(self) -> Controllability:
        """Controllability from the input: rank and distance to an uncontrollable system."""
        return controllability(self.linear)

    @cached_property
    def observability(self) -> Controllability:
        """Observability from the outputs: rank and distance to an unobservable system."""
        return observability(self.linear)

    @property
    def resonances(self) -> tuple[OscillatoryMode, ...]:
        """Pairs of complex poles, lowest frequency first."""
        return oscillatory_modes(self.poles)

    def antiresonances(self, output: int = 0) -> tuple[OscillatoryMode, ...]:
        """Pairs of complex zeros from the input to one output."""
        return oscillatory_modes(invariant_zeros(self.linear, output))

    def bode(self, omega: Array | None = None) -> tuple[Array, Complex]:
        """Angular frequencies in rad/s, (m,), and frequency responses of all outputs, (outputs, m), dead time exact."""
        if omega is None:
            omega = frequency_grid(
                [*self.poles, *(z for i in range(len(self.outputs)) for z in invariant_zeros(self.linear, i))]
            )
        return omega, frequency_response(self.linear, omega, self.dead_time)

    def margins(self, compensator: Compensator, *, output: int = 0, delay: float = 0.0) -> Margins:
        """Stability margins with a controller on one output; `delay` in s is added to the drive's dead time.

        They belong to the controllable and observable part, so that a load coasting in an open gap does not count.
        """
        one = self.linear._replace(C=self.linear.C[output : output + 1], D=self.linear.D[output : output + 1])
        return stability_margins(minimal_realisation(one), compensator, dead_time=self.dead_time + delay)

    def to_python_control(self, order: int = 4) -> Any:
        """Model as a ``control.StateSpace``; the dead time becomes a Padé approximation of `order`."""
        return state_space(self.linear, self.states, self.outputs, self.dead_time, order)


def analyse_system(
    system: StateSpace | TwistModel,
    *,
    speed: float = 0.0,
    contact: str = "forward",
    position: float = 0.0,
    keep_position: bool = False,
) -> Analysis:
    """Linearise a system in steady motion.

    Parameters
    ----------
    system : StateSpace or TwistModel
        One parameter set.
    speed : float
        Of all masses, rad/s (m/s).
    contact : {'forward', 'backward', 'gap'}
        Side on which the gap is closed, or open; without a gap it has no effect.
    position : float
        Of mass 1, rad (m), where a load depends on it.
    keep_position : bool
        Keep the absolute position as a state even if no output depends on it.

    Returns
    -------
    Analysis

    Raises
    ------
    SettingsError
        For a batch, an unknown contact, or if no such steady motion exists.
    """
    transformed = (
        system if isinstance(system, TwistModel) else to_twist_coordinates(system, keep_position=keep_position)
    )
    if transformed.system.batch:
        raise SettingsError("linear analysis needs a single parameter set; this is a batch")
    mode = contact_mode(transformed, contact)
    point = trim_point(mode, speed, position=position)
    outputs = transformed.system.outputs
    return Analysis(
        point, point.linear, mode.free_state_names, outputs, float(np.asarray(transformed.system.dead_time))
    )


def invariant_zeros(linear: Linear, output: int = 0) -> Complex:
    """Finite invariant zeros in 1/s from the input to one output.

    They are the generalised eigenvalues of Rosenbrock's system matrix without those at infinity.
    """
    n = len(linear.A)
    M = np.block([[linear.A, linear.B], [linear.C[output : output + 1], linear.D[output : output + 1]]])
    N = np.zeros_like(M)
    N[:n, :n] = np.eye(n)
    scale = float(np.linalg.norm(linear.A, 2)) or 1.0
    rows = np.append(np.full(n, 1.0 / scale), 1.0 / (np.abs(M[n]).max() or 1.0))
    columns = np.append(np.ones(n), scale / (np.abs(linear.B).max() or 1.0))
    alpha, beta = eig(
        rows[:, None] * M * columns, rows[:, None] * N * columns * scale, right=False, homogeneous_eigvals=True
    )
    finite = np.abs(beta) > 1e-8 * np.abs(alpha)
    return np.asarray(alpha[finite] / beta[finite] * scale)


def oscillatory_modes(roots: Complex) -> tuple[OscillatoryMode, ...]:
    """Conjugate pairs among poles or zeros, lowest frequency first."""
    pairs = sorted((r for r in roots if r.imag > 1e-6 * abs(r)), key=abs)
    return tuple(OscillatoryMode(float(abs(r) / (2.0 * np.pi)), float(-r.real / abs(r))) for r in pairs)
