"""Stage 1: what is known of the drive before anything is recorded."""

from __future__ import annotations

from functools import partial
from typing import Any

from brightgrey.app.stages.stage import Stage
from brightgrey.app.widgets import action, alert, choice, entry, heading, hint, option_row, paragraph, raw, tag
from brightgrey.app.workspace.project import AxisChoice, KnownParameter

__all__ = ["DriveStage"]

MASSES = {"1": "one", "2": "two", "3": "three", "4": "four"}
LIMITS = {
    "torque": ("Largest torque or force", "In the unit of the recording's input."),
    "rms_torque": ("Continuous torque or force", "Root mean square over a motion."),
    "speed": ("Largest speed", "In the recording's unit of motion per second."),
    "acceleration": ("Largest acceleration", "In the recording's unit of motion per second squared."),
    "travel": ("Travel", "How far the axis may move, in the recording's unit of motion."),
    "twist": ("Largest twist of a shaft", "To protect it, in the recording's unit of motion."),
}


class DriveStage(Stage):
    """Choices about motion, masses, effects, parameters and limits."""

    name = "drive"
    title = "What do you know of the drive?"
    lead = "Only what you are sure of: everything else is found out from the recording. You can leave all of it open."

    def content(self) -> None:
        """Build choices on the left and the drawing that follows them on the right."""
        drive = self.document.drive
        with tag("div"):
            with tag("div", "", "two"):
                option_row(
                    "What moves",
                    drive.motion,
                    {"rotary": "It turns (torque, angle)", "linear": "It slides (force, way)"},
                    lambda value: self.change(again=False, motion=value),
                    key="motion",
                )
                with tag("fieldset", "", "choices"):
                    tag("legend", "Masses that move against each other")
                    tag("span", "A motor on a stiff shaft is one mass; with a belt or a long shaft it is two.", "about")
                    with tag("div", "", "row"):
                        choice("At least", str(drive.least_masses), MASSES, self.least, key="least")
                        choice("At most", str(drive.most_masses), MASSES, self.most, key="most")
            self.problem = tag("div")
            heading("The drive as far as it is known", 2)
            self.picture = tag("div", "", "drawing")
        with tag("details", open=bool(drive.certain or drive.absent) or None):
            with tag("summary"):
                heading("Friction, play and other effects", 2)
            self.effects = tag("div")
        self.known_parameters()
        self.limits()
        self.page.later(self.fill())

    def onward(self) -> None:
        """Button to the next stage; it confirms what is chosen."""

        def confirm() -> None:
            self.change(again=False, confirmed=True)
            self.page.go("recording")

        with tag("footer", "", "onward"):
            action("Continue", confirm, key="continue", primary=True)

    def change(self, *, again: bool = True, **changes: Any) -> None:
        """Change what is known; unless the stage is built again, only the drawing follows."""
        self.page.edit(
            lambda d: d.model_copy(update={"drive": AxisChoice.model_validate({**d.drive.model_dump(), **changes})}),
            again=again,
        )
        if not again:
            self.document = self.page.document
            self.page.later(self.redraw())

    def least(self, value: str) -> None:
        """Set the least number of masses; the most follows if it is smaller."""
        count = int(value)
        most = self.document.drive.most_masses
        self.change(again=count > most, least_masses=count, most_masses=max(count, most))

    def most(self, value: str) -> None:
        """Set the largest number of masses; the least follows if it is larger."""
        count = int(value)
        least = self.document.drive.least_masses
        self.change(again=count < least, most_masses=count, least_masses=min(count, least))

    async def fill(self) -> None:
        """Build what the desk has to be asked for."""
        self.choices = await self.still(self.services.desk.call("effect_choices"))
        with self.effects:
            self.effect_table()
        await self.redraw()

    async def redraw(self) -> None:
        """Draw the drive and say what contradicts itself."""
        drive = self.document.drive
        said = await self.still(self.services.desk.call("check_drive", drive.model_dump()))
        self.problem.clear()
        if said:
            with self.problem:
                alert(said)
        drawn = await self.still(
            self.services.desk.call(
                "drive_picture", drive.motion, drive.least_masses, drive.most_masses, drive.certain, drive.absent
            )
        )
        self.picture.clear()
        with self.picture:
            raw(drawn)

    def effect_table(self) -> None:
        """Build a choice for every effect."""
        drive = self.document.drive
        states = {"open": "may be there", "certain": "is there for sure", "absent": "is not there"}
        with tag("div", "", "cards"):
            for effect in self.choices["effects"]:
                name = effect["name"]
                state = "certain" if name in drive.certain else "absent" if name in drive.absent else "open"
                with tag("div", "", "pair"):
                    hint(effect["title"], f"{effect['about']} {effect['equation']}")
                    choice(
                        effect["title"],
                        state,
                        states,
                        partial(self.set_effect, name),
                        key=f"effect-{name}",
                        unseen=True,
                    )

    def set_effect(self, name: str, state: str) -> None:
        """Say whether an effect is there."""
        drive = self.document.drive
        certain = [n for n in drive.certain if n != name] + ([name] if state == "certain" else [])
        absent = [n for n in drive.absent if n != name] + ([name] if state == "absent" else [])
        self.change(again=False, certain=tuple(certain), absent=tuple(absent))

    def known_parameters(self) -> None:
        """Build the list of known values."""
        known = self.document.drive.known
        with tag("details", open=bool(known) or None):
            with tag("summary"):
                heading("Known values", 2)
            paragraph(
                "A value from a data sheet is held; a range limits the search. The unit follows from the recording: "
                "with N m and rad, an inertia is in kg m², with V and mm it is in V s²/mm.",
                "soft",
            )
            for at, parameter in enumerate(known):
                with tag("div", "", "row known"):
                    entry("Parameter", parameter.name, partial(self.set_known, at, "name"), key=f"known-{at}")
                    entry("Value, or from", parameter.low, partial(self.set_known, at, "low"), key=f"low-{at}")
                    entry("to", parameter.high, partial(self.set_known, at, "high"), key=f"high-{at}")
                    action("Remove", partial(self.remove_known, at), key=f"remove-known-{at}")
            action("Add a value", self.add_known, key="add-known")
            paragraph(
                "J1 is the inertia (mass) at the motor, J2 that of the next mass, c1 and d1 stiffness and damping of "
                "the shaft between them, M_C Coulomb friction, f_v viscous friction.",
                "soft",
            )

    def add_known(self) -> None:
        """Add an empty row."""
        self.change(known=(*(k.model_dump() for k in self.document.drive.known), {"name": "J1"}))

    def set_known(self, at: int, part: str, text: str) -> None:
        """Change a part of a known value: its name, or an end of its range."""
        known = list(self.document.drive.known)
        known[at] = KnownParameter.model_validate({**known[at].model_dump(), part: text.strip().replace(",", ".")})
        self.change(known=tuple(k.model_dump() for k in known))

    def remove_known(self, at: int) -> None:
        """Forget a known value."""
        self.change(known=tuple(k.model_dump() for i, k in enumerate(self.document.drive.known) if i != at))

    def limits(self) -> None:
        """Build the limits of the machine."""
        given = self.document.drive.limits
        with tag("details", open=bool(given) or None):
            with tag("summary"):
                heading("Limits of the machine", 2)
            paragraph(
                "They are kept when gains and the next motion are designed. What is empty is not limited.", "soft"
            )
            with tag("div", "", "cards"):
                for name, (label, about) in LIMITS.items():
                    text = given.get(name, "")
                    entry(
                        label,
                        text,
                        partial(self.set_limit, name),
                        key=f"limit-{name}",
                        about=about,
                        problem="" if _is_above_zero(text) else f"'{text}' is not a number above 0.",
                        inputmode="decimal",
                    )

    def set_limit(self, name: str, text: str) -> None:
        """Set a limit."""
        limits = {**self.document.drive.limits, name: text.strip().replace(",", ".")}
        self.change(limits={k: v for k, v in limits.items() if v})


def _is_above_zero(text: str) -> bool:
    try:
        return not text or float(text) > 0.0
    except ValueError:
        return False
