"""A model made ready for calculation: settings, values, system and linear model, each made once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from brightgrey.arrays import Array
from brightgrey.control.linear.analysis import Analysis, analyse_system
from brightgrey.errors import SettingsError
from brightgrey.kit import StateSpace, assemble
from brightgrey.model.model import Model
from brightgrey.report.options import REPORT_OPTIONS
from brightgrey.simulation import Settings

__all__ = ["AssembledModel"]


@dataclass(frozen=True)
class AssembledModel:
    """A model with everything that the report calculates from it."""

    model: Model

    @property
    def varies_with_position(self) -> bool:
        """True if a load is a sine of the position: the linear model holds at one position."""
        return any(p.effect.search.wave is not None for p in self.model.structure.placed)

    @cached_property
    def settings(self) -> Settings:
        """Settings of the simulation, SI."""
        return self.model.settings_si()

    @cached_property
    def values(self) -> dict[str, float]:
        """Parameters, SI, by name."""
        return self.model.values_si()

    @cached_property
    def system(self) -> StateSpace:
        """State-space model, its outputs those of the recording; a differenced velocity counts as a velocity."""
        return self.with_values(self.values)

    def with_values(self, values: Mapping[str, float] | Mapping[str, Array]) -> StateSpace:
        """State-space model with other values of the parameters, SI, each a number or an array of shape (sets,)."""
        kinds = [s.physical for s in self.model.outputs]
        return assemble(self.model.structure, values, self.settings.f_tanh, kinds, self.model.input.mass)

    @cached_property
    def analysis(self) -> Analysis | None:
        """Linear model in steady motion at half of the recording's largest speed, SI; None without such a motion."""
        try:
            return analyse_system(self.system, speed=REPORT_OPTIONS.speed_share * self.settings.speed_scale)
        except (SettingsError, np.linalg.LinAlgError):
            return None
