"""The paper's experiment (§4): reference drive and excitation, fixed here and nowhere else.

The paper gives no number except the length of about 2 s. The values below describe a small servo axis.
The table gives the effect of each choice: the standard deviation, in per cent, of each parameter of the true
structure with 0.1 % noise on velocity (Cramér-Rao bound):

================================ ===== ===== ===== ==== ==== ==== ==== =======
choice                           J1    J2    c1    d1   M_C  f_v  M_S  omega_S
================================ ===== ===== ===== ==== ==== ==== ==== =======
as fixed                         0.06  0.09  0.03  0.3  0.4  0.7  0.5  1.8
torque with friction added       0.10  0.15  0.05  0.5  0.9  1.2  2.0  5.6
f_tanh 1.25 instead of 2.5 s/rad 0.07  0.10  0.03  0.3  0.4  0.8  0.6  1.9
f_tanh 5 s/rad                   0.07  0.10  0.03  0.3  0.4  0.7  0.5  1.8
================================ ===== ===== ===== ==== ==== ==== ==== =======

f_tanh 1.25 and 5 change velocity by 0.23 and 0.15 % of its peak, RMS: more than the demo's noise.
The other choices were varied on a similar drive (25 Hz, jerk 12,000 rad/s³, M_C 0.8, M_S 0.5 N m, f_v 0.01,
omega_S 5 rad/s, peak speed 57), with these standard deviations in per cent:

- resonance at 10, 25, 40 Hz: J1 0.04, 0.3, 0.7; d1 0.3, 1.6, 3.6. Above the spectrum of the jerk the resonance fades;
- jerk 6,000, 20,000, 40,000 rad/s³: J1 0.4, 0.2, 0.13; d1 2.1, 1.0, 0.7;
- M_C 0.4, 0.8, 1.6 N m: M_C 0.4, 0.2, 0.1; M_S 0.7, 1.1, 1.3;
- omega_S 2.5, 5, 10, 15 rad/s: M_S 2.0, 1.1, 0.7, 1.0; M_C 0.14, 0.17, 0.3, 0.7;
- rest between the moves 0.05, 0.2, 0.3 s: M_S 1.7, 0.6, 0.5. A drive that coasts to standstill shows how its
  friction bends there;
- distance 12, 16, 20, 24 rad: M_C 0.4, 0.25, 0.17, 0.12; M_S 0.6, 0.7, 1.1, 1.2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from brightgrey.arrays import Array
from brightgrey.excitation.motion import Motion, MotionLimits, reversing

__all__ = ["PAPER_EXPERIMENT", "Experiment", "driving_torque"]


@dataclass(frozen=True)
class Experiment:
    """A known drive, and the reversing motion that it is commanded."""

    structure: str  #: The true structure.
    values: Mapping[str, float]  #: Its parameter values, SI.
    f_tanh: float  #: Gain of eq. (2) in s/rad.
    dt: float  #: Sampling interval in s.
    samples: int
    limits: MotionLimits  #: Of the commanded motion.
    distance: float  #: Distance of the move and of the move back in rad.
    #: Rest before the first and between the two moves in s.
    before: float
    between: float
    speed: float  #: Largest speed that the drive reaches in rad/s, rounded.

    @property
    def inertia(self) -> float:
        """Sum of all moments of inertia in kg m²."""
        return sum(value for name, value in self.values.items() if name.startswith("J"))

    def motion(self) -> Motion:
        """Return the commanded motion."""
        return reversing(
            self.distance,
            self.limits,
            dt=self.dt,
            samples=self.samples,
            before=self.before,
            between=self.between,
        )

    def torque(self) -> Array:
        """Excitation in N m, shape (samples,)."""
        return driving_torque(self.motion(), self.inertia)


def driving_torque(motion: Motion, inertia: float) -> Array:
    """Return the torque in N m, shape (samples,), that leads a single mass without friction through `motion`.

    Paper §4: "a torque signal that would lead to a standard industrial jerk-limited reversing motion if
    applied to a single moving mass". This is inertia (kg m²) times acceleration, without friction. The drive moves
    all the same, because its friction is a fifth of the peak torque.

    The drive does not follow the motion, and that is wanted. It crosses standstill early and coasts to rest in
    the pauses, so that its speed passes slowly through the range where friction bends. With the drive's friction
    added to the torque it would stand still with the command. M_C, M_S and omega_S would then be two to four times
    less certain (table above), and the input would contain the friction that is to be identified.
    """
    return inertia * motion.acceleration


PAPER_EXPERIMENT = Experiment(
    structure="two_mass+coulomb+viscous+stribeck",
    values=MappingProxyType(
        {
            # Antiresonance at 15.4 Hz, resonance at 19.9 Hz, damped with 3 %: within the jerk's spectrum.
            "J1": 0.012,
            "J2": 0.008,
            "c1": 75.0,
            "d1": 0.036,
            # 1.5 N m at standstill and again at full speed: 19 % of the peak torque of 8 N m.
            "M_C": 0.9,
            "f_v": 0.015,
            "M_S": 0.6,
            # Well above 5/f_tanh = 2 rad/s, below which the bend is invisible, and well below max|v|/3 = 13 rad/s,
            # above which it looks like negative viscous friction.
            "omega_S": 5.5,
        }
    ),
    f_tanh=2.5,  # the default rule 100/max|v| for the speed of 40 rad/s that is reached
    dt=1e-3,
    samples=1800,
    limits=MotionLimits(speed=49.0, acceleration=400.0, jerk=20000.0),
    distance=15.0,
    before=0.05,
    between=0.36,
    speed=40.0,
)
"""Reference drive and excitation of the paper's §4."""
