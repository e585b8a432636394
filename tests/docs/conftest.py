"""A copy of the package with everything that the pages for contributors add to it."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import brightgrey
from brightgrey.file_lock import hold_lock

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "docs" / "how-to" / "add-effect.md", ROOT / "CONTRIBUTING.md")
NEW_FILE = re.compile(r"^`src/(brightgrey/[\w/]+\.py)`:\n\n```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
ENTRY = re.compile(
    r"^In `src/(brightgrey/[\w/]+\.py)`, below the line `(.+?)`:\n\n```text\n(.*?)^```", re.MULTILINE | re.DOTALL
)

FAST_COMPILATION = {"NUMBA_OPT": "1"}
"""The kernel of the copy is compiled with few optimisations: a fifth of the time less, and its searches are short."""


def extend(package):
    """Put the files and entries of the pages into the copy of the package in the folder `package`."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        blocks = len(re.findall(r"^```(?:python|text)$", text, re.MULTILINE))
        files, entries = NEW_FILE.findall(text), ENTRY.findall(text)
        assert blocks == len(files) + len(entries), f"a code block of {page.name} says nowhere in which file it belongs"
        for name, code in files:
            target = package.parent / name
            assert not target.exists()
            target.write_text(code, encoding="utf-8")
        for name, line, code in entries:
            target = package.parent / name
            before = target.read_text(encoding="utf-8")
            assert before.count(f"{line}\n") == 1
            target.write_text(before.replace(f"{line}\n", f"{line}\n{code}"), encoding="utf-8")


@pytest.fixture(scope="session")
def kept(request, tmp_path_factory):
    """Folder for the copy and its compiled kernel, kept in the cache of pytest; a new one where that is in use.

    The kernel takes a minute to compile. The name of its folder is a hash of its sources, so that a changed kernel is
    compiled anew. Where it lies, the sources have to lie in the same place.
    """
    cache = getattr(request.config, "cache", None)
    folder = cache.mkdir("extended") if cache else tmp_path_factory.mktemp("kept")
    lock = hold_lock(folder / "lock", timeout=0.0)
    yield folder if lock else tmp_path_factory.mktemp("kept")
    if lock:
        lock.close()


@pytest.fixture(scope="session")
def extended(kept, tmp_path_factory):
    """Function that runs Python with the extended copy of the package, in its attribute `folder`."""
    folder = tmp_path_factory.mktemp("extended")
    package = kept / "brightgrey"
    shutil.rmtree(package, ignore_errors=True)
    shutil.copytree(Path(brightgrey.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    extend(package)

    def run(*arguments):
        done = subprocess.run(
            [sys.executable, *map(str, arguments)],
            cwd=folder,
            env={**os.environ, **FAST_COMPILATION, "PYTHONPATH": str(kept), "XDG_CACHE_HOME": str(kept / "cache")},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr + done.stdout
        return done.stdout

    run.folder = folder
    return run
