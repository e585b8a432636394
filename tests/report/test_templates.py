"""Templates of the report, and the cache of their compiled form."""

import pytest
from jinja2.bccache import bc_magic

from brightgrey.report import templates
from brightgrey.simulation.kernel.machine import compilation


@pytest.fixture
def loaded(monkeypatch, tmp_path):
    """Load the template of the report as a new process does, with the caches of a user there; return its name."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(compilation._CONFIG, "CACHE_DIR", "")

    def forget():
        compilation.cache_folder.cache_clear()
        templates._environment.cache_clear()

    def load():
        forget()
        return templates.page_template("report.html.j2").name

    yield load
    forget()


def test_page_template__cache_folder__holds_the_compiled_template(loaded, tmp_path):
    assert loaded() == "report.html.j2"
    assert [file.parent.name[:7] for file in tmp_path.rglob("template-*")] == ["kernel-"]


def test_page_template__damaged_cache__is_compiled_anew(loaded, tmp_path):
    loaded()
    (file,) = tmp_path.rglob("template-*")
    whole = file.read_bytes()
    for kept in (0, len(bc_magic), len(bc_magic) + 9, 1000):
        file.write_bytes(whole[:kept] + bytes(20))
        assert loaded() == "report.html.j2"
        assert len(file.read_bytes()) == len(whole)


def test_page_template__cache_cannot_be_written__is_compiled_all_the_same(loaded, tmp_path):
    (tmp_path / "brightgrey").write_text("a file where the folder should be", encoding="utf-8")
    assert loaded() == "report.html.j2"
