"""The drive of the paper's experiment, with every effect added that it lacks; its systems and recordings."""

import numpy as np

from brightgrey.excitation import PAPER_EXPERIMENT as E
from brightgrey.kit import Structure, assemble
from brightgrey.simulation import Settings
from brightgrey.simulation.reference import reference
from support.recordings import make_recording

VALUES = {**E.values, "M_G": 1.0, "alpha": 0.02, "T_1": 1e-3, "T_d": 1.5e-3}
SETTINGS = Settings(E.f_tanh, E.speed)


def values_of(text, **changed):
    return {name: {**VALUES, **changed}[name] for name in Structure.parse(text).parameters}


def system_of(text, outputs=("velocity",), **changed):
    return assemble(Structure.parse(text), values_of(text, **changed), E.f_tanh, outputs)


def recorded(text, seed, noise=0.02, torque=0.0, f_tanh=E.f_tanh, **changed):
    """Recording by the reference solver with white noise, and a disturbance that is not recorded."""
    rng = np.random.default_rng(seed)
    u, hold = E.torque()[::2], "zoh" if torque else "linear"
    pushed = u + torque * rng.normal(size=len(u))
    v = reference(text, values_of(text, **changed), pushed, 2 * E.dt, f_tanh=f_tanh, hold=hold)[0]
    y = v + noise * rng.normal(size=len(v))
    return make_recording(u, y, dt=2 * E.dt, names=("torque", "velocity"), hold=hold, name="simulated")
