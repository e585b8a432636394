"""Output feedback that keeps a simulation close to the measured motion, for a homotopy.

Where friction sticks or a gap closes, a slightly wrong parameter leads to another motion, and the cost says nothing
about the parameter. A torque in proportion to the speed error keeps the simulation close to the measurement. The
residual then resembles that of a torque balance, whose valleys are wide. As the gain is lowered step by step, fits
arrive at the cost of the free simulation (Vyasarayani, Uchida, McPhee 2012, doi:10.1103/PhysRevE.85.036201).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.kit import StateSpace
from brightgrey.recordings import Recording

__all__ = ["measured_speed", "with_output_feedback"]


def measured_speed(recording: Recording) -> Array | None:
    """Measured speed of the driven mass, shape (samples,), noise included; None if it can be had from no output."""
    kinds = [signal.kind if signal.mass == recording.input.mass else "" for signal in recording.outputs]
    for kind in ("velocity", "velocity-differenced", "position"):
        if kind in kinds:
            y = recording.y[kinds.index(kind)]
            return np.asarray(np.gradient(y, recording.dt)) if kind == "position" else y
    return None


def with_output_feedback(system: StateSpace, recording: Recording, gain: float) -> tuple[StateSpace, Array]:
    """Add ``gain`` times the speed error to the input: returns the system with feedback, and its input.

    The feedback passes through the input dynamics of the drive like the input itself. With the true parameters the
    speed error is noise, apart from a dead time, which delays only the measurement.

    Parameters
    ----------
    system : StateSpace
    recording : Recording
    gain : float
        Torque per speed, N m s/rad (N s/m); 0 returns the system and the input of the recording unchanged.
    """
    speed = measured_speed(recording) if gain else None
    if speed is None:
        return system, recording.u
    feedback = -gain * np.eye(len(system.states))[system.state_names.index(f"v{recording.input.mass}")]

    def closed(matrix: Array, column: Array) -> Array:
        """Closed loop for `matrix` (rows, n) of x and `column` (rows,) of u, both perhaps with K sets."""
        return matrix + (column[:, None] * feedback[:, None] if column.ndim > 1 else np.outer(column, feedback))

    elements = tuple(replace(e, H=closed(e.H, e.K)) for e in system.elements)
    A, C = closed(system.A, system.B[:, 0]), closed(system.C, system.D[:, 0])
    return replace(system, A=A, C=C, elements=elements), recording.u + gain * speed
