"""Uploads: streamed to the disk under a random name, counted while they come, and refused where they are too large."""

from __future__ import annotations

import asyncio
import hashlib
import secrets
import shutil
import zlib
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path

from brightgrey.errors import RecordingError

__all__ = ["UPLOADS", "ReceivedFile", "UploadPolicy", "receive_file"]


@dataclass(frozen=True)
class UploadPolicy:
    """Limits of an upload."""

    most_bytes: int = 4 << 30  #: Of a file, and of what a packed one expands to.
    spare_bytes: int = 200 << 20  #: Left free on the disk.
    piece: int = 1 << 20  #: Bytes that are expanded at a time.


UPLOADS = UploadPolicy()
_GZIP = b"\x1f\x8b"


@dataclass(frozen=True)
class ReceivedFile:
    """A file that has come whole."""

    path: Path
    sha256: str
    size: int


async def receive_file(
    stream: AsyncIterator[bytes], folder: Path, announced: int | None, policy: UploadPolicy = UPLOADS
) -> ReceivedFile:
    """Write a stream into a file with a random name in `folder`.

    Parameters
    ----------
    stream : async iterator of bytes
    folder : Path
    announced : int or None
        Length that the browser has announced.
    policy : UploadPolicy

    Raises
    ------
    RecordingError
        If it is empty, larger than the limit, than the disk has room for, or expands to too much. Nothing is left then.
    """
    room = shutil.disk_usage(folder).free - policy.spare_bytes
    most = min(policy.most_bytes, room)
    if announced is not None and announced > most:
        raise RecordingError(_too_large(announced, policy, room))
    path = folder / f".upload-{secrets.token_hex(8)}"
    counted, digest, expansion = 0, hashlib.sha256(), None
    try:
        with path.open("xb") as target:
            async for chunk in stream:
                if not chunk:
                    continue
                if counted == 0 and chunk.startswith(_GZIP):
                    expansion = _Expansion(policy)
                counted += len(chunk)
                if counted > most:
                    raise RecordingError(_too_large(counted, policy, room))
                if expansion is not None:
                    await asyncio.to_thread(expansion.count, chunk)
                digest.update(chunk)
                target.write(chunk)
        if counted == 0:
            raise RecordingError("the file is empty")
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    return ReceivedFile(path, digest.hexdigest(), counted)


def _too_large(size: int, policy: UploadPolicy, room: int) -> str:
    if size > policy.most_bytes:
        return f"the file has more than {policy.most_bytes >> 30} GB; cut the time that matters out of it first"
    return f"the disk has room for {max(room, 0) >> 20} MB only"


class _Expansion:
    """Counts what a gzip file expands to, without keeping it."""

    def __init__(self, policy: UploadPolicy) -> None:
        from brightgrey.recordings.policy import READING  # it brings NumPy and all readers, which take 0.2 s

        self.policy, self.reading = policy, READING
        self.packed = self.expanded = 0
        self.inflate = zlib.decompressobj(31)

    def count(self, chunk: bytes) -> None:
        """Expand a piece of the file; RecordingError if it has become too much."""
        self.packed += len(chunk)
        while chunk:
            try:
                self.expanded += len(self.inflate.decompress(chunk, self.policy.piece))
            except zlib.error:
                raise RecordingError("the compressed file is damaged") from None
            allowed = max(self.reading.max_expansion * self.packed, self.reading.least_expansion)
            most = min(allowed, self.policy.most_bytes)
            if self.expanded > most:
                raise RecordingError(
                    f"the compressed file expands to more than {self.reading.max_expansion} times its size, which no "
                    "recording does; it is refused"
                )
            if self.inflate.eof:
                chunk, self.inflate = self.inflate.unused_data, zlib.decompressobj(31)
            else:
                chunk = self.inflate.unconsumed_tail
