"""Options of a run: random numbers, workers and budget."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from brightgrey.cli.options.common import CORES, Seed, Workers
from brightgrey.cli.options.groups import RUN
from brightgrey.errors import SettingsError

if TYPE_CHECKING:
    from brightgrey.runs import Budget, Workforce

__all__ = ["RunOptions"]


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Seed, workers and budget."""

    seed: Seed = 0
    workers: Workers = CORES
    processes: Annotated[
        bool,
        typer.Option("--processes", help="Use processes instead of threads in a search.", rich_help_panel=RUN),
    ] = False
    dask: Annotated[
        str | None,
        typer.Option(
            "--dask",
            metavar="ADDRESS",
            help="Use the workers of the Dask scheduler at host:port in a search.",
            rich_help_panel=RUN,
        ),
    ] = None
    max_evaluations: Annotated[
        int | None,
        typer.Option(
            "--max-evaluations",
            metavar="N",
            help="Stop a search after so many evaluations; the same command continues it.",
            rich_help_panel=RUN,
        ),
    ] = None
    max_seconds: Annotated[
        float | None,
        typer.Option(
            "--max-seconds",
            metavar="S",
            help="Stop a search after so many seconds; the same command continues it.",
            rich_help_panel=RUN,
        ),
    ] = None
    no_check: Annotated[
        bool,
        typer.Option("--no-check", help="Go on where a check of the recordings says stop.", rich_help_panel=RUN),
    ] = False
    restart: Annotated[
        bool, typer.Option("--restart", help="Delete the run in DIR and start again.", rich_help_panel=RUN)
    ] = False

    def check(self, structure: str | None) -> None:
        """Refuse options of a search if the structure is given (SettingsError)."""
        if structure and any((self.processes, self.dask, self.max_evaluations, self.max_seconds)):
            raise SettingsError("--processes, --dask, --max-evaluations and --max-seconds belong to a search")

    @property
    def workforce(self) -> Workforce:
        """Threads, processes or cluster."""
        from brightgrey.runs import Workforce

        return Workforce(self.workers, self.processes, self.dask)

    @property
    def budget(self) -> Budget:
        """Evaluations and seconds after which a search stops."""
        from brightgrey.runs import Budget

        return Budget(self.max_evaluations, self.max_seconds)
