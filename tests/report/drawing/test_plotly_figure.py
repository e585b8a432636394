"""plotly.js in a page: packed once, then read from the cache, which may be absent."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Iterator
from pathlib import Path

import pytest
from plotly.offline import get_plotlyjs

from brightgrey.report.drawing import plotly_figure
from brightgrey.report.drawing.plotly_figure import library


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setattr(plotly_figure, "cache_folder", lambda: tmp_path / "cache" / "kernel")
    library.cache_clear()
    yield tmp_path / "cache"
    library.cache_clear()


def test_library_unpacked_is_plotly(cache: Path) -> None:
    assert gzip.decompress(base64.b64decode(library())).decode() == get_plotlyjs()


def test_library_of_a_second_process_is_read_from_the_cache(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = library()
    library.cache_clear()
    monkeypatch.setattr(gzip, "compress", lambda *a, **k: pytest.fail("packed a second time"))

    assert library() == first
    assert [file.name for file in cache.iterdir()] == ["plotly.js.gz"]


def test_library_without_a_folder_for_the_cache_is_packed_anyway(cache: Path) -> None:
    cache.write_text("a file where the folder should be")

    assert gzip.decompress(base64.b64decode(library())).decode() == get_plotlyjs()


@pytest.mark.parametrize("kept", [b"", b"\x1f\x8b", b"garbage"], ids=["empty", "truncated", "garbage"])
def test_library_with_a_damaged_cache_is_packed_anew(cache: Path, kept: bytes) -> None:
    cache.mkdir()
    (cache / "plotly.js.gz").write_bytes(kept)

    assert gzip.decompress(base64.b64decode(library())).decode() == get_plotlyjs()
