"""Templates of the report, and the cache of their compiled form."""

import os
import subprocess
import sys

from jinja2.bccache import bc_magic

LOAD = "from brightgrey.report.templates import page_template; print(page_template('report.html.j2').name)"


def loaded(cache_home):
    """Output of a process that loads the template of the report with the caches of a user there."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache_home), "NUMBA_CACHE_DIR": ""}
    run = subprocess.run([sys.executable, "-c", LOAD], env=environment, capture_output=True, text=True, check=True)
    return run.stdout.strip()


def test_page_template__cache_folder__holds_the_compiled_template(tmp_path):
    assert loaded(tmp_path) == "report.html.j2"
    assert [file.parent.name[:7] for file in tmp_path.rglob("template-*")] == ["kernel-"]


def test_page_template__damaged_cache__is_compiled_anew(tmp_path):
    loaded(tmp_path)
    (file,) = tmp_path.rglob("template-*")
    whole = file.read_bytes()
    for kept in (0, len(bc_magic), len(bc_magic) + 9, 1000):
        file.write_bytes(whole[:kept] + bytes(20))
        assert loaded(tmp_path) == "report.html.j2"


def test_page_template__cache_cannot_be_written__is_compiled_all_the_same(tmp_path):
    (tmp_path / "brightgrey").write_text("a file where the folder should be", encoding="utf-8")
    assert loaded(tmp_path) == "report.html.j2"
