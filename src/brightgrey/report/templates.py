"""Templates of the report, with the filters that they share."""

from __future__ import annotations

import hashlib
import re
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path

from jinja2 import Environment, FileSystemBytecodeCache, PackageLoader, StrictUndefined, Template
from jinja2.bccache import Bucket
from markupsafe import Markup, escape

from brightgrey.kit import Placed, Structure
from brightgrey.kit.in_words import effect_in_words, structure_in_words
from brightgrey.recordings.units.signals import kind_in_words
from brightgrey.simulation.kernel.machine.compilation import cache_folder

__all__ = ["exact", "page_template"]


def page_template(name: str) -> Template:
    """Template of a file in this folder."""
    return _environment().get_template(name)


def exact(shown: str, value: float | None) -> Markup | str:
    """HTML of a number as shown, with its exact value as data."""
    return shown if value is None or not shown else Markup(f'<data value="{value!r}">{escape(shown)}</data>')


def _typed(text: str) -> Markup:
    """HTML of a text with what is typed, between “ and ”, as code."""
    return Markup(re.sub("“(.*?)”", r"<code>\1</code>", str(escape(text))))


def _unbroken(command: str) -> Markup:
    """HTML of a command that is broken between its words only, not after the hyphens of an option."""
    return Markup(re.sub(r"\S+", r'<span class="typed-word">\g<0></span>', str(escape(command))))


class _TemplateCache(FileSystemBytecodeCache):
    """Compiled templates on the disk. What cannot be read or written there is compiled anew."""

    def load_bytecode(self, bucket: Bucket) -> None:
        try:
            super().load_bytecode(bucket)
        except Exception:  # pickle sets no limit to what damaged data may raise
            bucket.reset()

    def dump_bytecode(self, bucket: Bucket) -> None:
        with suppress(OSError):
            super().dump_bytecode(bucket)


def _template_cache() -> _TemplateCache | None:
    """Cache beside the kernel's machine code, of this file's filters and options; None where none can be written."""
    own = hashlib.sha256(version("jinja2").encode() + Path(__file__).read_bytes()).hexdigest()[:16]
    try:
        folder = cache_folder()
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return _TemplateCache(str(folder), f"template-%s-{own}.cache")


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("brightgrey", "report"),
        bytecode_cache=_template_cache(),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["exact"] = exact
    environment.filters["typed"] = _typed
    environment.filters["unbroken"] = _unbroken
    environment.filters["kind"] = kind_in_words
    environment.filters["structure"] = lambda name: structure_in_words(Structure.parse(str(name)))
    environment.filters["effect"] = lambda name: effect_in_words(Placed.parse(name))
    return environment
