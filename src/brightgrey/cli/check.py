"""``brightgrey check``: is a recording fit to be used."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from brightgrey.cli.options.common import Json, Quiet
from brightgrey.cli.options.groups import with_options
from brightgrey.cli.options.recording import RecordingOptions

__all__ = ["check"]


@with_options
def check(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING", help="Recordings in any format, one or more, or a recording.toml.", show_default=False
        ),
    ],
    columns: RecordingOptions,
    fix: Annotated[
        bool,
        typer.Option("--fix", help="Write the options, with the remedies, into recording.toml beside the recording."),
    ] = False,
    everything: Annotated[bool, typer.Option("--all", help="Show the checks that passed, too.")] = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Check recordings before they are used: signs, factors, clocks, repeated samples, limits, motion.

    A fault that makes an identification meaningless is graded stop (exit code 1, and identify refuses it), a likely
    one mind, and what is good to know note. --fix writes a recording.toml, which every command reads.
    """
    columns.check()
    from brightgrey.cli.terminal.checkup import show_checkup
    from brightgrey.errors import SettingsError
    from brightgrey.recordings.checks.checkup import check as check_recordings
    from brightgrey.recordings.recording_toml import write_fixed

    read = columns.read_all(recordings)
    found = check_recordings(read)
    written = None
    if fix:
        if len(recordings) > 1 and any(r.parent != recordings[0].parent for r in recordings):
            raise SettingsError("--fix: the recordings are in several folders; check them one by one")
        written = write_fixed(recordings, columns.given(), found.remedies())
    show_checkup(found, written, everything=everything, quiet=quiet, json=json)
    if found.of_grade("stop"):
        raise typer.Exit(1)
