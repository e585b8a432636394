"""plotly.js in a page: packed once, then read from the cache, which may be absent."""

import base64
import gzip

import pytest
from plotly.offline import get_plotlyjs

from brightgrey.report.drawing import plotly_figure
from brightgrey.report.drawing.plotly_figure import library


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setattr(plotly_figure, "cache_folder", lambda: tmp_path / "cache" / "kernel")
    library.cache_clear()
    yield tmp_path / "cache"
    library.cache_clear()


def test_library__unpacked__is_plotly(cache):
    assert gzip.decompress(base64.b64decode(library())).decode() == get_plotlyjs()


def test_library__second_process__is_read_from_the_cache(cache, monkeypatch):
    first = library()
    library.cache_clear()
    monkeypatch.setattr(gzip, "compress", lambda *a, **k: pytest.fail("packed a second time"))

    assert library() == first
    assert [file.name for file in cache.iterdir()] == ["plotly.js.gz"]


def test_library__no_folder_for_the_cache__is_packed_anyway(cache):
    cache.write_text("a file where the folder should be")

    assert gzip.decompress(base64.b64decode(library())).decode() == get_plotlyjs()


@pytest.mark.parametrize(
    "damaged", [lambda whole: b"", lambda whole: whole[:-1], lambda whole: gzip.compress(b"other")]
)
def test_library__empty_truncated_or_other_file_in_the_cache__is_packed_anew(cache, damaged):
    whole = base64.b64decode(library())
    (cache / "plotly.js.gz").write_bytes(damaged(whole))
    library.cache_clear()

    assert base64.b64decode(library()) == (cache / "plotly.js.gz").read_bytes() == whole
