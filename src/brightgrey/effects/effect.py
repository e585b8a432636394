"""The declaration of an effect: everything that the rest of the package knows about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects.law import Law
from brightgrey.effects.modelica import Modelica
from brightgrey.effects.quantities import Dimension, Scales
from brightgrey.effects.symbol import Symbol
from brightgrey.effects.system import Draft, Stamp, Values

__all__ = ["Caution", "Circumstances", "Effect", "Fault", "Parameter", "SearchHints", "Stage"]

Stage = Literal["masses", "friction", "gravity", "backlash", "current control", "delay"]
"""Stages in which effects are stamped, in the order of the paper's section 2.2."""


class Fault(NamedTuple):
    """Meaning of a parameter's change when a machine is monitored. Parameters of one subject change together.

    Attributes
    ----------
    subject : str
        Name of the fault for people, e.g. ``friction``.
    grows : bool
        Only growth is a fault; otherwise any change is reported.
    """

    subject: str
    grows: bool = True


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Attributes
    ----------
    symbol : str
        Fixed name, e.g. ``M_C``; at another place than 1 it is written ``M_C@2``.
    dimension : Dimension
        Unit as powers of input unit, motion unit and second.
    about : str
        One sentence for people.
    bounds : callable
        ``bounds(scales) -> (low, high)``: the range worth searching, SI.
    start : callable
        ``start(scales) -> value``: a first guess within the bounds, SI.
    scale : {'log', 'linear'}
        Scale in which the range is searched. ``log`` is for parameters that are always positive.
    lag : bool
        To first order, the parameter is a time by which the input comes late. Below one sampling interval it cannot
        be told from sampling, and of several such parameters a recording may show only the sum.
    size : bool
        The effect vanishes where this parameter is zero.
    half : bool
        It is half of what people speak of, as of a gap; its value is then shown as ±.
    fault : Fault or None
        Meaning of its change when a machine is monitored; None where nothing wears or is exchanged.
    period : float
        Values that differ by this, SI, mean the same, as of an angle; infinite for other parameters.
    """

    symbol: str
    dimension: Dimension
    about: str
    bounds: Callable[[Scales], tuple[float, float]]
    start: Callable[[Scales], float]
    scale: Literal["log", "linear"] = "log"
    lag: bool = False
    size: bool = False
    half: bool = False
    fault: Fault | None = None
    period: float = np.inf


@dataclass(frozen=True)
class Circumstances:
    """Facts by which a caution is judged after an estimation, all in SI.

    Attributes
    ----------
    values : mapping of str to float
        The effect's own parameters by bare symbol, and those of the effects that it requires.
    scales : Scales
    f_tanh : float
    beside : tuple of Law
        Laws of the other effects at the same place.
    reverses : bool
        The drive moves both ways in the recordings.
    """

    values: Mapping[str, float]
    scales: Scales
    f_tanh: float
    beside: tuple[Law, ...]
    reverses: bool


@dataclass(frozen=True)
class Caution:
    """Something that a recording cannot tell about an effect.

    Attributes
    ----------
    kind : {'confounded', 'not observable'}
        Something else looks the same, or the recording shows nothing of it.
    symbols : tuple of str
        The effect's parameters that are concerned.
    applies : callable
        ``applies(circumstances) -> bool``.
    text : str
        Sentence for people, without the parameter's name in front.
    """

    kind: Literal["confounded", "not observable"]
    symbols: tuple[str, ...]
    applies: Callable[[Circumstances], bool]
    text: str


@dataclass(frozen=True)
class LimitingCase:
    """Another effect at the same place that an effect comes to, alone or with others, for some of its values."""

    effect: str
    values: Callable[[Values], Mapping[str, float]]  #: Its parameters, SI, by those of the effect; bare symbols.
    contained: bool = False  #: Where the effect stands in its place, it keeps its verdict.


@dataclass(frozen=True)
class SearchHints:
    """Knowledge of an effect that helps a search to find its parameters. All of it is optional.

    Values have the shape (parameters, K), in the order of the effect's parameters, SI. A *share* has that shape too
    and holds points of the unit cube.

    Attributes
    ----------
    sample : callable or None
        ``sample(scales, share) -> values``: plausible values. For effects whose parameters are plausible only
        together; without it, each parameter is drawn from its own range.
    perturb : callable or None
        ``perturb(values, share, omega) -> values``: other values that a recording can hardly tell from these, for
        effects whose parts can change roles. The new part resonates at `omega` in rad/s, shape (K,); not a number
        leaves its frequency open.
    enumerate : callable or None
        ``enumerate(values, omega) -> values``: all that `perturb` can do, on a grid. The values have the shape
        (parameters,), and for each of the frequencies, shape (K,), there are equally many candidates: the result
        has the shape (parameters, K, candidates).
    merge : callable or None
        ``merge(values, masses) -> [{symbol: value}]``: the chains of so many masses that may behave alike, for effects
        with more masses. Here `values` are given by symbol.
    wave : (str, str) or None
        Symbols of the wave number and the phase of a torque that opposes the motion by a sine of the position. Too
        many periods may lie within the travel for draws to meet the right number. So starts take it from a spectrum.
    """

    sample: Callable[[Scales, Array], Array] | None = None
    perturb: Callable[[Array, Array, Array], Array] | None = None
    enumerate: Callable[[Array, Array], Array] | None = None
    merge: Callable[[Mapping[str, float], int], Sequence[Mapping[str, float]]] | None = None
    wave: tuple[str, str] | None = None


@dataclass(frozen=True)
class Effect:
    """A submodel of the function set: everything that the rest of the package knows about a physical effect.

    Attributes
    ----------
    name : str
        Fixed name, e.g. ``coulomb``.
    number : int
        Number in the paper's figure 7; later effects continue the count.
    title : str
        Name for people.
    words : str
        Name within a sentence, with its article where it has one: ``a constant load``, ``dead time``. Effects that
        bring masses are named by the last of these, ``a second mass``.
    about : str
        What the effect is, and when it is not the right one.
    matters : str
        When it matters for motion or control.
    confused_with : str
        What looks alike in a recording, and what tells them apart.
    in_linear_axis : str
        Sentences on what it stands for in a linear axis, where the part that it is named after cannot be there.
    equation : str
        The law in plain text.
    source : str
        Equation of the paper, or DOI.
    stage : str
        Stage in which it is stamped.
    where : {'drive', 'mass', 'shaft'}
        What it is placed at. Places are counted from the motor, from 1.
    parameters : tuple of Parameter
    stamp : callable
        ``stamp(draft, place, values) -> Draft``, without side effects; `values` maps bare symbols and ``f_tanh`` to
        floats or arrays.
    law : Law or None
        The law of the element that it adds, if it adds one.
    requires : tuple of str
        Effects that have to stand at the same place.
    excludes : tuple of str
        Effects that never stand at the same place.
    limiting_cases : tuple of LimitingCase
        Effects that it comes to together for some values: a position-dependent load over a short way is a constant one
        and a spring.
    masses : int
        Number of masses that it brings. Every structure has exactly one effect that brings any.
    relevant_size : callable or None
        ``relevant_size(scales, values, place) -> {symbol: value}``, SI: the effect at the least size that matters
        for control. `values` are those of the model without the effect, by name. The result may also change
        parameters that the model has, such as an inertia that is split.
    residual_signature : str
        What the residual follows if the effect is missing; for laws of at most one port.
    cautions : tuple of Caution
    search : SearchHints
    symbols : tuple of Symbol
        Its symbol in the drawing of a drive; several for an effect that brings several parts.
    modelica : Modelica or None
        How it is drawn in Modelica; without it, a model with this effect is exported as equations.
    """

    name: str
    number: int
    title: str
    words: str
    about: str
    equation: str
    source: str
    stage: Stage
    where: Literal["drive", "mass", "shaft"]
    parameters: tuple[Parameter, ...]
    stamp: Stamp
    matters: str = ""
    confused_with: str = ""
    in_linear_axis: str = ""
    law: Law | None = None
    requires: tuple[str, ...] = ()
    excludes: tuple[str, ...] = ()
    limiting_cases: tuple[LimitingCase, ...] = ()
    masses: int = 0
    relevant_size: Callable[[Scales, Values, int], Mapping[str, float]] | None = None
    residual_signature: str = ""
    cautions: tuple[Caution, ...] = ()
    search: SearchHints = SearchHints()
    symbols: tuple[Symbol, ...] = ()
    modelica: Modelica | None = None

    @property
    def contains(self) -> tuple[str, ...]:
        """Effects that keep their verdict where this one stands in their place."""
        return tuple(case.effect for case in self.limiting_cases if case.contained)

    @cached_property
    def _stamped(self) -> tuple[Draft, Draft]:
        """A drive of two masses before and after the stamp, all parameters being 1."""
        before = Draft() if self.masses else Draft.mass_chain((1.0, 1.0), (1.0,), (1.0,))
        if self.where == "drive" and not self.masses:
            before = replace(before, B=before.B[:, :1])
        return before, self.stamp(before, 1, {**{q.symbol: 1.0 for q in self.parameters}, "f_tanh": 1.0})

    @property
    def has_states(self) -> bool:
        """The effect has states of its own, so that it remembers."""
        before, after = self._stamped
        return len(after.states) > len(before.states)

    @property
    def port_reads(self) -> Literal["speed", "position", ""]:
        """Motion of its mass that the only port of its law reads; empty for other laws."""
        if self.law is None or self.law.ports != 1:
            return ""
        draft = self._stamped[1]
        read = np.flatnonzero(draft.elements[-1].H[0])
        if len(read) != 1:  # the twist of a shaft
            return ""
        return "speed" if draft.states[int(read[0])].at_rest == "speed" else "position"

    @property
    def detunes_resonances(self) -> bool:
        """Its torque is no straight line over the twist of a shaft, so that resonances move with their amplitude."""
        return self.where == "shaft" and self.law is not None and self.law.ports == 1 and not self.law.affine

    @property
    def may_be_unstable(self) -> bool:
        """Its torque is no straight line over the position of its mass: an arm may stand upright, and fall."""
        return self.law is not None and not self.law.affine and self.port_reads == "position"

    @property
    def is_dry_friction(self) -> bool:
        """Its torque reverses with the motion."""
        return self.law is not None and self.law.amplitude is not None

    @property
    def has_hard_limit(self) -> bool:
        """One of its states is kept between limits, as a position in a gap is; costs are rugged then."""
        return any(e.limits is not None for e in self._stamped[1].elements)
