"""Text of a file, plain or compressed by gzip: decoded once, cut into lines, and held as bytes.

A recording of ten million lines has no room as ten million strings. The text is one block of bytes here, with the place
where every line begins; lines become strings in blocks, when they are parsed.
"""

from __future__ import annotations

import codecs
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from brightgrey.arrays import Indices
from brightgrey.errors import RecordingError
from brightgrey.recordings.policy import READING

__all__ = ["GZIP", "UNKNOWN_ENCODING", "Text", "first_text", "read_text", "unpacked_start"]

GZIP = b"\x1f\x8b"
UNKNOWN_ENCODING = "latin-1"
"""Stands for an encoding that is not known: each byte is a letter, and digits are what they are in all of them."""
UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
SPACES = b" \t\r\x0b\x0c\xef\xbb\xbf"


@dataclass(frozen=True)
class Text:
    """Lines of a text file.

    Attributes
    ----------
    data : bytes
        All lines, each with a newline at its end.
    encoding : str
        Of `data`.
    starts : ndarray of int, shape (lines + 1,)
        First byte of every line, and the length of `data`.
    """

    data: bytes
    encoding: str
    starts: Indices

    def __len__(self) -> int:
        return self.starts.size - 1

    def lines(self, first: int, last: int) -> list[str]:
        """Return the lines from `first` up to, not including, `last`."""
        if last <= first:
            return []
        return self.data[self.starts[first] : self.starts[last] - 1].decode(self.encoding, "replace").split("\n")

    def line(self, index: int) -> str:
        """Return one line."""
        return self.lines(index, index + 1)[0]

    def lines_like(self, line: str) -> list[int]:
        """Return the numbers of the lines that are equal to one."""
        searched = line.encode(self.encoding, "replace") + b"\n"
        found, at = [], self.data.find(searched)
        while at >= 0:
            index = int(np.searchsorted(self.starts, at, side="right")) - 1
            if self.starts[index] == at:
                found.append(index)
            at = self.data.find(searched, at + len(searched))
        return found

    def blocks(self, index: Indices) -> Iterator[tuple[int, list[str]]]:
        """Yield the lines with the rising numbers `index` in blocks, with the position of each block in `index`."""
        size = READING.lines_per_block
        for at in range(0, index.size, size):
            part = index[at : at + size]
            lines = self.lines(int(part[0]), int(part[-1]) + 1)
            yield at, (lines if len(lines) == part.size else [lines[i] for i in part - part[0]])

    def content(self, comments: tuple[str, ...]) -> Indices:
        """Return the numbers of the lines that are neither empty nor begin with one of `comments`."""
        lengths = np.diff(self.starts) - 1
        kept = lengths > 0
        first = np.frombuffer(self.data, np.uint8)[np.minimum(self.starts[:-1], max(len(self.data) - 1, 0))]
        unsure = np.isin(first, np.frombuffer(SPACES + "".join(comments).encode(), np.uint8)) & kept
        for i in np.flatnonzero(unsure):
            bare = self.data[self.starts[i] : self.starts[i + 1] - 1].lstrip(SPACES)
            kept[i] = bool(bare) and not bare.startswith(tuple(mark.encode() for mark in comments))
        return np.flatnonzero(kept)


def unpacked_start(start: bytes) -> bytes:
    """Return the beginning of the text in the first bytes of a gzip file; as much as they hold."""
    try:
        return zlib.decompressobj(31).decompress(start, len(start))
    except zlib.error:
        return b""


def first_text(start: bytes) -> str:
    """Return the first bytes of a file as text, if they are text at all, with single newlines."""
    if start[:2] in UTF_16:
        text = start[: len(start) // 2 * 2].decode("utf-16", "replace")
    else:
        text = start.removeprefix(codecs.BOM_UTF8).decode("utf-8", "replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_text(path: Path) -> Text | None:
    """Read a text file in UTF-8, UTF-16, Windows-1252 or another encoding that keeps ASCII; None if it is no text.

    Raises
    ------
    RecordingError
        For a gzip file that is damaged or expands to more than `READING.max_expansion` times its size, and for a
        text that is not the UTF-16 that it begins as.
    """
    data = path.read_bytes()
    if data.startswith(GZIP):
        data = _unpacked(data, path.name)
    if data[:2] in UTF_16:
        try:
            data = data.decode("utf-16").encode()
        except UnicodeDecodeError as error:
            raise RecordingError(f"{path.name}: the text is not the UTF-16 that it begins as") from error
    elif b"\x00" in data[:4096]:
        data = _without_nul(data)
        if not data:
            return None
    data = data.removeprefix(codecs.BOM_UTF8)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    data = data if data.endswith(b"\n") else data + b"\n"
    return Text(data, _encoding(data), _line_starts(data))


def _unpacked(packed: bytes, name: str) -> bytes:
    """Expand a gzip file of one or several members within the bound on its size."""
    most = max(READING.least_expansion, READING.max_expansion * len(packed))
    parts, size, rest = [], 0, packed
    try:
        while rest.startswith(GZIP):
            member = zlib.decompressobj(31)
            parts.append(member.decompress(rest, most - size + 1))
            size += len(parts[-1])
            if size > most:
                raise RecordingError(
                    f"{name}: the compressed file expands to more than {most / 1e6:.0f} MB, which no recording does;"
                    " unpack it first if it is one"
                )
            if not member.eof:
                raise RecordingError(f"{name}: the compressed file is cut off")
            rest = member.unused_data
    except zlib.error as error:
        raise RecordingError(f"{name}: the compressed file is damaged ({error})") from error
    return b"".join(parts)


def _encoding(data: bytes) -> str:
    """Return the first encoding that all bytes fit."""
    if data.isascii():
        return "ascii"
    for encoding in ("utf-8", "cp1252"):
        decoder = codecs.getincrementaldecoder(encoding)()
        try:
            for at in range(0, len(data), READING.bytes_per_block):
                decoder.decode(data[at : at + READING.bytes_per_block], final=at + READING.bytes_per_block >= len(data))
        except UnicodeDecodeError:
            continue
        return encoding
    return UNKNOWN_ENCODING


def _without_nul(data: bytes) -> bytes:
    """Return UTF-16 without a byte order mark as UTF-8; empty for what is no such text."""
    start = np.frombuffer(data[:4096], np.uint8)
    for encoding, empty in (("utf-16-le", start[1::2]), ("utf-16-be", start[::2])):
        if np.count_nonzero(empty == 0) > 0.9 * empty.size and np.count_nonzero(start == 0) <= 0.5 * start.size:
            try:
                return data.decode(encoding).encode()
            except UnicodeDecodeError:
                return b""
    return b""


def _line_starts(data: bytes) -> Indices:
    """Return the first byte of every line, found in blocks so that no mask of the whole file is held."""
    ends = [
        at
        + 1
        + np.flatnonzero(np.frombuffer(data, np.uint8, min(READING.bytes_per_block, len(data) - at), at) == ord("\n"))
        for at in range(0, len(data), READING.bytes_per_block)
    ]
    return np.concatenate([np.zeros(1, np.intp), *ends])
