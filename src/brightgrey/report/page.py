"""report.html: one self-contained page that opens offline in any browser."""

from __future__ import annotations

from collections.abc import Sequence
from platform import python_version
from typing import TYPE_CHECKING

import numba
import numpy
import scipy
from markupsafe import Markup

from brightgrey.kit import Placed, Structure
from brightgrey.kit.in_words import effects_in_words, structure_in_words
from brightgrey.model.model import Model
from brightgrey.model.ranking import Row
from brightgrey.numerics.number_format import significant
from brightgrey.report.command import command
from brightgrey.report.content import Content
from brightgrey.report.drawing import svg
from brightgrey.report.drawing.plotly_figure import library, plot, script
from brightgrey.report.options import REPORT_OPTIONS
from brightgrey.report.templates import page_template
from brightgrey.report.text.commissioning_sheet import commissioning_sheet
from brightgrey.report.text.headline import beside_minimal, headline
from brightgrey.report.text.next_steps import next_steps, why_not_richer
from brightgrey.report.text.opinion_table import opinion_rows, opinion_sentences
from brightgrey.report.text.prose import left_out_in_words, listing, sentence, with_meanings
from brightgrey.report.text.tables import differing_values, fit_rows, friction_width_text, parameter_rows, remarks

if TYPE_CHECKING:
    from brightgrey.search.genetic import Run

__all__ = ["page"]


def page(content: Content) -> str:
    """Text of report.html.

    Parameters
    ----------
    content : Content
        Sections that do not apply to it are left out.

    Returns
    -------
    str
        The same content gives the same text. The page loads nothing when it is opened.
    """
    model, charts = content.model, content.charts
    rows = parameter_rows(model)
    return page_template("report.html.j2").render(
        content=content,
        model=model,
        words=structure_in_words(model.structure),
        headline=headline(content),
        drawing=Markup(model.drawing().html()),
        outcome=sentence(with_meanings(model.outcome.text, model.structure)),
        steps=next_steps(content),
        remarks=remarks(model),
        charts=charts,
        plots=Markup(script({f"{n}-{i}": plot(c) for n, cs in charts.items() for i, c in enumerate(cs)})),
        library=Markup(library()),
        parameters=rows,
        differing=differing_values(model),
        bars=[Markup(bar) for bar in _range_bars(model)],
        noted=any(row.note for row in rows),
        fits=fit_rows(model),
        criterion=significant(model.criterion.value, 6) if model.criterion else "",
        sheet=commissioning_sheet(content.assembled, content.correlation),
        opinions=opinion_rows(model, content.second_opinion),
        opinion=opinion_sentences(content.second_opinion),
        richer=why_not_richer(content),
        minimal=[(n, left_out_in_words(model.ties.left_out.get(n, ()))) for n in model.ties.minimal]
        if model.ties
        else [],
        beside_minimal=beside_minimal(model),
        optional=_optional_text(model),
        cards=content.evidence.cards if content.evidence else (),
        ranking=_ranking_cells(content.ranking),
        settings=_setting_rows(model),
        command=command(content),
        family=Markup(svg.family(content.run)) if content.run else "",
        trees=_trees(content.run) if content.run else [],
    )


def _optional_text(model: Model) -> str:
    """Sentence on effects that the recording would not show: those that no minimal structure has."""
    if model.ties is None:
        return ""
    fitted = {p for name in model.ties.minimal for p in Structure.parse(name).placed} | model.structure.beside
    others = [p for p in map(Placed.parse, model.ties.optional) if p not in fitted]
    return listing("The recording would not show it if the drive had", effects_in_words(others, "or"), "or")


def _range_bars(model: Model) -> list[str]:
    return [
        svg.range_bar(model.parameters[name], model.settings.bounds.get(name), log=declared.scale == "log")
        for name, declared in model.structure.parameters.items()
    ]


def _ranking_cells(ranking: Sequence[Row]) -> list[tuple[str, str, str, str, str, str]]:
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
        for rank, row in enumerate(ranking[: REPORT_OPTIONS.ranked], 1)
    ]


def _trees(run: Run) -> list[tuple[str, list[tuple[str, Markup]]]]:
    """Individuals of the first and the last generation, the best first: title of the generation, title and drawing."""
    out = []
    for number in dict.fromkeys((0, run.generations - 1)):
        best = sorted(run.generation(number), key=lambda e: -e.value)[: REPORT_OPTIONS.trees]
        drawn = [
            (f"{e.individual + 1}: criterion {significant(e.value, 5)}, {e.operator}", Markup(svg.tree(e.tree)))
            for e in best
        ]
        out.append((f"Generation {number}", drawn))
    return out


def _setting_rows(model: Model) -> list[tuple[str, str]]:
    s = model.settings
    rows = [
        *([("reversal of friction", friction_width_text(s))] if model.structure.has_dry_friction else []),
        ("sampling time", f"{s.sampling_time:.6g} s"),
        ("input between samples", {"linear": "interpolated linearly", "zoh": "held"}[s.hold]),
        ("integration level", s.level),
    ]
    for initial in model.initial_state:
        state = ", ".join(f"{name} = {significant(v.value)} {v.unit}" for name, v in initial.state.items())
        rows.append((f"initial state, {initial.recording}", state))
    return [*rows, ("seed", str(model.seed)), ("brightgrey", model.version), ("software", _versions())]


def _versions() -> str:
    libraries = (numpy, scipy, numba)
    return ", ".join((f"Python {python_version()}", *(f"{m.__name__} {m.__version__}" for m in libraries)))
