"""Levels and limits by which estimates are judged."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["UNCERTAINTY_DEFAULTS", "UncertaintyOptions"]


@dataclass(frozen=True)
class UncertaintyOptions:
    """Levels and limits by which estimates are judged."""

    zero_bound: float = 1e-3  #: A low bound below this part of the high one stands for zero: the parameter may vanish.
    blind_singular_value: float = 1e-7  #: Relative to the largest; a direction below it cannot be seen at all.
    #: Standard deviation of a logarithm from which a direction is loose: its 95 % interval spans a factor of 50.
    loose_std_log: float = 1.0
    #: The same for a linear parameter, as part of its range: its 95 % interval spans the range.
    loose_std_linear: float = 0.25
    participation: float = 0.1  #: Components of a direction below this part of the largest do not take part in it.
    #: Ratios of the steps of two parameters within which their sum or difference is identified.
    equal_steps: tuple[float, float] = (0.8, 1.25)
    #: Largest power in a product of parameters that is worth writing, and rounding error that is accepted.
    max_power: float = 3.0
    power_rounding: float = 0.1
    #: Probability that recordings that agree are called different, over all parameters together.
    heterogeneity_level: float = 0.01


UNCERTAINTY_DEFAULTS = UncertaintyOptions()
