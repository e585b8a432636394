"""Only the pages of this server, opened with its key, may ask it for anything."""

import asyncio
import http.client
from contextlib import closing

import pytest

from brightgrey.app.security.access import AccessRules, Gate

pytestmark = pytest.mark.xdist_group("running app")  # one server for all
RULES = AccessRules("127.0.0.1", 8420)
SOCKET = "/_nicegui_ws/socket.io/?EIO=4&transport=polling"
OPEN = AccessRules("0.0.0.0", 8420, password="öffne dich")


def ask(rules, method="GET", path="/", query="", body=b"", kind="http", **headers):
    """Answer of a gate before an application that answers everything: status, headers, body."""
    sent = []

    async def application(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"inside"})

    async def receive():
        return {"type": "http.request", "body": body, "more_body": False}

    async def send(message):
        sent.append(message)

    named = {"host": "127.0.0.1:8420", **{k.replace("_", "-"): v for k, v in headers.items()}}
    scope = {
        "type": kind,
        "method": method,
        "path": path,
        "query_string": query.encode(),
        "headers": [(k.encode(), v.encode()) for k, v in named.items()],
    }
    asyncio.run(Gate(application, rules)(scope, receive, send))
    if sent[0]["type"] == "websocket.close":
        return "closed", {}, b""
    return sent[0]["status"], dict(sent[0]["headers"]), sent[1]["body"]


def cookie(rules=RULES):
    return f"{rules.cookie_name}={rules.cookie}"


def test_gate__right_token__gives_the_cookie_and_leaves_the_address():
    status, headers, _ = ask(RULES, query=f"token={RULES.token}")
    assert (status, headers[b"location"]) == (303, b"/")
    given = headers[b"set-cookie"].decode()
    assert cookie() in given
    assert "HttpOnly" in given
    assert "SameSite=Strict" in given
    status, headers, body = ask(RULES, cookie=cookie())
    assert (status, body) == (200, b"inside")
    policy = headers[b"content-security-policy"].decode()
    assert "default-src 'self'" in policy
    assert "connect-src 'self' ws://127.0.0.1:8420;" in policy


@pytest.mark.parametrize(
    "query",
    ["", "token=", "token=wrong", "token=%00", f"token={RULES.cookie}"],
    ids=["none", "empty", "wrong", "zero", "cookie"],  # the cookie is another one in every process
)
def test_gate__without_the_token__is_shut(query):
    assert ask(RULES, query=query)[0] == 403
    assert ask(RULES, query=query, cookie="brightgrey_8420=wrong")[0] == 403
    assert ask(RULES, query=query, cookie="a=;;=;\x7f")[0] == 403


def test_gate__token_by_another_method__is_shut():
    assert ask(RULES, "POST", query=f"token={RULES.token}", origin="http://127.0.0.1:8420")[0] == 403
    assert ask(RULES, kind="websocket", query=f"token={RULES.token}", origin="http://127.0.0.1:8420")[0] == "closed"


@pytest.mark.parametrize(
    "host", ["evil.example:8420", "127.0.0.1:9", "127.0.0.1", "", "10.0.0.1:8420", "127.0.0.1.evil:8420"]
)
def test_gate__foreign_host__is_refused_whatever_else_it_knows(host):
    assert ask(RULES, host=host, cookie=cookie(), query=f"token={RULES.token}")[0] == 421
    assert ask(RULES, kind="websocket", host=host, cookie=cookie(), origin=f"http://{host}")[0] == "closed"


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:9", "https://127.0.0.1:8420"])
def test_gate__foreign_origin__is_refused(origin):
    assert ask(RULES, cookie=cookie(), origin=origin)[0] == 403
    assert ask(RULES, "POST", "/upload/a", cookie=cookie(), origin=origin)[0] == 403
    assert ask(RULES, kind="websocket", cookie=cookie(), origin=origin)[0] == "closed"


def test_gate__a_change_without_an_origin__is_refused():
    assert ask(RULES, "POST", "/upload/a", cookie=cookie())[0] == 403
    assert ask(RULES, kind="websocket", cookie=cookie())[0] == "closed"
    assert ask(RULES, "POST", "/upload/a", cookie=cookie(), origin="http://127.0.0.1:8420")[0] == 200


def test_gate__another_host_with_a_password__asks_for_it():
    assert OPEN.start_url == "http://127.0.0.1:8420/"
    status, _, body = ask(OPEN, host="192.168.0.5:8420")
    assert status == 401
    assert b'type="password"' in body
    assert ask(OPEN, host="evil.example:8420")[0] == 421
    own = {"host": "192.168.0.5:8420", "origin": "http://192.168.0.5:8420"}
    wrong = ask(OPEN, "POST", "/login", body=b"password=guess", **own)
    assert wrong[0] == 403
    assert b"not the password" in wrong[2]
    status, headers, _ = ask(OPEN, "POST", "/login", body=b"password=%C3%B6ffne+dich", **own)
    assert (status, cookie(OPEN) in headers[b"set-cookie"].decode()) == (303, True)
    assert ask(OPEN, query=f"token={OPEN.token}")[0] == 401


def answer(running, path, method="GET", body=None, **headers):
    with closing(http.client.HTTPConnection("127.0.0.1", running.port, timeout=30)) as connection:
        connection.request(method, path, body, headers)
        found = connection.getresponse()
        return found.status, found.headers, found.read()


def test_server__asked_as_a_stranger__gives_nothing(running):
    for path in (
        "/",
        "/project/a",
        "/static/app.js",
        "/files/a/runs/x",
        "/_nicegui_ws/socket.io/?EIO=4&transport=polling",
    ):
        assert answer(running, path)[0] == 403
        assert answer(running, path, Host="evil.example")[0] == 421
    assert answer(running, "/upload/a", "POST", b"x")[0] == 403


def test_server__asked_by_its_own_page__gives_the_page_but_nothing_outside_of_runs(running):
    token = running.start_url.partition("?")[2]
    status, headers, _ = answer(running, f"/?{token}")
    assert status == 303
    own = {"Cookie": headers["set-cookie"].partition(";")[0], "Origin": running.base}
    assert answer(running, "/", **own)[0] == 200
    assert answer(running, SOCKET, **own)[0] == 200
    assert answer(running, SOCKET, **{**own, "Origin": "http://evil.example"})[0] == 403
    for path in (
        "project.toml",
        "runs/../project.toml",
        "runs/%2e%2e/project.toml",
        "recordings/x.csv",
        "//etc/passwd",
    ):
        assert answer(running, f"/files/a/{path}", **own)[0] == 404
    assert answer(running, "/files/..%2f..%2fx/runs/a", **own)[0] == 404
    assert answer(running, "/static/..%2fserver.py", **own)[0] == 404
