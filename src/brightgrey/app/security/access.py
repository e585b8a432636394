"""Gate before the server: host, origin and a secret are checked before anything else sees a request.

A page of another site can send requests to 127.0.0.1, and by DNS rebinding even read the answers. So a request has to
name this server as its host. One that changes something has to come from its own pages. Every request needs the cookie
that only the start URL, or the password, gives.
"""

from __future__ import annotations

import asyncio
import hmac
import html
import ipaddress
import secrets
import socket
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

__all__ = ["AccessRules", "Gate"]

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")


@dataclass(frozen=True)
class _GatePolicy:
    """Limits of the gate."""

    wrong_password_wait: float = 1.0  #: Time in s before a wrong password is answered.
    longest_form: int = 4096  #: Bytes of the form of the password.
    secret_bytes: int = 32  #: Of the token and of the cookie.


GATE = _GatePolicy()


def _headers(host: str) -> list[tuple[bytes, bytes]]:
    """Headers of every answer: no page loads anything from elsewhere, and none is shown inside another site.

    NiceGUI needs inline scripts. `host` has been found to be this server's own.
    """
    socket = f" ws://{host}" if host else ""
    policy = (
        "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
        f"img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self'{socket}; frame-src 'self'; "
        "object-src 'none'; base-uri 'self'; form-action 'self'; frame-ancestors 'self'"
    )
    return [
        (b"content-security-policy", policy.encode()),
        (b"x-content-type-options", b"nosniff"),
        (b"referrer-policy", b"no-referrer"),
        (b"cross-origin-resource-policy", b"same-origin"),
    ]


@dataclass(frozen=True)
class AccessRules:
    """Hosts under which the server may be asked, and its secrets."""

    host: str
    port: int
    password: str | None = None  #: Asked for instead of the token; needed for hosts other than this machine.
    token: str = field(default_factory=lambda: secrets.token_urlsafe(GATE.secret_bytes), repr=False)
    cookie: str = field(default_factory=lambda: secrets.token_urlsafe(GATE.secret_bytes), repr=False)

    @property
    def is_local(self) -> bool:
        """True if only this machine can reach the server."""
        return self.host in LOOPBACK

    @property
    def cookie_name(self) -> str:
        """Name of the cookie; browsers do not tell the ports of a host apart."""
        return f"brightgrey_{self.port}"

    @property
    def origins(self) -> list[str]:
        """Origins of this server's own pages on this machine."""
        return [f"http://{name}:{self.port}" for name in LOOPBACK]

    @property
    def start_url(self) -> str:
        """Address for the browser; with the token, unless there is a password."""
        shown = self.host if self.is_local else "127.0.0.1"
        return f"http://{shown}:{self.port}/" + ("" if self.password else f"?token={self.token}")

    def knows_host(self, host: str) -> bool:
        """True for a Host header that names this server."""
        name, colon, port = host.rpartition(":")
        if not colon or port != str(self.port):
            return False
        if name in LOOPBACK:
            return True
        return not self.is_local and (name in (self.host, socket.gethostname()) or _is_address(name.strip("[]")))

    def knows_cookie(self, header: str) -> bool:
        """True if the Cookie header holds the secret."""
        try:
            found = SimpleCookie(header).get(self.cookie_name)
        except CookieError:
            return False
        return found is not None and hmac.compare_digest(found.value.encode(), self.cookie.encode())


def _is_address(text: str) -> bool:
    try:
        ipaddress.ip_address(text)
    except ValueError:
        return False
    return True


class Gate:
    """ASGI middleware that lets through only what the rules allow."""

    def __init__(self, app: Callable[[Scope, Receive, Send], Awaitable[None]], rules: AccessRules) -> None:
        self.app, self.rules = app, rules

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        host, origin = headers.get("host", ""), headers.get("origin")
        if not self.rules.knows_host(host):
            await _refuse(scope, send, 421, "This server is not called so. Open the address that it has printed.")
            return
        changes = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        if (origin is not None or changes) and origin != f"http://{host}":
            await _refuse(scope, send, 403, "A page of another site must not ask this server for anything.")
            return
        if self.rules.knows_cookie(headers.get("cookie", "")):
            await self.app(scope, receive, _with_headers(send, host))
            return
        await self._let_in(scope, receive, send)

    async def _let_in(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Give the cookie for the token or the password; refuse everything else."""
        rules = self.rules
        if scope["type"] == "http" and rules.password is None:
            given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
            if scope["method"] == "GET" and hmac.compare_digest(given.encode(), rules.token.encode()):
                await self._welcome(send)
                return
        elif scope["type"] == "http" and rules.password is not None:
            if scope["method"] == "POST" and scope["path"] == "/login":
                form = parse_qs((await _body(receive)).decode("utf-8", "replace"))
                if hmac.compare_digest(form.get("password", [""])[0].encode(), rules.password.encode()):
                    await self._welcome(send)
                    return
                await asyncio.sleep(GATE.wrong_password_wait)
                await _answer(send, 403, _login_page("That is not the password."))
                return
            if scope["method"] == "GET":
                await _answer(send, 401, _login_page(""))
                return
        await _refuse(scope, send, 403, "Open the address that 'brightgrey app' has printed: it has the key to it.")

    async def _welcome(self, send: Send) -> None:
        """Set the cookie, and go to the first page without the token in its address."""
        cookie = f"{self.rules.cookie_name}={self.rules.cookie}; Path=/; HttpOnly; SameSite=Strict"
        headers = [(b"location", b"/"), (b"set-cookie", cookie.encode()), (b"cache-control", b"no-store")]
        await send({"type": "http.response.start", "status": 303, "headers": [*headers, *_headers("")]})
        await send({"type": "http.response.body", "body": b""})


async def _body(receive: Receive) -> bytes:
    """Body of the form of the password; what is longer than it can be is cut off."""
    content, more = b"", True
    while more and len(content) < GATE.longest_form:
        message = await receive()
        content += message.get("body", b"")
        more = message.get("more_body", False)
    return content[: GATE.longest_form]


def _with_headers(send: Send, host: str) -> Send:
    async def wrapped(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            given = {name.lower() for name, _ in message.get("headers", [])}
            more = [pair for pair in _headers(host) if pair[0] not in given]
            message = {**message, "headers": [*message.get("headers", []), *more]}
        await send(message)

    return wrapped


async def _refuse(scope: Scope, send: Send, status: int, reason: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})
        return
    await _answer(send, status, _page("Brightgrey", f"<h1>Brightgrey</h1><p>{html.escape(reason)}</p>"))


async def _answer(send: Send, status: int, page: bytes) -> None:
    headers = [(b"content-type", b"text/html; charset=utf-8"), (b"cache-control", b"no-store"), *_headers("")]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": page})


def _login_page(problem: str) -> bytes:
    said = f'<p role="alert">{html.escape(problem)}</p>' if problem else ""
    form = (
        '<form method="post" action="/login"><label>Password<br><input type="password" name="password" autofocus '
        'autocomplete="current-password" required></label> <button>Open</button></form>'
    )
    return _page("Brightgrey: password", f"<h1>Brightgrey</h1>{said}{form}")


def _page(title: str, body: str) -> bytes:
    style = "body{font:16px/1.5 system-ui,sans-serif;max-width:34rem;margin:3rem auto;padding:0 1rem}"
    return (
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f'<meta name="viewport" content="width=device-width"><style>:root{{color-scheme:light dark}}{style}</style>'
        f"</head><body><main>{body}</main></body></html>"
    ).encode()
