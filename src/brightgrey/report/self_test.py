"""Section of the report on a self-test."""

from __future__ import annotations

import re

from brightgrey.report.templates import page_template
from brightgrey.self_test.schema import SelfTest

__all__ = ["with_section"]

_BEGIN, _END = "<!-- self-test -->", "<!-- end of self-test -->"
_BEFORE = ('<section id="repeat">', "</main>")


def with_section(page: str, found: SelfTest) -> str:
    """Text of report.html with a section on the self-test, in place of an earlier one.

    Parameters
    ----------
    page : str
    found : SelfTest
    """
    section = page_template("self_test.html.j2").render(test=found)
    bare = re.sub(f"{_BEGIN}.*?{_END}\n?", "", page, flags=re.DOTALL)
    before = next((mark for mark in _BEFORE if mark in bare), "")
    head, mark, tail = bare.partition(before) if before else (bare, "", "")
    return f"{head}{_BEGIN}\n{section}\n{_END}\n{mark}{tail}"
