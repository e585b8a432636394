"""Text of the exports: the files in `templates`, and the words that are put into them."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files

from brightgrey.exports.expressions.languages import number_literal
from brightgrey.exports.numeric_model import NumericModel

__all__ = ["NAME", "fill_words", "header_words", "signal_names", "template"]

NAME = "drive"
"""Name of the exported model, and so of its files and functions."""


def template(name: str) -> str:
    """Text of a template: the part of an export that is the same for all models."""
    return files("brightgrey.exports").joinpath("templates", name).read_text(encoding="utf-8")


def fill_words(text: str, words: Mapping[str, str]) -> str:
    """Put `words` where the text has ``@word@``."""
    for word, meaning in words.items():
        text = text.replace(f"@{word}@", meaning)
    return text


def header_words(numeric: NumericModel) -> dict[str, str]:
    """Words of the header that every export begins with: title, version, signals, states, sampling."""
    return {
        "title": numeric.title,
        "version": numeric.model.version,
        "name": NAME,
        "NAME": NAME.upper(),
        "dt": number_literal(numeric.dt),
        "hold": "straight" if numeric.hold == "linear" else "held",
        "input": f"{numeric.model.input.name} [{numeric.model.input.unit}]",
        "outputs": ", ".join(f"{o.name} [{o.unit}]" for o in numeric.outputs),
        "states": ", ".join(f"{s.name} [{numeric.unit(s.dimension)}]" for s in numeric.system.states),
    }


def signal_names(numeric: NumericModel) -> list[str]:
    """Names of input and outputs, each once."""
    names = [numeric.model.input.name]
    for output in numeric.outputs:
        name = output.name if output.name not in names else f"{output.name} {output.kind}"
        names.append(name if name not in names else f"{name} {len(names)}")
    return names
