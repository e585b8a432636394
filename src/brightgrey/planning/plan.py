"""Plan: the motion to record next, what it will decide, and what it asks of the machine."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from brightgrey.arrays import Array
from brightgrey.effects import POSITION, SPEED, TORQUE
from brightgrey.kit import Placed, Structure
from brightgrey.kit.in_words import effect_heading, structure_in_words
from brightgrey.planning.design import Designed
from brightgrey.planning.drive import PlannedDrive
from brightgrey.planning.envelope import MotionCommand, command_of, nominal_reaction
from brightgrey.planning.limits import ACCELERATION, MachineLimits
from brightgrey.planning.score import power_so_far
from brightgrey.search.policy import SELECTION
from brightgrey.search.undecided.question import Question
from brightgrey.version import __version__

__all__ = ["Decided", "Plan"]

_LIMIT_NAMES = {
    "torque": "peak torque",
    "rms_torque": "RMS torque",
    "speed": "speed",
    "acceleration": "acceleration",
    "jerk": "jerk",
    "travel": "travel",
    "twist": "twist of a shaft",
    "seconds": "time",
}


@dataclass(frozen=True)
class Decided:
    """Power to decide an effect or a tie, before and after the new recording."""

    title: str  #: Of the effect, or of the two structures.
    kind: str  #: 'size' or 'tied', see `Question`.
    before: float
    after: float


@dataclass(frozen=True)
class Plan:
    """A motion to be recorded, made by :func:`brightgrey.plan`.

    Attributes
    ----------
    drive : PlannedDrive
    limits : MachineLimits
        SI.
    given : mapping of str to float
        Limits that were given, in the units of the recording; the others are what the recordings reached.
    found : Designed
    seed : int
    gains_given : bool
        The gains of the controller were given; else they are designed for the model.
    """

    drive: PlannedDrive
    limits: MachineLimits
    given: Mapping[str, float]
    found: Designed
    seed: int
    gains_given: bool = False

    @property
    def t(self) -> Array:
        """Time in s, shape (samples,)."""
        return np.asarray(self.drive.known.sampling_time * np.arange(self.found.candidate.torque.size))

    @property
    def seconds(self) -> float:
        """Length in s."""
        return float(self.drive.known.sampling_time * self.found.candidate.torque.size)

    @property
    def decisions(self) -> tuple[Decided, ...]:
        """Effects and ties, each with the least power of its questions: an effect may be asked at two sizes."""
        asked = zip(self.drive.known.questions, self.found.powers, strict=True)
        least: dict[tuple[str, str], Decided] = {}
        for one in (Decided(_title(q), q.kind, power_so_far(self.drive, q), after) for q, after in asked):
            known = least.setdefault((one.title, one.kind), one)
            both = min(known.before, one.before), min(known.after, one.after)
            least[one.title, one.kind] = replace(known, before=both[0], after=both[1])
        return tuple(least.values())

    @cached_property
    def command(self) -> MotionCommand:
        """Torque of the plan, and in closed loop the setpoint, SI."""
        return command_of(self.drive, self.found.candidate.torque)

    @property
    def controller(self) -> dict[str, tuple[float, str]]:
        """Gains of the controller with their units, as the recording has them; none in open loop."""
        return {} if self.drive.loop is None else self.drive.loop.shown(self.drive.model.units)

    @cached_property
    def columns(self) -> dict[str, Array]:
        """Columns of plan.csv in the units of the recording: the motion of the first mass, and the torque.

        In closed loop they are the setpoint and the feed-forward.
        """
        units, setpoint = self.drive.model.units, self.command.setpoint
        if setpoint is None:
            nominal = nominal_reaction(self.drive, self.command)
            q, v, names = nominal.position[0, :, 0], nominal.velocity[0, :, 0], ("", "torque")
        else:
            q, v, names = setpoint.position, setpoint.velocity, ("setpoint ", "feed-forward torque")
        parts = {
            f"{names[0]}position": (q, POSITION),
            f"{names[0]}velocity": (v, SPEED),
            f"{names[0]}acceleration": (np.gradient(v, self.drive.known.sampling_time), ACCELERATION),
            names[1]: (self.command.torque, TORQUE),
        }
        shown = {f"{name} [{units.of(d)[0]}]": x * units.of(d)[1] for name, (x, d) in parts.items()}
        return {"t [s]": self.t, **shown}

    def csv_text(self) -> str:
        """Text of plan.csv."""
        table = zip(*(x.tolist() for x in self.columns.values()), strict=True)
        rows = ["".join((",".join(f"{value:.8g}" for value in row), "\n")) for row in table]
        return ",".join(self.columns) + "\n" + "".join(rows)

    def toml_text(self) -> str:
        """Text of plan.toml: what was planned, with which limits, and what it is to decide."""
        units, found = self.drive.model.units, self.found
        digest = hashlib.sha256(self.csv_text().encode()).hexdigest()
        lines = [
            f'version = "{__version__}"',
            f"seed = {self.seed}",
            f"seconds = {self.seconds:.6g}",
            f'family = "{found.candidate.family.name}"',
            f"numbers = [{', '.join(f'{x:.6g}' for x in found.candidate.numbers)}]",
            f"motions_tried = {found.tried}",
            f'structure = "{self.drive.known.model.structure}"',
            f'plan_csv_sha256 = "{digest}"',
            "",
            "[limits]",
        ]
        for name, (value, unit) in self.limits.shown(units).items():
            origin = "given" if name in self.given else "reached by the recordings"
            lines.append(f"{name} = {value:.6g}  # {unit}, {origin}; {100.0 * self.use(name):.0f} % used")
        if self.controller:
            lines += ["", "[controller]"]
            origin = "given" if self.gains_given else "designed for the model"
            lines += [f"{name} = {value:.6g}  # {unit}, {origin}" for name, (value, unit) in self.controller.items()]
        for d in self.decisions:
            lines += ["", "[[decides]]", f'what = "{d.title}"', f'kind = "{d.kind}"']
            lines += [f"power_before = {d.before:.3f}", f"power_after = {d.after:.3f}"]
        return "\n".join(lines) + "\n"

    def use(self, name: str) -> float:
        """Part of a limit that 99 % of the draws of the parameters keep below."""
        return self.found.envelope.of_most(self.found.envelope.use[name])

    @property
    def gains(self) -> dict[str, float]:
        """Standard deviation of each parameter after over before the new recording, by the information."""
        known = self.drive.known.model
        before, after = (np.linalg.pinv(np.array(H), rcond=1e-13, hermitian=True) for H in self._information)
        ratio = np.sqrt(np.maximum(np.diag(after), 0.0) / np.maximum(np.diag(before), 1e-300))
        own = self.drive.model.parameters
        return {n: float(r) for n, r in zip(known.names, ratio, strict=True) if n in own}

    @property
    def _information(self) -> tuple[Array, Array]:
        return np.array(self.drive.known.model.information), self.found.score.information

    def sentences(self) -> list[str]:
        """The plan in words."""
        position, unit = next((x, n) for n, x in self.columns.items() if "position [" in n)
        travel = np.ptp(position)
        lines = [f"{d.title}: power {d.before:.2f} → {d.after:.2f}" for d in self.decisions]
        lines.append(
            f"{self.found.candidate.family.name[0].upper()}{self.found.candidate.family.name[1:]}: "
            f"{self.seconds:.1f} s, {travel:.3g} {unit[unit.index('[') + 1 : -1]} of travel, peak torque "
            f"{100.0 * self.use('torque'):.0f} %, rms {100.0 * self.use('rms_torque'):.0f} % of the limit"
        )
        gains = self.gains
        if gains:
            typical = float(np.exp(np.mean(np.log(np.maximum(list(gains.values()), 1e-6)))))
            best = min(gains, key=lambda name: gains[name])
            lines.append(
                f"Intervals of the parameters become {100.0 * typical:.0f} % of what they are, that of {best} "
                f"{100.0 * gains[best]:.0f} %"
            )
        return lines

    def cautions(self) -> list[str]:
        """Sentences on all that stays open and could go wrong."""
        found, lines = self.found, []
        if found.relaxed and min(found.powers) < SELECTION.min_power:
            now = min(found.powers)
            name, best = max(found.relaxed, key=lambda pair: pair[1])
            text = f"Nothing within the limits decides everything: the smallest power is {now:.2f}"
            if best > now + 0.05:
                text += f". In the way is the {_LIMIT_NAMES[name]}: twice as much gives {best:.2f}"
            else:
                text += ", and no single limit is in the way: twice as much of any does not help"
            lines.append(text)
            if len(found.score.answers) < len(found.powers):
                lines.append(
                    "Questions with a power below 0.10 are given up: the motion serves the others, and the parameters"
                )
        lines += [
            f"{effect_heading(Placed.parse(effect))}: not asked, because {why}"
            for effect, why in self.drive.known.not_asked.items()
        ]
        if any(q.kind == "tied" for q in self.drive.known.questions):
            lines.append(
                "Where structures explain the recordings alike, the power is a mean over truths that have a part of "
                "the effects of either"
            )
        assumed = [_LIMIT_NAMES[f.name] for f in fields(self.limits) if f.name not in self.given and f.name != "twist"]
        if assumed:
            lines.append(f"Limits of {', '.join(assumed)} are what the recordings reached; --limits sets others")
        kept = found.envelope.share_kept()
        lines.append(
            f"Limits are kept for {100.0 * kept:.1f} % of {len(found.envelope.end_speed)} draws of the parameters, "
            "with the drive as identified"
        )
        lines.append(self._caution_of_the_loop())
        if not np.isfinite(self.limits.twist) and self.drive.model.structure.masses > 1:
            lines.append("No limit of the twist was given: the shafts may be rung at their resonance")
        return lines

    def _caution_of_the_loop(self) -> str:
        """Sentence on what the controller does, or on its absence."""
        if self.drive.loop is None:
            return (
                "Without a position controller the end position is uncertain: keep the end switches active, and begin "
                "with a tenth of the torque"
            )
        gains = ", ".join(f"{name} {value:.3g} {unit}" for name, (value, unit) in self.controller.items())
        text = (
            f"The limits hold with the gains {gains} and without noise of the sensor in the loop; the controller and "
            f"the feed-forward together demand up to {100.0 * self.use('torque'):.0f} % of the torque"
        )
        return text if self.gains_given else f"{text}. These gains suit the model: set them in the drive, or give yours"


def _title(question: Question) -> str:
    if question.kind == "tied":
        both = [structure_in_words(Structure.parse(str(s))) for s in (question.truth, question.rival.structure)]
        return f"{both[0][:1].upper()}{both[0][1:]} against {both[1]}"
    (effect,) = question.effects
    return effect_heading(Placed.parse(effect))
