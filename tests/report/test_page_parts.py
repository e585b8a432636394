"""Parts of a report that has been written."""

from brightgrey.report.content import Content
from brightgrey.report.page import page
from brightgrey.report.page_parts import page_parts
from support.models import model_with_intervals, trace_of


def test_page_parts__of_a_report__are_its_sections_and_figures():
    model = model_with_intervals()
    text = page(Content(model, [trace_of(model)]))
    parts = page_parts(text)
    assert "<h1>" in parts.header
    assert "<nav" not in parts.header
    assert list(parts.sections)[:3] == ["next", "drawing", "motion"]
    assert all(section in text for section in parts.sections.values())
    assert 'data-plot="comparison-0"' in parts.sections["motion"]
    assert set(parts.plots["comparison-0"]) == {"data", "layout"}


def test_page_parts__of_another_page__are_empty():
    parts = page_parts("<html><body>nothing</body></html>")
    assert (parts.header, parts.sections, parts.plots) == ("", {}, {})
