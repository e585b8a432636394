"""Results reach the disk whole or not at all."""

import os
from pathlib import Path

import pytest

from brightgrey.errors import SettingsError
from brightgrey.model.files import check_file, check_folder, write_file, write_files


def test_checks__of_new_paths__create_nothing(tmp_path):
    assert check_folder(tmp_path / "a" / "b") == tmp_path / "a" / "b"
    assert check_file(tmp_path / "c" / "d.csv") == tmp_path / "c" / "d.csv"
    assert list(tmp_path.iterdir()) == []


def test_check_folder__is_a_file__is_refused(tmp_path):
    file = tmp_path / "out"
    file.write_text("mine")
    with pytest.raises(SettingsError, match="is a file"):
        check_folder(file)
    with pytest.raises(SettingsError, match="'out' on the way"):
        check_folder(file / "deeper")
    with pytest.raises(SettingsError, match="'out' on the way"):
        check_file(file / "fit.csv")
    assert file.read_text() == "mine"


def test_check_file__is_a_folder__is_refused(tmp_path):
    with pytest.raises(SettingsError, match="is a folder"):
        check_file(tmp_path)


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="the superuser may write everywhere")
def test_check_folder__without_permission__is_refused(tmp_path):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(SettingsError, match="no permission"):
            check_folder(tmp_path / "out")
    finally:
        tmp_path.chmod(0o700)


def test_write_files__older_files__are_replaced(tmp_path):
    folder = tmp_path / "new" / "folder"
    write_files(folder, {"a": b"1", "b": b"2"})
    write_files(folder, {"a": b"3"})
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == {"a": b"3", "b": b"2"}
    write_file(folder / "b", b"4")
    assert (folder / "b").read_bytes() == b"4"


def test_write_files__failure__leaves_everything_as_it_was(tmp_path):
    (tmp_path / "a").write_bytes(b"old")
    # The second name cannot be written: there is no such folder below.
    with pytest.raises(OSError, match="absent"):
        write_files(tmp_path, {"a": b"new", "absent/b": b"new"})
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == {"a": b"old"}


def test_write_file__may_be_read_by_others(tmp_path):
    write_file(tmp_path / "a", b"")
    assert Path(tmp_path / "a").stat().st_mode & 0o777 == 0o644


def test_checks__of_a_device__are_refused(tmp_path):
    device = tmp_path / "device"
    os.mkfifo(device)  # a pipe stands for a device: both are no regular file
    with pytest.raises(SettingsError, match="device or a pipe; name a file"):
        check_file(device)
    with pytest.raises(SettingsError, match="device or a pipe; name a folder"):
        check_folder(device)
    with pytest.raises(SettingsError, match="device or a pipe"):
        write_files(tmp_path, {"model.json": b"new", "device": b"new"})
    assert device.is_fifo()
    assert [p.name for p in tmp_path.iterdir()] == ["device"]
