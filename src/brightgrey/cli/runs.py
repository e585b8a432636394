"""``brightgrey runs``: what is kept in a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from brightgrey.cli.options.common import Json

__all__ = ["runs"]


def runs(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run, or one with runs below it.")],
    json: Json = False,
) -> None:
    """List the runs in a folder: what was asked for, how much is done, and the structure found, or the best so far."""
    from rich.text import Text

    from brightgrey.api.resumable import list_runs
    from brightgrey.cli.terminal.overview import plain_table
    from brightgrey.cli.terminal.results import as_json, screen
    from brightgrey.runs import RunStatus

    found = list_runs(folder)
    if json:
        as_json([_run_as_json(where, run) for where, run in found])
        return
    console = screen()
    table = plain_table("folder", "state", "evaluations >", "seconds >", "stage", "structure")
    for where, run in found:
        if isinstance(run, RunStatus):
            cells = (str(run.evaluations), f"{run.seconds:.1f}", _stage(run), _shown_structure(where, run))
            table.add_row(str(where), run.state, *cells)
        else:
            table.add_row(str(where), "unreadable", "-", "-", "-", "-", style="yellow")
    console.print(table)
    for where, run in found:
        if not isinstance(run, RunStatus):
            console.print(f"- {run}", soft_wrap=True)
        elif len(found) == 1:
            console.print()
            console.print(Text(f"request in {where}", style="bold"))
            for name, value in run.request.items():
                if value not in (None, [], {}):
                    console.print(f"  {name}: {_shown(value)}", soft_wrap=True)
    if any(not isinstance(run, RunStatus) for _, run in found):
        raise typer.Exit(2)


def _shown(value: Any) -> str:
    """Text of an entry of a request; versions by name in one line."""
    return ", ".join(f"{k} {v}" for k, v in value.items()) if isinstance(value, dict) else str(value)


def _stage(run: Any) -> str:
    if not run.stage:
        return "-"
    of = "" if run.stage["total"] is None else f" of {run.stage['total']}"
    return f"{run.stage['name']} {run.stage['done']}{of}"


def _shown_structure(where: Path, run: Any) -> str:
    found = _structure(where, run)
    return "-" if found is None else found if run.state == "finished" else f"so far {found}"


def _structure(where: Path, run: Any) -> str | None:
    """Structure that a finished run has found, else the best so far; None without any."""
    if run.state != "finished":
        return str(run.stage["best"]) if "best" in run.stage else None
    from brightgrey.errors import BrightgreyError
    from brightgrey.model.model import load_model

    try:
        return str(load_model(where / "model.json").structure)
    except BrightgreyError:  # it was moved or changed
        return None


def _run_as_json(where: Path, run: Any) -> dict[str, Any]:
    from dataclasses import asdict

    from brightgrey.runs import RunStatus

    if not isinstance(run, RunStatus):
        return {"folder": str(where), "state": "unreadable", "error": str(run)}
    return {**asdict(run), "folder": str(where), "structure": _structure(where, run)}
