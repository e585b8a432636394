"""HTML of a result in a notebook: verdict, drawing, parameters, fit and the main figure."""

from __future__ import annotations

import html

from brightgrey.notebook_html import table
from brightgrey.report.content import Content
from brightgrey.report.drawing.matplotlib_figure import draw, picture
from brightgrey.report.text.headline import headline
from brightgrey.report.text.prose import sentence, with_meanings
from brightgrey.report.text.tables import fit_rows, parameter_rows, remarks

__all__ = ["result_html"]


def result_html(content: Content) -> str:
    """Element of HTML without any script."""
    model = content.model
    rows = parameter_rows(model)
    noted = ("Note",) if any(r.note for r in rows) else ()
    parameters = [(r.name, r.estimate, r.unit, *((r.note,) if noted else ()), r.about) for r in rows]
    fits = [(r.output, r.recording, r.fit_percent, r.rmse, r.unit) for r in fit_rows(model)]
    first, *rest = headline(content).sentences
    outcome = sentence(with_meanings(model.outcome.text, model.structure))
    parts = [f"<p><b>{html.escape(first)}</b></p><p>{html.escape(' '.join([*rest, outcome]))}</p>"]
    parts.append(model.drawing().html())
    parts += [f"<p>Mind: {html.escape(text)}</p>" for text in remarks(model)]
    parts.append(table(("Parameter", "Estimate", "Unit", *noted, "Meaning"), parameters, unbroken=("Estimate", "Unit")))
    parts.append(table(("Output", "Recording", "Fit in %", "RMSE", "Unit"), fits))
    if content.evidence and content.evidence.cards:
        cards = [(card.title, card.verdict, card.reason) for card in content.evidence.cards]
        parts.append(table(("Effect", "Verdict", "Reason"), cards))
    if "comparison" in content.charts:
        svg = picture(draw(content.charts["comparison"])).decode()
        drawn = svg[svg.index("<svg") :].replace("<svg", '<svg style="max-width:100%;height:auto"', 1)
        parts.append(f'<div style="background:#fff;max-width:50em">{drawn}</div>')
    return f"<div>{''.join(parts)}</div>"
