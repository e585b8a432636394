"""TOML of plain data: tables, lists of tables, and values that JSON writes alike."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

__all__ = ["toml_text"]


def toml_text(content: Mapping[str, Any]) -> str:
    """Text of a TOML file.

    Parameters
    ----------
    content : mapping of str to object
        Texts, numbers, lists of them, mappings, and lists of mappings. None is left out.
    """
    return "\n".join(_toml_lines(content, ())) + "\n"


def _toml_lines(content: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    for key, value in content.items():
        if value is not None and not _is_table(value):
            yield f"{_key(key)} = {_value(value)}"
    for key, value in content.items():
        inner = (*path, key)
        name = ".".join(map(_key, inner))
        if isinstance(value, Mapping):
            yield from ("", f"[{name}]", *_toml_lines(value, inner))
        elif value is not None and _is_table(value):
            for part in value:
                yield from ("", f"[[{name}]]", *_toml_lines(part, inner))


def _is_table(value: Any) -> bool:
    return isinstance(value, Mapping) or (isinstance(value, list) and bool(value) and isinstance(value[0], Mapping))


def _key(text: str) -> str:
    return text if text.isascii() and text.replace("_", "").replace("-", "").isalnum() else _value(text)


def _value(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
