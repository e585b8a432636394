"""Pictures for README and gallery: the drawing of a drive, measured and simulated motion, and the verdicts, in one SVG.

A picture is made of the texts and numbers that a run has left, so that the same run gives the same bytes.
"""

from __future__ import annotations

import html
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from brightgrey import Result
from brightgrey.arrays import Array
from brightgrey.drawing.text_width import wrap
from brightgrey.numerics.number_format import significant
from brightgrey.report.text.headline import headline
from brightgrey.report.text.tables import parameter_rows

__all__ = ["NARROW", "WIDE", "Form", "kept", "picture"]


class Form(NamedTuple):
    """Measures of a picture in pixels; a narrow one has what stands side by side in a wide one below each other."""

    width: float
    margin: float
    headline: float  #: Size of the font.
    indent: float  #: Of the reasons of the verdicts.

    @property
    def inner(self) -> float:
        """Width within the margins."""
        return self.width - 2.0 * self.margin

    @property
    def is_narrow(self) -> bool:
        """True for a telephone."""
        return self.indent == 0.0


WIDE = Form(1060.0, 20.0, 17.0, 400.0)
NARROW = Form(400.0, 12.0, 15.0, 0.0)

POINTS = 700
COLOURS = {
    "needed": ("#0b6e4f", "#e3f3ec"),
    "not needed": ("#5f5f66", "#eeeef1"),
    "not decidable": ("#8a5a00", "#fdf1da"),
}
STYLE = (
    "text{font-family:system-ui,'Helvetica Neue',Arial,'DejaVu Sans',sans-serif;fill:#1d1d1f}"
    ".soft{fill:#5f5f66}.verdict{fill:var(--ink)}"
    ".line{fill:none;stroke-width:1.3;stroke-linejoin:round}.measured{stroke:#56b4e9;stroke-width:2.6}"
    ".simulated{stroke:#1d1d1f}.residual{stroke:#d55e00}.grid{stroke:#d9d9de;stroke-width:.7;fill:none}"
)


def kept(result: Result) -> dict[str, Any]:
    """What a picture and a page need of a result, as JSON; motions are thinned."""
    said, traces = headline(result.content), []
    for trace in result.traces:
        for signal, y, fit in zip(trace.outputs, trace.measured, trace.simulated, strict=True):
            rows = np.unique(np.linspace(0, trace.t.size - 1, POINTS).round().astype(int))
            traces.append(
                {
                    "name": trace.name,
                    "output": f"{signal.name} in {signal.unit}",
                    "t": _short(trace.t[rows] - trace.t[0]),
                    "measured": _short(y[rows]),
                    "simulated": _short(fit[rows]),
                }
            )
    cards = result.evidence.cards if result.evidence else ()
    return {
        "structure": str(result.model.structure),
        "headline": list(said.sentences),
        "drawing": result.drawing().svg(WIDE.inner),
        "drawing_narrow": result.drawing().svg(NARROW.inner),
        "traces": traces,
        "verdicts": [[card.title, card.verdict, card.reason] for card in cards],
        "parameters": [[r.name, r.estimate, r.unit, r.about] for r in parameter_rows(result.model)],
    }


def _short(x: Array) -> list[float]:
    """Numbers with the digits that show."""
    return [float(f"{value:.4g}") for value in x.tolist()]


def picture(found: Mapping[str, Any], form: Form = WIDE, verdicts: Sequence[str] = ("needed",)) -> str:
    """SVG of a result that :func:`kept` has written: headline, drawing, motion, and effects with these verdicts."""
    parts, y = [], form.margin + 18.0
    for line in wrap(found["headline"][0], 1.09 * form.headline, form.inner):  # bold letters are wider
        parts.append(_text(form.margin, y, line, form.headline, weight=600))
        y += 1.4 * form.headline
    drawn, height = _nested(found["drawing_narrow" if form.is_narrow else "drawing"], form.width, y)
    parts.append(drawn)
    y += height + 12.0
    for trace in found["traces"][:1]:
        made, height = _motion(trace, form, y)
        parts.append(made)
        y += height + 24.0
    for title, verdict, reason in found["verdicts"]:
        if verdict in verdicts:
            made, height = _verdict(title, verdict, reason, form, y)
            parts.append(made)
            y += height
    body, title = "".join(parts), html.escape(found["headline"][0])
    box = f'viewBox="0 0 {form.width:g} {y + form.margin:.0f}" width="{form.width:g}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {box} role="img">'
        f"<title>{title}</title><style>{STYLE}</style>"
        f'<rect width="100%" height="100%" rx="10" fill="#ffffff"/>{body}</svg>\n'
    )


def _text(
    x: float, y: float, text: str, size: float, *, weight: int = 400, kind: str = "", anchor: str = "start"
) -> str:
    place = f'x="{x:.1f}" y="{y:.1f}" font-size="{size:g}" font-weight="{weight}" text-anchor="{anchor}"'
    return f'<text {place} class="{kind}">{html.escape(text)}</text>'


def _nested(drawing: str, room: float, y: float) -> tuple[str, float]:
    """Drawing of the drive at a height, in its light colours, as the picture has a ground of its own."""
    width, height = (float(v) for v in re.findall(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', drawing)[0])
    light = re.sub(r"@media \(prefers-color-scheme:dark\)\{.*?\}\}", "", drawing)
    x = (room - width) / 2.0
    placed = re.sub(r'style="max-width:100%;height:auto"', f'x="{x:.1f}" y="{y:.1f}"', light, count=1)
    return placed, height


def _motion(trace: Mapping[str, Any], form: Form, top: float) -> tuple[str, float]:
    """Measured and simulated output with the residual below."""
    t, measured, simulated = (np.array(trace[k]) for k in ("t", "measured", "simulated"))
    left, right, tall, low = form.margin + (40.0 if form.is_narrow else 64.0), form.width - form.margin, 150.0, 60.0
    x = left + (right - left) * t / t[-1]
    legend = "measured (blue), simulated by the model (black), residual (orange)"
    if form.is_narrow:
        lines = [trace["output"], *wrap(legend, 12.0, form.inner)]
        out = [_text(form.margin, top + 12.0 + 16.0 * k, line, 12.0, kind="soft") for k, line in enumerate(lines)]
    else:
        lines = [legend]
        out = [
            _text(form.margin, top + 12.0, trace["output"], 12.0, kind="soft"),
            _text(right, top + 12.0, legend, 12.0, kind="soft", anchor="end"),
        ]
    y0 = top + 6.0 + 16.0 * len(lines)
    for curves, height, base in (
        ((("measured", measured), ("simulated", simulated)), tall, y0),
        ((("residual", measured - simulated),), low, y0 + tall + 14.0),
    ):
        values = np.concatenate([v for _, v in curves])
        bottom, most = float(values.min()), float(values.max())
        scale = height / max(most - bottom, 1e-300)
        for value in (bottom, most):
            at = base + (most - value) * scale
            out.append(f'<path class="grid" d="M{left:.1f} {at:.1f}H{right:.1f}"/>')
            out.append(_text(left - 8.0, at + 4.0, significant(value, 2), 11.0, kind="soft", anchor="end"))
        for kind, v in curves:
            points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, base + (most - v) * scale, strict=True))
            out.append(f'<polyline class="line {kind}" points="{points}"/>')
    end = y0 + tall + 14.0 + low
    out.append(_text(left, end + 16.0, "0 s", 11.0, kind="soft"))
    out.append(_text(right, end + 16.0, f"{significant(float(t[-1]), 3)} s", 11.0, kind="soft", anchor="end"))
    return "".join(out), end + 20.0 - top


def _verdict(title: str, verdict: str, reason: str, form: Form, y: float) -> tuple[str, float]:
    """An effect with its verdict and the reason for it."""
    ink, ground = COLOURS[verdict]
    x, lines = form.margin, wrap(reason, 12.0, form.inner - form.indent)
    first = y + 14.5 + (20.0 if form.is_narrow else 0.0)
    out = [
        f'<rect x="{x:g}" y="{y:.1f}" width="100" height="20" rx="10" fill="{ground}"/>',
        f'<g style="--ink:{ink}">{_text(x + 50.0, y + 14.0, verdict, 11.0, kind="verdict", anchor="middle")}</g>',
        _text(x + 112.0, y + 14.5, title, 13.0, weight=600),
        *(_text(x + form.indent, first + 16.0 * k, line, 12.0, kind="soft") for k, line in enumerate(lines)),
    ]
    return "".join(out), max(26.0, first - y + 16.0 * len(lines) - 4.5)
