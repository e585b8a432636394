"""One screen about a result: what was found, its numbers, its residual, what is needed, what to do and to mind."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from brightgrey.api.result import Result
    from brightgrey.search.evidence import Evidence

__all__ = ["SCREEN", "folded", "plain_table", "print_overview"]


@dataclass(frozen=True)
class _Screen:
    """Measures of the screen in characters and lines."""

    lines: int = 40  #: Of the whole screen, unless the numbers alone take more.
    least_items: int = 1  #: Things to do and to mind that are shown however long the rest is.
    bar: int = 16  #: A full bar.
    full_bar: float = 100.0  #: Times by which the residual is larger at a full bar.
    outputs: int = 4  #: That are drawn.
    line: int = 60  #: A drawn output.
    least_line: int = 4
    residuals_only: int = 3  #: Outputs from which on the measured ones are left out.
    name: int = 16  #: Of a recording.
    beside: int = 12  #: Of the widest symbol of an effect that stands beside its equation.
    room_for_meanings: int = 96  #: Of a window that shows the meanings of parameters.


SCREEN = _Screen()


def print_overview(console: Console, found: Result) -> list[str]:
    """Print one screen; returns the things to do and to mind that have no room."""
    from brightgrey.report.text.headline import headline

    first, *rest = headline(found.content).sentences
    parts: list[RenderableType] = [Text(folded(first, console.width), style="bold")]
    parts += [*(folded(text, console.width) for text in rest), ""]
    parts += [*_estimates(console, found), "", *_residuals(console, found)]
    parts += _needed(found.evidence) if found.evidence else []
    lines = 1  # for the names of the files
    for part in parts:
        console.print(part, soft_wrap=isinstance(part, str))
        lines += len(console.render_lines(part))
    items = [folded(text, console.width, "- ") for text in _advice(found)]
    ends = [lines + sum(item.count("\n") + 1 for item in items[: k + 1]) for k in range(len(items))]
    shown = len(items) if max(ends, default=0) <= SCREEN.lines else sum(end < SCREEN.lines for end in ends)
    shown = max(shown, SCREEN.least_items)
    for item in items[:shown]:
        console.print(item, soft_wrap=True)
    if items[shown:]:
        console.print(f"  and {len(items) - shown} more in the report, or by --verbose", style="dim")
    return items[shown:]


def _advice(found: Result) -> list[str]:
    """Steps to take and remarks to mind, the most important first."""
    from brightgrey.report.text.next_steps import urgent_steps
    from brightgrey.report.text.prose import sentence, with_meanings
    from brightgrey.report.text.tables import remarks

    outcome = found.model.outcome
    said = outcome.kind in ("converged", "at bound")  # by the fit, and by the remarks
    return [
        *([] if said else [sentence(with_meanings(outcome.text, found.model.structure))]),
        *(f"{step.title}. {step.text} {step.typed}".rstrip() for step in urgent_steps(found.content)),
        *remarks(found.model),
        *map(sentence, found.notes),
    ]


def _estimates(console: Console, found: Result) -> Iterator[RenderableType]:
    """Parameters with their intervals, and the speed within which friction reverses."""
    from brightgrey.report.text.tables import FIXED, differing_values, friction_width_text, parameter_rows

    rows = parameter_rows(found.model)
    noted = any(row.note for row in rows)
    narrow = console.width < SCREEN.room_for_meanings
    table = plain_table(
        "parameter", "estimate >", "unit", *(["note"] if noted else []), *([] if narrow else ["meaning"])
    )
    for row in rows:
        doubtful = row.note and row.note != FIXED
        cells = (row.name, row.estimate, row.unit, *([row.note] if noted else []), *([] if narrow else [row.about]))
        table.add_row(*cells, style="yellow" if doubtful else None)
    yield table
    yield from (folded(text, console.width) for text in differing_values(found.model))
    if found.model.structure.has_dry_friction:
        yield folded(f"Friction reverses {friction_width_text(found.model.settings)}.", console.width)


def _residuals(console: Console, found: Result) -> Iterator[RenderableType]:
    """Measured motion and residual over the recording, drawn with block characters."""
    from brightgrey.recordings.inspection.profile import block_line
    from brightgrey.recordings.units.amounts import rounded

    rows = [(trace, k) for trace in found.traces for k in range(len(trace.outputs))][: SCREEN.outputs]
    if not rows:
        return
    several = len(found.traces) > 1
    names = [trace.outputs[k].name + (f", {_end_of(trace.name)}" if several else "") for trace, k in rows]
    sizes = [float(abs(trace.residual[k]).max()) for trace, k in rows]
    words = [
        f"up to {rounded(size)} {trace.outputs[k].unit}" if size == size else "diverges"
        for size, (trace, k) in zip(sizes, rows, strict=True)
    ]
    room = console.width - max(map(len, names)) - len(" |residual| ") - max(map(len, words)) - 1
    width = max(min(SCREEN.line, room), SCREEN.least_line)
    table = Table(box=None, show_header=False, padding=(0, 1, 0, 0), pad_edge=False)
    for _ in range(4):
        table.add_column(overflow="fold")
    for name, word, (trace, k) in zip(names, words, rows, strict=True):
        if len(rows) < SCREEN.residuals_only:
            table.add_row(Text(name), "measured", block_line(trace.measured[k], width), "")
        residual = block_line(abs(trace.residual[k]), width)
        table.add_row(Text(name), "|residual|", Text(residual, style="red"), word)
    yield table
    yield ""


def _end_of(name: str) -> str:
    """Name of a recording, or the end of a long one, by which they differ."""
    return name if len(name) <= SCREEN.name else f"…{name[1 - SCREEN.name :]}"


def _needed(evidence: Evidence) -> Iterator[RenderableType]:
    """Effects that are needed, with bars: by how much the residual grows without them."""
    cards = [card for card in evidence.cards if card.verdict == "needed"]
    if not cards:
        return
    table = plain_table("needed", "", "residual without it")
    for card in sorted(cards, key=lambda card: -(math.inf if card.loss is None else card.loss)):
        ratio = SCREEN.full_bar if card.loss is None else 1.0 + card.loss
        cells = max(round(SCREEN.bar * min(math.log(ratio) / math.log(SCREEN.full_bar), 1.0)), 1)
        known = card.why.kind == "loss" and not card.why.further
        words = f"{ratio:.3g} times as large" if known else card.reason
        table.add_row(card.title, Text("█" * cells, style="green"), words)
    yield table
    yield ""


def plain_table(*columns: str) -> Table:
    """Table without a frame; a column whose name ends in > is aligned to the right."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0), show_edge=False)
    for column in columns:
        right = column.endswith(">")
        table.add_column(column.rstrip("> "), justify="right" if right else "left", overflow="fold")
    return table


def folded(text: str, width: int, mark: str = "") -> str:
    """Lines of a text that fit a window; `mark` stands before the first one, and the others are indented by it."""
    room = max(width - len(mark), 1)
    return mark + f"\n{' ' * len(mark)}".join(wrap(text, room, break_long_words=False, break_on_hyphens=False))
