"""Channels of a recording: which is the input, which are outputs, in which units and at which mass."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from brightgrey.app.stages.option_places import in_app_words
from brightgrey.app.widgets import alert, choice, entry, heading, hint, paragraph, raw, tag
from brightgrey.option_texts import NUMBERS, WHOLE_NUMBERS

__all__ = ["ChannelTable", "reading_options"]

CHANNEL_ROLES = {
    "": "not used",
    "input": "input: what drives",
    "position": "output: position",
    "velocity": "output: velocity",
    "velocity-differenced": "output: velocity from encoder differences",
    "speed": "output: speed without sign",
    "acceleration": "output: acceleration",
}
PLACES = {"1": "mass 1 (motor)", "2": "mass 2", "3": "mass 3", "4": "mass 4"}
FURTHER_OPTIONS = {
    "time": ("Column of the time", "Only if it is not found by its name."),
    "dt": ("Sampling interval in s", "Only for files without a column of time."),
    "input_gain": ("Factor of the input", "From the recorded number to its unit."),
    "actuator": ("Mass that the input acts on", "1, unless a given structure is driven elsewhere."),
    "decimate": ("Use every Nth sample", "For recordings that are sampled much faster than the drive moves."),
    "hold": ("Input between samples", "linear, or zoh if the controller holds it."),
    "torque_constant": ("Torque constant", "Torque per current, like 0.05 N m/A, if the input is a current."),
    "rated": (
        "What 100 % are",
        "For channels in per cent, like torque=9.84 N m; several are separated by a semicolon.",
    ),
    "counts": ("Increments per turn", "For channels in increments, like position=65536."),
    "gear": ("Factor of an output", "From the load to the motor, like position=5."),
    "shift": ("Time shift in s", "Of a channel whose clock is off, like velocity=0.003."),
}
_LISTS = ("rated", "counts", "gear", "shift")


@dataclass(frozen=True)
class _TablePolicy:
    """Form of the table."""

    several: int = 12  #: Channels from which on those that nobody uses are folded away.


TABLE = _TablePolicy()


class ChannelTable:
    """Table of the channels of a file, with a choice of the role of each."""

    def __init__(
        self, found: Mapping[str, Any], options: Mapping[str, Any], change: Callable[[dict[str, Any]], None]
    ) -> None:
        self.found, self.options, self.change = found, options, change
        self.units = dict(_pair(text) for text in options.get("unit", []))
        self.outputs: dict[str, tuple[str, str]] = {}
        for text in options.get("output", []):
            name, _, sensor = text.rpartition(":")
            kind, _, mass = sensor.partition("@")
            self.outputs[name or text] = (kind if name else "velocity", mass or "1")

    def build(self, label: str) -> None:
        """Build the table, with the reasons for what is suggested."""
        found = self.found
        heading("Channels", 2)
        paragraph(f"{label}: {found['format']}, {found['samples']:,} samples. What is chosen here holds for all files.")
        for text in (*found["questions"],):
            alert(in_app_words(f"{text[:1].upper()}{text[1:]}."), "note")
        if found["problem"]:
            said = found["problem"].partition(": name it by")[0]
            alert(f"{said[:1].upper()}{said[1:]}. Choose its role below.", "note")
        channels = found["channels"]
        used = [c for c in channels if self.role(c["name"]) or c["quantity"]]
        rest = [c for c in channels if c not in used]
        folded = rest if len(channels) > TABLE.several else []
        self.rows([c for c in channels if c not in folded])
        if folded:
            with tag("details"):
                tag("summary", f"{len(folded)} further channels")
                self.rows(folded)
        if found["why"]:
            with tag("details"):
                tag("summary", "Why these are suggested")
                with tag("ul"):
                    for text in found["why"]:
                        tag("li", text)

    def rows(self, channels: list[Mapping[str, Any]]) -> None:
        """Build rows of channels."""
        with tag("div", "", "scroll"), tag("table", "", "stack"):
            tag("caption", "Channels of the file", "unseen")
            with tag("thead"), tag("tr"):
                for text in ("Channel", "Over time", "Range", "Might be", "Role", "Unit", "At"):
                    tag("th", text, scope="col")
            with tag("tbody"):
                for channel in channels:
                    self.row(channel)

    def row(self, channel: Mapping[str, Any]) -> None:
        """Build the row of one channel."""
        name, role = channel["name"], self.role(channel["name"])
        with tag("tr", "", "dim" if channel["constant"] else ""):
            tag("td", name, "name")
            raw(channel["spark"], "td")
            span = " ".join(text for text in (channel["range"], channel["unit"]) if text)
            tag("td", ", ".join(text for text in (span, channel["step"], channel["holes"]) if text), data_label="range")
            with tag("td"):
                if channel["words"]:
                    hint(channel["words"], channel["reason"] or "the numbers say so")
            with tag("td", "", "wide"):
                choice(
                    f"Role of {name}",
                    role,
                    CHANNEL_ROLES | ({"": "time"} if channel["quantity"] == "time" else {}),
                    lambda v: self.set_role(name, v),
                    key=f"role-{name}",
                    unseen=True,
                )
            with tag("td"):
                if role:
                    entry(
                        f"Unit of {name}",
                        self.units.get(name, channel["unit"]),
                        lambda text: self.set_unit(name, text),
                        key=f"unit-{name}",
                        unseen=True,
                        size="8",
                    )
            with tag("td"):
                if role and role != "input":
                    mass = self.outputs[name][1]
                    choice(
                        f"Place of {name}",
                        mass,
                        PLACES,
                        lambda v: self.set_mass(name, v),
                        key=f"at-{name}",
                        unseen=True,
                    )

    def role(self, name: str) -> str:
        """Role of a channel: empty, ``input``, or the kind of output."""
        return "input" if name == self.options.get("input") else self.outputs.get(name, ("", ""))[0]

    def set_role(self, name: str, role: str) -> None:
        """Give a channel a role; the last input loses its own."""
        outputs = {n: o for n, o in self.outputs.items() if n != name}
        given = self.options.get("input")
        if role == "input":
            given = name
        elif given == name:
            given = None
        if role not in ("", "input"):
            outputs[name] = (role, self.outputs.get(name, ("", "1"))[1])
        self.change({"input": given, "output": _texts(outputs), "unit": self.unit_texts(given, outputs)})

    def set_mass(self, name: str, mass: str) -> None:
        """Say at which mass an output is measured."""
        outputs = {**self.outputs, name: (self.outputs[name][0], mass)}
        self.change({"output": _texts(outputs)})

    def set_unit(self, name: str, unit: str) -> None:
        """Say in which unit a channel is."""
        self.units[name] = unit.strip()
        self.change({"unit": self.unit_texts(self.options.get("input"), self.outputs)})

    def unit_texts(self, given: str | None, outputs: Mapping[str, Any]) -> list[str]:
        """Units of the channels that are used, as an option has them; and that of the time."""
        kept = [n for n in self.units if n == given or n in outputs or n == self.options.get("time") or n == "t"]
        return [f"{n}={self.units[n]}" for n in kept if self.units[n]]


def reading_options(options: Mapping[str, Any], change: Callable[[dict[str, Any]], None]) -> None:
    """Build the options that few files need."""
    given = {name: options[name] for name in FURTHER_OPTIONS if name in options}
    with tag("details", open=bool(given) or None):
        with tag("summary"):
            heading("Gears, per cent, clocks and other options", 3)
        with tag("div", "", "cards"):
            for name, (label, about) in FURTHER_OPTIONS.items():
                value = given.get(name, "")
                shown = "; ".join(value) if isinstance(value, list) else str(value)
                entry(
                    label,
                    shown,
                    partial(_change_option, change, name),
                    key=f"option-{name}",
                    about=about,
                )


def _change_option(change: Callable[[dict[str, Any]], None], name: str, text: str) -> None:
    change({name: _parsed(name, text)})


def _parsed(name: str, text: str) -> Any:
    """Value of an option as a recording.toml has it; a text that is no number stays, and the reader says so."""
    text = text.strip()
    if not text:
        return None
    if name in _LISTS:
        return [part.strip() for part in text.split(";") if part.strip()]
    if name in NUMBERS:
        try:
            return int(text) if name in WHOLE_NUMBERS else float(text.replace(",", "."))
        except ValueError:
            return text
    return text


def _texts(outputs: Mapping[str, tuple[str, str]]) -> list[str]:
    return [f"{name}:{kind}" + (f"@{mass}" if mass != "1" else "") for name, (kind, mass) in outputs.items()]


def _pair(text: str) -> tuple[str, str]:
    name, _, value = text.rpartition("=")
    return name, value
