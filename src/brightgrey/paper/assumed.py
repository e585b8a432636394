"""Values, ranges and resolution of the paper's experiment (section 4) that the paper does not give."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

__all__ = ["ASSUMED", "RANGE", "RESOLUTION"]

ASSUMED: Mapping[str, float] = MappingProxyType(
    {
        "J1": 0.010,
        "J2": 0.010,
        "J3": 0.006,
        "J4": 0.004,
        "c1": 90.0,
        "c2": 150.0,
        "c3": 200.0,
        "d1": 0.05,
        "d2": 0.05,
        "d3": 0.05,
        "M_C": 0.7,
        "f_v": 0.02,
        "M_S": 0.8,
        "omega_S": 7.0,
        "M_G": 0.5,
        "alpha": 0.01,
        "T_1": 0.003,
        "T_d": 0.005,
    }
)
"""Assumed value of every parameter in the paper's experiment, SI; the paper gives no number.

The values of the reference drive are off by 17 to 40 %, so that no start is the truth by construction. The values of
the other submodels decide how well their absence shows. A range from half to twice the assumed value excludes zero.
Only gravity, which is centred on zero, and a light, stiffly coupled third mass can be present without an effect.
"""

RANGE = (0.5, 2.0)
"""Bounds over assumed value (paper section 4); a parameter of either sign has ± the upper one."""

RESOLUTION = 1e-3
"""Step in rad/s that the reference's velocity is rounded to: the floor of the residual sum of squares.

The paper's data have no noise and double precision. The step is 2.5e-5 of the peak, five times the simulation error at
level ``fast``. The paper's setting never gets near it; least squares does.
"""
