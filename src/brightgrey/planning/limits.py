"""Limits of a motion that is planned."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Self, cast

from brightgrey.effects import POSITION, SPEED, TORQUE
from brightgrey.effects.quantities import Dimension
from brightgrey.errors import SettingsError, one_of
from brightgrey.recordings.units.signals import Units

__all__ = ["MachineLimits", "read_limits", "unit_of"]

ACCELERATION, JERK = Dimension(0, 1, -2), Dimension(0, 1, -3)
_DIMENSIONS = {
    "torque": TORQUE,
    "rms_torque": TORQUE,
    "speed": SPEED,
    "acceleration": ACCELERATION,
    "jerk": JERK,
    "travel": POSITION,
    "twist": POSITION,
}


@dataclass(frozen=True)
class MachineLimits:
    """Limits of a motion, SI, none of which may be exceeded.

    Attributes
    ----------
    torque, rms_torque : float
        Largest and root mean square torque in N m (N).
    speed, acceleration : float
        Of the first mass, in rad/s and rad/s² (m).
    jerk : float
        Largest slope of the torque over the total inertia, in rad/s³ (m/s³): what a rigid drive would do.
    travel : float
        Range of the position of the first mass, in rad (m); the motion may use it on either side of its start.
    twist : float
        Largest twist of a shaft in rad (m), its gap included; infinite if the drive has none to protect.
    """

    torque: float
    rms_torque: float
    speed: float
    acceleration: float
    jerk: float
    travel: float
    twist: float = math.inf

    @classmethod
    def of(cls, reached: Mapping[str, float], given: Mapping[str, object], units: Units) -> Self:
        """Limits in SI: those that are `given` in the units of the recording, and else what it reached.

        Raises
        ------
        SettingsError
            For an unknown limit, or one that is not a positive number.
        """
        for name, value in given.items():
            one_of("limit", name, _DIMENSIONS)
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < math.inf:
                raise SettingsError(
                    f"limit of {name} is {value!r}; a positive number in {unit_of(name, units)} is wanted"
                )
        si = {name: cast(float, value) / units.of(_DIMENSIONS[name])[1] for name, value in given.items()}
        return cls(**{f.name: si.get(f.name, reached.get(f.name, math.inf)) for f in fields(cls)})

    def shown(self, units: Units) -> dict[str, tuple[float, str]]:
        """Finite limits with their units, as the recording has them."""
        found = {name: getattr(self, name) for name in _DIMENSIONS}
        return {
            name: (value * units.of(_DIMENSIONS[name])[1], unit_of(name, units))
            for name, value in found.items()
            if math.isfinite(value)
        }


def unit_of(name: str, units: Units) -> str:
    """Unit of a limit in the units of the recording."""
    return units.of(_DIMENSIONS[name])[0]


def read_limits(path: str | Path) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """Limits of a TOML file, and the gains of its table ``controller`` if there is one, in the recording's units.

    Raises
    ------
    SettingsError
        If it cannot be read.
    """
    try:
        given = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise SettingsError(f"cannot read limits '{path}': {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"limits '{path}' are not TOML: {error}") from None
    controller = given.pop("controller", None)
    if controller is not None and not isinstance(controller, dict):
        raise SettingsError(f"limits '{path}': controller is {controller!r}; a table of gains is wanted")
    return given, controller
