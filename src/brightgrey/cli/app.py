"""``brightgrey app``: the app in a browser."""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from brightgrey.errors import SettingsError

__all__ = ["app"]

LOCAL = ("127.0.0.1", "localhost")
PASSWORD = "BRIGHTGREY_PASSWORD"


def app(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Workspace: projects, recordings and runs are kept in it.")
    ] = Path("brightgrey-workspace"),
    host: Annotated[
        str,
        typer.Option(
            "--host",
            metavar="NAME",
            help=f"Address to listen on; another than this machine's own asks for a "
            f"password, or takes it from {PASSWORD}.",
        ),
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, metavar="N", help="Port; a free one by default.")
    ] = 0,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Do not open the browser.")] = False,
) -> None:
    """Open the app in the browser: from a file to a handed-over model, without a command line.

    It works offline and sends nothing anywhere. Runs are those of identify, so that both can go on with each other's.
    A folder that cannot be written to and an address that cannot be listened on are refused.
    """
    password = (
        None if host in LOCAL else os.environ.get(PASSWORD) or typer.prompt("Password for the app", hide_input=True)
    )
    try:
        from brightgrey.app.server import serve
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ("nicegui", "fastapi", "starlette", "uvicorn"):
            raise
        raise SettingsError("the app needs NiceGUI: pip install 'brightgrey[app]'") from None
    with suppress(KeyboardInterrupt):  # the way to end it
        serve(folder, host=host, port=_free_port(host, port), password=password, show=not no_browser)


def _free_port(host: str, wanted: int) -> int:
    """Port that nobody uses at the moment: the wanted one, or any if it is 0."""
    with socket.socket() as probe:
        if os.name == "posix":  # one that was used a moment ago is free
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, wanted))
        except OSError as error:
            at = f"{host}:{wanted}" if wanted else host
            raise SettingsError(f"cannot listen on '{at}': {error.strerror}") from None
        return int(probe.getsockname()[1])
