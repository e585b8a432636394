"""What is uploaded is counted while it comes, and leaves nothing behind where it is refused."""

import asyncio
import gzip
import hashlib
import http.client
import json
from functools import cache

import pytest

from brightgrey.app.security.upload import UploadPolicy, receive_file
from brightgrey.app.workspace.folder import Workspace
from brightgrey.errors import RecordingError
from support.small_runs import recording_csv

pytestmark = pytest.mark.xdist_group("running app")  # one server for all
SMALL = UploadPolicy(most_bytes=1 << 20, spare_bytes=0)


def received(folder, chunks, announced=None, policy=SMALL):
    async def stream():
        for chunk in chunks:
            yield chunk

    return asyncio.run(receive_file(stream(), folder, announced, policy))


@cache
def bomb(megabytes=300):
    return gzip.compress(bytes(megabytes << 20), 6)


def test_receive_file__of_several_pieces__is_whole(tmp_path):
    found = received(tmp_path, [b"abc", b"", b"def"], 6)
    assert found.path.read_bytes() == b"abcdef"
    assert (found.size, found.sha256) == (6, hashlib.sha256(b"abcdef").hexdigest())
    assert found.path.parent == tmp_path


@pytest.mark.parametrize(
    ("chunks", "announced", "said"),
    [
        ([b""], None, "empty"),
        ([b"x" * (1 << 19)] * 3, None, "more than"),
        ([b"x"], 1 << 30, "more than"),
        ([b"\x1f\x8b" + b"x" * 100], None, "damaged"),
    ],
)
def test_receive_file__not_to_be_used__is_refused_without_a_trace(tmp_path, chunks, announced, said):
    with pytest.raises(RecordingError, match=said):
        received(tmp_path, chunks, announced)
    assert list(tmp_path.iterdir()) == []


def test_receive_file__gzip_bomb__is_refused(tmp_path):
    packed = bomb()
    assert len(packed) < 1 << 20
    with pytest.raises(RecordingError, match="expands to more than"):
        received(tmp_path, [packed[i : i + 65536] for i in range(0, len(packed), 65536)], policy=UploadPolicy())
    assert list(tmp_path.iterdir()) == []


def test_receive_file__honest_gzip_in_two_members__is_taken(tmp_path):
    text = recording_csv().encode()
    packed = gzip.compress(text[:5000]) + gzip.compress(text[5000:])
    assert gzip.decompress(received(tmp_path, [packed[:100], packed[100:]]).path.read_bytes()) == text


@pytest.fixture
def own(running):
    """Upload to a project of the running app, as its page does; gives status and answer."""
    workspace = Workspace(running.folder)
    name = workspace.create("uploads").name
    connection = http.client.HTTPConnection("127.0.0.1", running.port, timeout=60)
    connection.request("GET", "/?" + running.start_url.partition("?")[2])
    first = connection.getresponse()
    first.read()
    cookie = first.headers["set-cookie"].partition(";")[0]

    def upload(label, content, project=name):
        headers = {"Cookie": cookie, "Origin": running.base, "X-File-Name": label}
        connection.request("POST", f"/upload/{project}", content, headers)
        found = connection.getresponse()
        return found.status, json.loads(found.read())

    upload.folder = workspace.path(name)
    upload.workspace, upload.name = workspace, name
    yield upload
    connection.close()


def test_server__hostile_name__is_only_a_label(own, running):
    before = {p for p in running.folder.rglob("*") if p.name == "x.csv"}
    status, answer = own("..%2F..%2Fx.csv", recording_csv().encode())
    assert (status, answer) == (200, {"ok": True})
    (entry,) = own.workspace.load(own.name).recordings
    assert entry.label == "x.csv"
    assert entry.file.startswith("recording-1-")
    assert entry.options["input"] == "torque"
    assert {p for p in running.folder.rglob("*") if p.name == "x.csv"} == before


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"Dear diary, today I measured nothing.\nTomorrow perhaps.\n", ""),
        (b"", "empty"),
        (bytes(range(256)) * 40, ""),
    ],
)
def test_server__no_recording__is_refused_with_a_reason_and_leaves_nothing(own, content, said):
    status, answer = own("diary.txt", content)
    assert status == 422
    assert said in answer["problem"]
    assert ".upload" not in answer["problem"]
    assert list((own.folder / "recordings").iterdir()) == []


def test_server__gzip_bomb__is_refused_and_the_server_lives(own):
    status, answer = own("bomb.csv.gz", bomb())
    assert status == 422
    assert "expands" in answer["problem"]
    assert own("a.csv", recording_csv().encode())[0] == 200


def test_server__unknown_project__is_refused(own):
    assert own("a.csv", b"x", project="nobody")[0] == 422
    assert own("a.csv", b"x", project="..")[0] == 422
