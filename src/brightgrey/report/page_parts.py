"""Parts of a report.html that has been written: sections and figures, for pages that show some of them."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

__all__ = ["PageParts", "page_parts"]

_SECTION = re.compile(r'<section id="([a-z-]+)">\n(.*?)\n?</section>', re.DOTALL)
_HEADER = re.compile(r"<header>\n(.*?)<nav ", re.DOTALL)
_PLOTS = re.compile(r'<script type="application/json" id="plots">(.*?)</script>', re.DOTALL)


@dataclass(frozen=True)
class PageParts:
    """Parts of a report.

    Attributes
    ----------
    header : str
        Headline and warnings, as HTML.
    sections : mapping of str to str
        HTML of each section by its id, in their order. A figure is an element with ``data-plot``.
    plots : mapping of str to object
        Data and layout of each figure for plotly.js, by the value of ``data-plot``.
    """

    header: str
    sections: Mapping[str, str]
    plots: Mapping[str, Any]


def page_parts(text: str) -> PageParts:
    """Parts of the text of a report.html; without those that an older one may lack."""
    header, plots = _HEADER.search(text), _PLOTS.search(text)
    return PageParts(
        header.group(1) if header else "",
        dict(_SECTION.findall(text)),
        json.loads(plots.group(1)) if plots else {},
    )
