"""Recordings made of arrays."""

import numpy as np

from brightgrey.recordings import Recording, Signal

UNITS = {"position": "rad", "acceleration": "rad/s²"}


def make_recording(
    u,
    y,
    *,
    dt=1e-3,
    kind="velocity",
    names=("u", "v"),
    unit=None,
    input_unit="N m",
    input_unit_given=True,
    hold="linear",
    name="made",
    notes=(),
):
    """Recording from time 0 of an input `u`, shape (samples,), and of outputs `y`.

    `y` has the shape (samples,) or (outputs, samples). `kind` is that of the output, or a sequence with one for each.
    A single output has the second of `names`; several are numbered.
    """
    kinds = [kind] if isinstance(kind, str) else kind
    outputs = tuple(
        Signal(names[1] if len(kinds) == 1 else f"{names[1]}{i}", k, unit or UNITS.get(k, "rad/s"))
        for i, k in enumerate(kinds)
    )
    signal = Signal(names[0], "input", input_unit, unit_given=input_unit_given)
    return Recording(name, dt * np.arange(len(u)), u, np.atleast_2d(y), signal, outputs, hold, notes)
