"""Simulations that are held to the measured motion, so that they cannot lose it.

Where friction sticks or a gap closes, a slightly wrong parameter makes another motion from there on, and the cost of it
tells nothing. A torque in proportion to what the measured speed is off the simulated one holds the simulation to the
measured motion; the residual is then near that of the torque balance, and its valleys are wide. With less and less of
it descents are led to the cost of the free simulation (homotopy; Vyasarayani, Uchida, McPhee 2012,
doi:10.1103/PhysRevE.85.036201).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brightgrey.arrays import Array
from brightgrey.kit import StateSpace
from brightgrey.recordings import Recording

__all__ = ["measured_speed", "with_output_feedback"]


def measured_speed(recording: Recording) -> Array | None:
    """Speed as it was measured, shape (samples,), noise included; None if only the acceleration was."""
    kinds = [signal.kind for signal in recording.outputs]
    for kind in ("velocity", "velocity-differenced", "position"):
        if kind in kinds:
            y = recording.y[kinds.index(kind)]
            return np.asarray(np.gradient(y, recording.dt)) if kind == "position" else y
    return None


def with_output_feedback(system: StateSpace, recording: Recording, gain: float) -> tuple[StateSpace, Array]:
    """`system` with ``gain`` times what its speed is behind the measured one added to the input, and that input.

    What the drive does to its input it does to this torque, too: the truth needs none of it, but for noise and
    for dead time, which only what was measured comes late by.
    """
    speed = measured_speed(recording) if gain else None
    if speed is None:
        return system, recording.u
    back = -gain * np.eye(len(system.states))[system.state_names.index("v1")]

    def fed(matrix: Array, column: Array) -> Array:
        """Of x, and what is fed back to u: `matrix` (rows, n) and `column` (rows,), both perhaps with K sets."""
        return matrix + (column[:, None] * back[:, None] if column.ndim > 1 else np.outer(column, back))

    elements = tuple(replace(e, H=fed(e.H, e.K)) for e in system.elements)
    A, C = fed(system.A, system.B[:, 0]), fed(system.C, system.D[:, 0])
    return replace(system, A=A, C=C, elements=elements), recording.u + gain * speed
