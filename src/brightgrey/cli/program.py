"""The program ``brightgrey``: its commands, and how it ends when something is wrong."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, cast

import typer

from brightgrey.cli.app import app as open_app
from brightgrey.cli.check import check
from brightgrey.cli.control import analyse, control, watch
from brightgrey.cli.demo import demo
from brightgrey.cli.effects import effects
from brightgrey.cli.export import export
from brightgrey.cli.fleet import fleet
from brightgrey.cli.help_page import Command, Program
from brightgrey.cli.identify import identify
from brightgrey.cli.inspect import inspect
from brightgrey.cli.plan import plan
from brightgrey.cli.reproduce import reproduce
from brightgrey.cli.runs import runs
from brightgrey.cli.selftest import selftest
from brightgrey.cli.simulate import simulate
from brightgrey.errors import BrightgreyError, printable
from brightgrey.version import __version__

__all__ = ["app", "main"]

# Typer's own usage errors. Their class is click's, which newer versions of typer carry inside themselves:
# there is no name for it that all versions share.
UsageProblem = cast(type[typer.BadParameter], typer.BadParameter.__mro__[1])

app = typer.Typer(
    cls=Program,
    name="brightgrey",
    help="Find out from a recording of a drive which physical effects are at work and how large they are.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # its tables cannot be read in a narrow window
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


IDENTIFY = "brightgrey identify axis.csv --input torque --output velocity"
"""Begin of the examples that identify a recording."""

# Two examples for each command, in the order of the help page.
COMMANDS: dict[Callable[..., None], tuple[str, str]] = {
    demo: ("brightgrey demo", "brightgrey demo --out demo --seed 1"),
    open_app: ("brightgrey app", "brightgrey app drives --port 8420 --no-browser"),
    inspect: ("brightgrey inspect axis.csv", "brightgrey inspect drive_1.mat drive_2.mat --json"),
    check: (
        "brightgrey check axis.csv --input torque --output velocity",
        "brightgrey check axis.csv --input torque --output q:position --output v:velocity --fix",
    ),
    identify: (IDENTIFY, f"{IDENTIFY} --unit 'torque=N m' --structure two_mass+coulomb+viscous --out axis"),
    plan: (
        "brightgrey plan out",
        "brightgrey plan out --limits limits.toml --decide backlash --seconds 4 --out next",
    ),
    simulate: (
        "brightgrey simulate out/model.json axis.csv",
        "brightgrey simulate out/model.json axis.csv --out simulated.csv",
    ),
    selftest: ("brightgrey selftest out", "brightgrey selftest out --draws 20 --fast"),
    export: (
        "brightgrey export out/model.json --to fmu",
        "brightgrey export out/model.json --to c --to matlab --recording axis.csv --out export",
    ),
    effects: ("brightgrey effects", "brightgrey effects --json"),
    reproduce: ("brightgrey reproduce", "brightgrey reproduce --seeds 20 --preset tuned --out tuned"),
    runs: ("brightgrey runs .", "brightgrey runs out --json"),
    fleet: (
        "brightgrey fleet fleet.csv --input torque --output velocity",
        "brightgrey fleet fleet.toml --structure two_mass+coulomb+viscous --out fleet",
    ),
    analyse: (
        "brightgrey analyse out/model.json",
        "brightgrey analyse out/model.json --speed 10 --controller '0.5 10 / 1 0'",
    ),
    control: (
        "brightgrey control out/model.json --torque 5",
        "brightgrey control out/model.json --torque 5 --dt 0.001 --computing 0.0005",
    ),
    watch: (
        "brightgrey watch out/model.json today.csv --baseline axis.csv",
        "brightgrey watch out/model.json today.csv --baseline axis.csv --min-change 0.2",
    ),
}
for command, examples in COMMANDS.items():
    app.command(cls=Command, epilog="\n".join(examples))(command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit code.

    Wrong use and unusable input end with one line on stderr and exit code 2, an interruption with 130. Without
    arguments the help is shown.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    _open_closed_streams()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without ± must not end the program
    try:
        code = app(args=given or ["--help"], standalone_mode=False)
        sys.stdout.flush()
    except BrightgreyError as error:
        return _fail(str(error))
    except UsageProblem as error:
        message = error.format_message().replace(*NO_NUMBER)
        return _fail(f"{message}{_what_came(error, given)}{_example(message, given)}")
    except BrokenPipeError:
        # The reader has seen enough (``| head``). Python flushes once more at exit: to nowhere.
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        return _fail(f"{error.strerror or error}" + (f": '{error.filename}'" if error.filename else ""))
    except MemoryError:
        return _fail(
            "the memory does not suffice; use fewer samples: --decimate N, --window A:B, or a file cut out of it"
        )
    if not given:
        return 2
    return code if isinstance(code, int) else 0


NO_NUMBER = ("Input should be a valid number, unable to parse string as a number", "a number is expected")
"""Words of a library for what is no number, and plain ones."""


def _example(message: str, given: Sequence[str]) -> str:
    """Return how the command is used, after a message about arguments that are missing or too many."""
    known = {command.__name__.removeprefix("open_"): examples[0] for command, examples in COMMANDS.items()}
    if not message.startswith(("Missing", "Got unexpected")) or not given or given[0] not in known:
        return ""
    return f"{'' if message.endswith('.') else '.'} For example: {known[given[0]]}"


def _what_came(error: typer.BadParameter, given: Sequence[str]) -> str:
    """Value of the option that a usage error is about, which typer leaves out."""
    options = getattr(getattr(error, "param", None), "opts", ())
    for word, following in zip(given, [*given[1:], ""], strict=True):
        option, equals, value = word.partition("=")
        if option in options:
            return f"; '{value if equals else following}' came"
    return ""


def _open_closed_streams() -> None:
    """Let a program whose output or errors nobody takes (``>&-``) write to nowhere."""
    if sys.stdout is None:
        sys.stdout = Path(os.devnull).open("w")  # noqa: SIM115 (until the program ends)
    if sys.stderr is None:
        sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115


def _fail(message: str) -> int:
    print(f"brightgrey: {printable(message)}", file=sys.stderr)
    return 2
