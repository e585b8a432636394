"""Sentences for people: lists that stay short, capitals and full stops, and parameters with what they are."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence

from brightgrey.kit.in_words import enumerated, parameters_in_words
from brightgrey.kit.structure import Structure

__all__ = ["doubtful_in_words", "left_out_in_words", "listing", "sentence", "with_forces", "with_meanings"]

LONGEST_SENTENCE = 30
"""Words of a sentence; longer lists are split."""


def listing(prefix: str, items: Sequence[str], last: str, suffix: str = "") -> str:
    """Sentences that list items, such as ``No backlash, dead time or constant load.``, each of at most 30 words.

    Parameters
    ----------
    prefix : str
        Words before the first item, the same in every sentence.
    items : sequence of str
    last : {'and', 'or'}
        Word before the last item of a sentence.
    suffix : str
        Words after the last item of a sentence.

    Returns
    -------
    str
        As many sentences as it takes to keep each within 30 words; empty without items.
    """
    return " ".join(_sentences(prefix, items, last, suffix))


def _sentences(prefix: str, items: Sequence[str], last: str, suffix: str) -> Iterator[str]:
    left = list(items)
    while left:
        count = len(left)
        while True:
            text = f"{prefix} {enumerated(left[:count], last)}{suffix}."
            if count == 1 or len(text.split()) <= LONGEST_SENTENCE:
                break
            count -= 1
        yield text
        left = left[count:]


def sentence(text: str) -> str:
    """`text` with a capital at its beginning, unless a file is named there, and a full stop at its end."""
    ended = text.strip().rstrip(".")
    first, colon, _ = ended.partition(":")
    _, dot, suffix = first.rpartition(".")
    return f"{ended}." if colon and dot and suffix.isalpha() else f"{ended[:1].upper()}{ended[1:]}."


def doubtful_in_words(effects: Sequence[str]) -> str:
    """Sentences on effects, in words, that a model leaves out since there is a doubt about them; empty without any."""
    why = "That helps in some parts of the recording only, or nothing is known of its size."
    return f"{listing('The model leaves out', effects, 'and')} {why}" if effects else ""


def left_out_in_words(fits: Sequence[float | None], most: int = 5) -> str:
    """Fits in percent of recordings that were left out, after the name of a model; empty without any.

    Of more than `most` recordings the worst and the best fit are named. A simulation has diverged where the fit is None
    or not finite.
    """
    known = [fit for fit in fits if fit is not None and math.isfinite(fit)]
    lost = f"diverges in {len(fits) - len(known)} of {len(fits)} recordings that were left out"
    if not known:
        return lost if fits else ""
    few = len(known) <= most
    shown = [f"{fit:.1f}" if fit >= 0.0 else "below 0" for fit in (known if few else (min(known), max(known)))]
    text = f"predicts each recording from the others to {'' if few else 'between '}{enumerated(shown)} %"
    return text if len(known) == len(fits) else f"{text}, and {lost}"


def with_forces(text: str) -> str:
    """Sentence about a linear axis, where a torque is a force; what is typed, between apostrophes, stays as it is."""
    parts = re.split(r"('[^']*')", text)
    for k in range(0, len(parts), 2):
        parts[k] = re.sub("[tT]orque( or force)?", lambda found: "Force" if found[0][0] == "T" else "force", parts[k])
    return "".join(parts)


def with_meanings(text: str, structure: Structure) -> str:
    """Sentence with every parameter of a structure called by what it is, ``viscous friction (f_v)``.

    What is typed, between apostrophes, stays as it is, and so does a sentence that would become too long.
    """
    words = parameters_in_words(structure)
    names = "|".join(re.escape(name) for name in sorted(words, key=len, reverse=True))
    parts = re.split(r"('[^']*')", text)
    for k in range(0, len(parts), 2):
        parts[k] = re.sub(rf"(?<![\w@(])({names})(?![\w@(])", lambda found: f"{words[found[0]]} ({found[0]})", parts[k])
    told = "".join(parts)
    return told if len(told.split()) <= LONGEST_SENTENCE else text
