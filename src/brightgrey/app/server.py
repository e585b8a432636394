"""Server of the app: its pages, uploads and downloads behind the gate."""

from __future__ import annotations

import asyncio
import webbrowser
from pathlib import Path
from urllib.parse import unquote

from fastapi import Request
from fastapi.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from nicegui import app, core, ui

from brightgrey.app.desk.process import Desk
from brightgrey.app.jobs.queue import JobQueue
from brightgrey.app.page import home_page, project_page
from brightgrey.app.security.access import AccessRules, Gate
from brightgrey.app.security.upload import receive_file
from brightgrey.app.services import AppServices
from brightgrey.app.stages.recording import add_file
from brightgrey.app.workspace.folder import Workspace
from brightgrey.errors import BrightgreyError

__all__ = ["serve"]

STATIC = Path(__file__).parent / "static"
MEDIA_TYPES = {".html": "text/html", ".json": "application/json", ".svg": "image/svg+xml", ".csv": "text/csv"}
#: A page that a run has written is shown without rights of this site: it may run its own figures and nothing else.
SANDBOX = {"Content-Security-Policy": "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; "
           "style-src 'unsafe-inline'; img-src data: blob:; font-src data:"}  # fmt: skip


def serve(folder: Path, *, host: str, port: int, password: str | None, show: bool) -> None:
    """Run the app until it is ended by Ctrl-C.

    Parameters
    ----------
    folder : Path
        Workspace; made if it is not there.
    host : str
    port : int
    password : str or None
        Needed for a host that other machines can reach.
    show : bool
        Open the browser.

    Raises
    ------
    SettingsError
        If the workspace cannot be made, or another server works in it.
    """
    workspace = Workspace(folder)
    with workspace.only_here():
        services = AppServices(workspace, JobQueue(workspace), Desk())
        _run_server(services, AccessRules(host, port, password), show)


def _run_server(services: AppServices, rules: AccessRules, show: bool) -> None:
    """Serve pages until Ctrl-C."""
    _add_pages(services)
    _add_routes(services)
    core.sio.eio.cors_allowed_origins = rules.origins if rules.is_local else None  # None: the host of the request
    watching: list[asyncio.Task[None]] = []

    def begin() -> None:
        loop = asyncio.get_running_loop()
        watching.extend(
            (loop.create_task(services.watch()), loop.create_task(_announce(services.workspace, rules, show)))
        )

    def end() -> None:
        for task in watching:
            task.cancel()
        services.queue.pause_all()
        services.desk.close()

    app.on_startup(begin)
    app.on_connect(services.desk.warm_up)  # not at the start: it would take computing time from the first page
    app.on_shutdown(end)
    app.add_middleware(Gate, rules=rules)
    ui.run(
        host=rules.host,
        port=rules.port,
        title="Brightgrey",
        favicon=STATIC / "icon.svg",
        language="en-US",
        dark=None,
        reload=False,
        reconnect_timeout=30.0,  # s: a busy machine must not make the page load itself anew
        show=False,
        tailwind=False,
        show_welcome_message=False,
        gzip_middleware_factory=None,  # the gate has to stand before everything, and nothing is far away
        uvicorn_logging_level="warning",
    )


async def _announce(workspace: Workspace, rules: AccessRules, show: bool) -> None:
    """Say where the app is, as soon as it answers there."""
    while True:
        try:
            _, writer = await asyncio.open_connection("127.0.0.1" if rules.is_local else rules.host, rules.port)
            writer.close()
            break
        except OSError:
            await asyncio.sleep(0.02)
    print(f"Workspace {workspace.root}\nOpen {rules.start_url}\nCtrl-C ends the app.", flush=True)
    if show:
        await asyncio.to_thread(webbrowser.open, rules.start_url)


def _add_pages(services: AppServices) -> None:
    """Pages, with the style and the script that all of them share."""
    ui.add_head_html(
        '<link rel="stylesheet" href="/static/app.css"><script src="/static/app.js"></script>', shared=True
    )

    @ui.page("/")
    def home() -> None:
        home_page(services)

    @ui.page("/project/{name}")
    def project(name: str) -> None:
        project_page(services, name, "drive")

    @ui.page("/project/{name}/{stage}")
    def project_at(name: str, stage: str) -> None:
        project_page(services, name, stage)


def _add_routes(services: AppServices) -> None:
    """Uploads, downloads and what pages load."""
    import plotly

    library = Path(plotly.__file__).parent / "package_data" / "plotly.min.js"

    @app.get("/static/plotly.js")
    def plotly_js() -> Response:
        return FileResponse(library, media_type="text/javascript", headers={"Cache-Control": "private, max-age=86400"})

    @app.get("/static/{name}")
    def static(name: str) -> Response:
        if name not in ("app.css", "app.js"):
            return PlainTextResponse("not found", 404)
        return FileResponse(STATIC / name, headers={"Cache-Control": "no-cache"})

    @app.post("/upload/{name}")
    async def upload(name: str, request: Request) -> Response:
        try:
            services.workspace.load(name)
            length = request.headers.get("content-length", "")
            announced = int(length) if length.isdigit() else None
            label = unquote(request.headers.get("x-file-name", "recording"))
            target = services.workspace.path(name) / "recordings"
            received = await receive_file(request.stream(), target, announced)
            await add_file(services, name, received.path, label, received.sha256)
        except BrightgreyError as error:
            return JSONResponse({"problem": _without_path(str(error))}, 422)
        return JSONResponse({"ok": True})

    @app.get("/files/{name}/{path:path}")
    def download(name: str, path: str, save: bool = False) -> Response:
        """File of a run or of an export; nothing else of the workspace leaves it."""
        try:
            folder = services.workspace.path(name).resolve()
        except BrightgreyError:
            return PlainTextResponse("not found", 404)
        file = (folder / path).resolve()
        inside = any(file.is_relative_to(folder / part) for part in ("runs", "exports"))
        if not inside or not file.is_file() or (file.name.startswith("run.") and file.suffix != ".json"):
            return PlainTextResponse("not found", 404)
        kind = MEDIA_TYPES.get(file.suffix, "application/octet-stream")
        headers = {**SANDBOX, "Cache-Control": "no-store"}
        return FileResponse(file, media_type=kind, filename=file.name if save else None, headers=headers)


def _without_path(text: str) -> str:
    """Message about an upload, without the random name that the file had on its way."""
    head, colon, rest = text.partition(": ")
    return rest if colon and head.startswith(".upload-") else text
