"""report.html: one self-contained page that opens anywhere, offline."""

from __future__ import annotations

from collections.abc import Sequence

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from brightgrey.export.model import Model
from brightgrey.export.ranking import Row
from brightgrey.export.trace import Trace
from brightgrey.report.figure import comparison, picture
from brightgrey.report.numbers import significant
from brightgrey.report.tables import fit_rows, parameter_rows, remarks, verdict
from brightgrey.search.evidence import Evidence

__all__ = ["page"]


_TOP = 10  # structures of the ranking that are shown


def page(
    model: Model,
    traces: Sequence[Trace],
    notes: Sequence[str] = (),
    evidence: Evidence | None = None,
    ranking: Sequence[Row] = (),
) -> str:
    """Text of report.html.

    Parameters
    ----------
    model : Model
        Every number in the page is one of the model's.
    traces : sequence of Trace
        What the figure shows.
    notes : sequence of str
        Repairs of the recordings and assumptions about them.
    evidence : Evidence, optional
        Of a search: a verdict on every effect.
    ranking : sequence of Row
        Structures that were tried, best first.
    """
    environment = Environment(
        loader=PackageLoader("brightgrey", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    rows = parameter_rows(model)
    svg = picture(comparison(traces)).decode()
    return environment.get_template("report.html.j2").render(
        model=model,
        verdict=verdict(model),
        remarks=remarks(model),
        # Only the element: a page has no place for the XML declaration before it.
        figure=Markup(svg[svg.index("<svg") :]),
        parameters=rows,
        noted=any(row.note for row in rows),
        fits=fit_rows(model),
        criterion=significant(model.criterion.value, 6) if model.criterion else "",
        notes=list(notes),
        settings=_settings(model),
        cards=evidence.cards if evidence else (),
        ranking=_ranking(ranking),
    )


def _ranking(ranking: Sequence[Row]) -> list[tuple[str, str, str, str, str, str]]:
    """Cells of the first structures: rank, structure, parameters, fit, criterion, tied; none if there was one only."""
    if len(ranking) < 2:
        return []
    return [
        (
            str(rank),
            row.structure,
            str(row.n_parameters),
            f"{row.fit_percent:.3f}",
            "" if row.criterion is None else significant(row.criterion, 6),
            "yes" if row.tied else "",
        )
        for rank, row in enumerate(ranking[:_TOP], 1)
    ]


def _settings(model: Model) -> list[tuple[str, str]]:
    s = model.settings
    rows = [
        ("f_tanh, gain of the smoothed sign", f"{significant(s.f_tanh)} {s.f_tanh_unit}"),
        ("sampling time", f"{s.sampling_time:.6g} s"),
        ("input between samples", {"linear": "straight lines", "zoh": "held"}[s.hold]),
        ("integration level", s.level),
    ]
    for initial in model.initial_state:
        state = ", ".join(f"{name} = {significant(v.value)} {v.unit}" for name, v in initial.state.items())
        rows.append((f"initial state, {initial.recording}", state))
    return [*rows, ("seed", str(model.seed)), ("brightgrey", model.version)]
