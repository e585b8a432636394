"""Content of a report, and the figures that follow from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from brightgrey.estimation.diagnostics.second_opinion import TermOpinion
from brightgrey.model.model import Model
from brightgrey.model.ranking import Row
from brightgrey.model.trace import Trace
from brightgrey.recordings.checks.check import CheckResult
from brightgrey.report.charts.backlash import gap_charts
from brightgrey.report.charts.chart import Chart
from brightgrey.report.charts.comparison import comparisons, correlations
from brightgrey.report.charts.frequency_response import response_chart
from brightgrey.report.charts.friction import friction_charts
from brightgrey.report.charts.position_torque import position_torque_charts
from brightgrey.report.charts.search_progress import front_chart, history_chart
from brightgrey.report.quantities.assembled_model import AssembledModel

if TYPE_CHECKING:
    from brightgrey.search.evidence import Evidence
    from brightgrey.search.genetic import Run

__all__ = ["Content"]


@dataclass(frozen=True)
class Content:
    """Content of a report. Only the model is needed; sections that do not apply are left out."""

    model: Model  #: Every number of the report is one of the model's, or follows from them.
    traces: Sequence[Trace] = ()  #: Recordings with their simulation by the model.
    notes: Sequence[str] = ()  #: Repairs of the recordings and assumptions about them.
    evidence: Evidence | None = None  #: Of a search: a verdict on every effect.
    ranking: Sequence[Row] = ()  #: Structures that were tried, best first.
    #: Of the errors of the estimates; positive parameters count by their logarithm.
    correlation: Mapping[tuple[str, str], float] = field(default_factory=dict)
    run: Run | None = None  #: Of a genetic search.
    request: str = ""  #: Command that gives this result again.
    #: Symptoms in the residuals, with advice: objects with texts ``title``, ``seen`` and ``advice``.
    symptoms: Sequence[Any] = ()
    #: Quantities for control that differ between tied structures: objects with ``structure`` and ``rows`` of (name,
    #: value).
    differences: Sequence[Any] = ()
    checks: Sequence[CheckResult] = ()  #: Of the recordings, the gravest first.
    second_opinion: Sequence[TermOpinion] = ()  #: Balance of torques without a simulation.
    stopped: bool = False  #: The search was stopped before its end.

    @cached_property
    def assembled(self) -> AssembledModel:
        """Model with its system and its linear model, made once for all figures and tables."""
        return AssembledModel(self.model)

    @cached_property
    def charts(self) -> Mapping[str, tuple[Chart, ...]]:
        """Figures by name; only those that apply."""
        train = [trace for trace in self.traces if not trace.test]
        every = {
            "comparison": comparisons(self.traces),
            "residuals": correlations(self.traces),
            "friction": friction_charts(self.assembled, self.correlation),
            "frequency": response_chart(self.assembled, train),
            "backlash": gap_charts(self.assembled, train),
            "position": position_torque_charts(self.assembled, train),
            "pareto": front_chart(self.ranking, str(self.model.structure)),
            "history": history_chart(self.run),
        }
        return {name: charts for name, charts in every.items() if charts}
