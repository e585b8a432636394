"""The program ``brightgrey``: its commands, and how it ends when something is wrong."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Sequence
from typing import Annotated, cast

import typer

from brightgrey.cli.control import analyse, control, watch
from brightgrey.cli.demo import demo
from brightgrey.cli.effects import effects
from brightgrey.cli.export import export
from brightgrey.cli.fleet import fleet
from brightgrey.cli.identify import identify
from brightgrey.cli.reproduce import reproduce
from brightgrey.cli.runs import runs
from brightgrey.cli.simulate import simulate
from brightgrey.errors import BrightgreyError
from brightgrey.version import __version__

__all__ = ["app", "main"]

# Typer's own usage errors. Their class is click's, which newer versions of typer carry inside themselves:
# there is no name for it that all versions share.
UsageProblem = cast(type[typer.BadParameter], typer.BadParameter.__mro__[1])

app = typer.Typer(
    name="brightgrey",
    help="Find out from a recording of a drive which physical effects are at work and how large they are.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"brightgrey {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and end."),
    ] = False,
) -> None:
    pass


app.command()(demo)
app.command()(identify)
app.command()(simulate)
app.command()(export)
app.command()(effects)
app.command()(reproduce)
app.command()(runs)
app.command()(fleet)
app.command()(analyse)
app.command()(control)
app.command()(watch)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit code.

    Wrong use and unusable input end with one line on stderr and exit code 2, an interruption with 130.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without ± must not end the program
    try:
        code = app(args=None if arguments is None else list(arguments), standalone_mode=False)
        sys.stdout.flush()
    except BrightgreyError as error:
        return _fail(str(error))
    except UsageProblem as error:
        return _fail(error.format_message())
    except BrokenPipeError:
        # The reader has seen enough (``| head``). Python flushes once more at exit: to nowhere.
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        return _fail(f"{error.strerror or error}" + (f": '{error.filename}'" if error.filename else ""))
    except (KeyboardInterrupt, typer.Abort):
        print("brightgrey: interrupted, nothing written", file=sys.stderr)
        return 130
    return code if isinstance(code, int) else 0


def _fail(message: str) -> int:
    line = " ".join(message.split())
    if line:  # none without arguments: the help has been shown
        print(f"brightgrey: {line}", file=sys.stderr)
    return 2
