"""Compilation of the kernel ahead of its first use."""

import os
import subprocess
import sys
from types import MappingProxyType

import pytest

from brightgrey.simulation import is_kernel_ready, preparation, prepare_kernel

COLD = """
from brightgrey.simulation import is_kernel_ready, prepare_kernel
assert not is_kernel_ready()
told = []
prepare_kernel(lambda done, total, entry: told.append((done, total, entry)))
assert is_kernel_ready()
assert [done for done, *_ in told] == list(range(1, told[0][1] + 1)), told
assert len({entry for *_, entry in told}) == told[0][1], told
prepare_kernel(lambda *_: 1 / 0)  # nothing is left to compile
"""


def test_compile_unclaimed__entry_claimed_by_another_process__is_left_to_it(tmp_path, monkeypatch):
    compiled, named = [], []
    entries = {name: lambda name=name: compiled.append(name) for name in "abc"}
    monkeypatch.setattr(preparation, "ENTRIES", MappingProxyType(entries))
    (tmp_path / "1").touch()
    preparation.compile_unclaimed(str(tmp_path), named.append)
    assert compiled == named == ["a", "c"]
    preparation.compile_unclaimed(str(tmp_path), named.append)
    assert compiled == named == ["a", "c"]


def test_compile_unclaimed__from_the_end__last_entry_is_first(tmp_path, monkeypatch):
    named = []
    monkeypatch.setattr(preparation, "ENTRIES", MappingProxyType(dict.fromkeys("abc", lambda: None)))
    preparation.compile_unclaimed(str(tmp_path), named.append, from_the_end=True)
    assert named == ["c", "b", "a"]


def test_prepare_kernel__second_process_fails__leaves_compilation_to_the_first_use(monkeypatch, tmp_path):
    compiled = []
    monkeypatch.setattr(preparation, "ENTRIES", MappingProxyType({"a": lambda: compiled.append("a")}))
    monkeypatch.setattr(preparation, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(preparation.sys, "executable", "/bin/false")
    prepare_kernel()
    assert compiled == ["a"]
    assert not is_kernel_ready()
    monkeypatch.setattr(preparation.sys, "executable", str(tmp_path / "missing"))
    prepare_kernel()
    assert not is_kernel_ready()


@pytest.mark.long
def test_prepare_kernel__empty_cache__compiles_every_entry_once(tmp_path):
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    subprocess.run([sys.executable, "-c", COLD], env=environment, check=True)
