"""The disk cache of the kernel is named by every source file that it is compiled from."""

import shutil
import tempfile
from pathlib import Path

import numba.core.config
import pytest

import brightgrey
from brightgrey.simulation.kernel.machine.compilation import cache_folder

ROOMS = ("effects", "simulation/kernel")


@pytest.fixture
def package(tmp_path):
    """Copy of the sources that are hashed."""
    for room in ROOMS:
        shutil.copytree(Path(brightgrey.__file__).parent / room, tmp_path / "brightgrey" / room)
    return tmp_path / "brightgrey"


def changed_name(package, file):
    """Name of the cache folder while `file` of the package has one more comment."""
    text = file.read_text(encoding="utf-8")
    file.write_text(text + "# changed\n", encoding="utf-8")
    cache_folder.cache_clear()
    name = cache_folder(package).name
    file.write_text(text, encoding="utf-8")
    cache_folder.cache_clear()
    return name


def test_cache_folder__copy_of_the_sources__has_the_same_name(package):
    assert cache_folder(package).name == cache_folder().name


def test_cache_folder__any_source_file_changed__has_another_name(package):
    files = sorted(file for room in ROOMS for file in (package / room).rglob("*.py"))
    folders = {str(file.relative_to(package).parent) for file in files}
    assert folders >= {"effects", "effects/library", "simulation/kernel", "simulation/kernel/machine"}
    names = [changed_name(package, file) for file in files]
    assert len({cache_folder(package).name, *names}) == len(files) + 1


def test_cache_folder__new_effect__has_another_name(package):
    before = cache_folder(package).name
    (package / "effects" / "library" / "drag.py").write_text("EFFECT = None\n", encoding="utf-8")
    cache_folder.cache_clear()
    assert cache_folder(package).name != before


@pytest.fixture
def homeless(tmp_path, monkeypatch):
    """Folder for temporary files of a user without a home, as an unnamed one in a container is."""

    def no_home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", "")
    monkeypatch.setattr(Path, "home", no_home)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    cache_folder.cache_clear()
    yield tmp_path
    cache_folder.cache_clear()


def test_cache_folder__no_home__is_a_private_temporary_folder_that_later_processes_find(homeless):
    first = cache_folder()
    cache_folder.cache_clear()
    assert cache_folder() == first
    assert first.parent.parent == homeless
    assert first.parent.stat().st_mode & 0o777 == 0o700


def test_cache_folder__no_home_and_a_folder_that_others_may_write_to__is_another_one(homeless):
    first = cache_folder().parent
    first.chmod(0o777)
    cache_folder.cache_clear()
    assert cache_folder().parent != first
