"""The public face: its names, and that they cost nothing until they are used."""

import subprocess
import sys

import pytest

import brightgrey

HEAVY = ("numpy", "scipy", "numba", "pint", "matplotlib", "plotly", "jinja2", "ruckig")


@pytest.mark.parametrize("name", brightgrey.__all__)
def test_every_exported_name_is_there(name):
    assert getattr(brightgrey, name) is not None
    assert name in dir(brightgrey)


@pytest.mark.parametrize("name", [n for n in brightgrey.__all__ if n != "__version__"])
def test_every_exported_name_is_described(name):
    assert getattr(brightgrey, name).__doc__.strip()


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="identfy"):
        brightgrey.identfy  # noqa: B018


def imported_after(code):
    """Which of the heavy packages a fresh interpreter has imported after `code`."""
    show = f"; import sys; print(*(m for m in {HEAVY!r} if m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code + show], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1].split()


def test_import_is_light():
    assert imported_after("import brightgrey") == []


def test_help_is_light():
    # The clock says nothing on a busy machine; what would make it slow are these imports.
    code = "from brightgrey.cli import main; main(['--help']); main(['identify', '--help'])"
    assert imported_after(code) == []
