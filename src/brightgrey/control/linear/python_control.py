"""Linear models as objects of the library python-control."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from brightgrey.errors import SettingsError
from brightgrey.kit import Linear

__all__ = ["python_control", "state_space"]


def python_control() -> Any:
    """Return the module ``control``.

    Raises
    ------
    SettingsError
        If it is not installed.
    """
    try:
        import control
    except ImportError:
        raise SettingsError("this needs python-control; install it with: pip install 'brightgrey[control]'") from None
    return control


def state_space(
    linear: Linear, states: Sequence[str], outputs: Sequence[str], dead_time: float = 0.0, order: int = 4
) -> Any:
    """Linear model as a ``control.StateSpace`` with named signals.

    Parameters
    ----------
    linear : Linear
    states, outputs : sequence of str
    dead_time : float
        Delay of the input, s. It becomes a Padé approximation before the plant.
    order : int
        Of the approximation.
    """
    control = python_control()
    plant = control.ss(*linear, states=list(states), inputs=["u"], outputs=list(outputs), name="drive")
    if dead_time <= 0.0:
        return plant
    delay = control.ss(control.tf(*control.pade(dead_time, order)), inputs=["u"], outputs=["delayed"], name="dead_time")
    return control.series(delay, plant, inputs=["u"], outputs=list(outputs), name="drive")
