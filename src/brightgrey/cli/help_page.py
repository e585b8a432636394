"""Help pages of the command line: options under headings, two examples at the end, plain text for any width.

The tables of rich cannot be read in a narrow window, and to load them takes longer than everything else.
"""

from __future__ import annotations

import math
import signal
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from brightgrey.errors import SettingsError

__all__ = ["Command", "Program"]

MOST_USED = "Options"
NAMES = 26  # characters of the column with the names of options


@contextmanager
def _interruption_told() -> Iterator[None]:
    """End the program with one line if it is interrupted."""
    try:
        yield
    except KeyboardInterrupt:
        typer.echo("brightgrey: interrupted, nothing written", err=True)
        raise typer.Exit(128 + signal.SIGINT) from None


class Program(TyperGroup):
    """The program, whose commands are listed with their whole first sentences."""

    def invoke(self, ctx: Any) -> Any:
        """Read the options of a command and run it; an interruption ends with one line."""
        with _interruption_told():
            return super().invoke(ctx)

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        """Read what comes before a command; an interruption ends with one line."""
        with _interruption_told():
            return super().make_context(*arguments, **options)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands in the order in which they were added."""
        commands = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        records = [(name, command.get_short_help_str(limit=200)) for name, command in commands if command]
        with formatter.section("Commands"):
            formatter.write_dl(records)


class Command(TyperCommand):
    """A command whose options stand under headings. Its epilog holds one example per line."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; a number that is infinite or none (nan) is refused (SettingsError)."""
        for parameter in self.get_params(ctx):
            value = ctx.params.get(parameter.name or "")
            if isinstance(value, float) and not math.isfinite(value):
                raise SettingsError(f"{parameter.opts[-1]} {value:g}: a finite number is expected")
        return super().invoke(ctx)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments, the options used most, and the others by their headings."""
        sections: dict[str, list[tuple[str, str]]] = {"Arguments": [], MOST_USED: []}
        for parameter in self.get_params(ctx):
            names, text = parameter.get_help_record(ctx) or ("", "")
            if parameter.param_type_name == "argument":
                sections["Arguments"].append((parameter.metavar or names, text))
            elif names:
                heading = getattr(parameter, "rich_help_panel", None) or MOST_USED
                sections.setdefault(heading, []).append((names, text))
        for heading, records in sections.items():
            if records:
                with formatter.section(heading):
                    formatter.write_dl(records, col_max=NAMES)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the examples; long ones go on in the next line, as a shell understands it."""
        with formatter.section("Examples"):
            for example in (self.epilog or "").splitlines():
                words = textwrap.wrap(
                    example,
                    formatter.width - 4,
                    subsequent_indent="    ",
                    break_long_words=False,
                    break_on_hyphens=False,
                )
                formatter.write("".join(f"  {line}\n" for line in " \\\n".join(words).splitlines()))
