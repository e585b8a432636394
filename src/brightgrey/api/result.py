"""What an identification has found, with its files, figures and report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from brightgrey.arguments import checked_arguments
from brightgrey.drawing.picture import DriveDrawing
from brightgrey.errors import SettingsError, unknown_name
from brightgrey.estimation import Fit, Profile
from brightgrey.estimation.diagnostics.symptoms import Symptom
from brightgrey.estimation.noise.residual_analysis import LAGS, Residuals, residual_analysis
from brightgrey.model.files import check_folder, write_files
from brightgrey.model.model import Model
from brightgrey.model.ranking import Row, front, ranking_csv
from brightgrey.model.run_record import RUN_FILE, RunRecord
from brightgrey.model.trace import Trace
from brightgrey.recordings import Recording
from brightgrey.recordings.checks.checkup import Checkup
from brightgrey.runs.blas_threads import one_blas_thread

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from brightgrey.api.differences import ControlDifference
    from brightgrey.report.content import Content
    from brightgrey.search.evidence import Evidence
    from brightgrey.search.genetic import Run

__all__ = ["Result"]


@dataclass(frozen=True)
class Result:
    """Result of :func:`identify`.

    Attributes
    ----------
    model : Model
        Structure, parameters with uncertainty, fit, outcome.
    traces : tuple of Trace
        The recordings beside the simulated outputs, the test recording last.
    ranking : tuple of Row
        Structures that were tried, best first.
    notes : tuple of str
        Repairs of the recordings, and assumptions about them.
    fit : Fit
        The estimation in detail: start points and where they ended, all in SI.
    evidence : Evidence or None
        After a search that is not genetic: the verdict on every effect, in words and numbers.
    files : mapping of str to bytes
        Further files that :meth:`write` puts beside the results.
    profiles : tuple of Profile
        Profile likelihoods that were asked for, in SI.
    run : Run or None
        After a genetic search: every individual of every generation.
    request : str
        Command that gives this result again; without one the report makes it from the model.
    differences : tuple of Difference
        If the search found equivalent structures: their differences for control, the best structure first.
    stopped : bool
        The search was stopped before its end; the result is the best one so far.
    checkup : Checkup
        What the checks say of the recordings.
    record : RunRecord or None
        Request and optima; :meth:`write` puts it beside the results as run.json.
    recordings : tuple of Recording
        Those that were fitted.
    """

    model: Model
    traces: tuple[Trace, ...] = field(repr=False)
    ranking: tuple[Row, ...]
    notes: tuple[str, ...]
    fit: Fit = field(repr=False)
    files: Mapping[str, bytes] = field(default_factory=dict, repr=False)
    profiles: tuple[Profile, ...] = field(default=(), repr=False)
    evidence: Evidence | None = field(default=None, repr=False)
    run: Run | None = field(default=None, repr=False)
    request: str = ""
    differences: tuple[ControlDifference, ...] = field(default=(), repr=False)
    stopped: bool = False
    checkup: Checkup = field(default=Checkup(()), repr=False)
    record: RunRecord | None = field(default=None, repr=False)
    recordings: tuple[Recording, ...] = field(default=(), repr=False)

    @property
    def symptoms(self) -> tuple[Symptom, ...]:
        """Signs of effects that the structure lacks, each with advice."""
        return self.fit.symptoms

    @property
    def front(self) -> tuple[Row, ...]:
        """Structures of the ranking that no other beats in error and number of parameters, few parameters first."""
        return front(self.ranking)

    def residuals(self) -> Mapping[tuple[str, str], Residuals]:
        """Correlations of the residuals with themselves and with the input, by recording and output.

        An output whose simulation diverged, or that has too few samples for 50 lags, is left out.
        """
        return {
            (trace.name, signal.name): residual_analysis(residual, trace.u)
            for trace in self.traces
            for signal, residual in zip(trace.outputs, trace.residual, strict=True)
            if np.isfinite(residual).all() and residual.size > 4 * LAGS
        }

    @cached_property
    def content(self) -> Content:
        """Everything that the report and the figures show."""
        from brightgrey.report.content import Content

        return Content(
            model=self.model,
            traces=self.traces,
            notes=self.notes,
            evidence=self.evidence,
            ranking=self.ranking,
            correlation=self.fit.correlation,
            run=self.run,
            request=self.request,
            symptoms=self.symptoms,
            differences=self.differences,
            checks=self.checkup.results,
            second_opinion=self.fit.second_opinion,
            stopped=self.stopped,
        )

    def plot(self, what: str = "comparison") -> Figure:
        """Draw one of the report's figures, for a notebook or a paper.

        Parameters
        ----------
        what : str
            ``comparison`` (measured against simulated, residual below), ``residuals`` (their correlations),
            ``friction``, ``frequency``, ``backlash``, ``pareto`` or ``history``: those that apply to the result.

        Returns
        -------
        matplotlib.figure.Figure
            ``figure.savefig("name.svg")`` writes it.

        Raises
        ------
        SettingsError
            If this result has no such figure; the message names those it has.
        """
        from brightgrey.report.drawing.matplotlib_figure import draw

        drawn = self.content.charts
        if what not in drawn:
            raise SettingsError(unknown_name("figure of this result", what, list(drawn)))
        return draw(drawn[what])

    def drawing(self) -> DriveDrawing:
        """Drawing of the drive that was found; see :meth:`Model.drawing`.

        Returns
        -------
        DriveDrawing
            A notebook shows it, ``drawing.save("drive.svg")`` writes it.
        """
        return self.model.drawing()

    def _repr_html_(self) -> str:
        from brightgrey.report.notebook import result_html

        return result_html(self.content)

    @checked_arguments
    @one_blas_thread()
    def write(self, folder: str | Path) -> None:
        """Write model.json, ranking.csv, report.html, fit.svg and run.json into `folder`, all or none.

        Parameters
        ----------
        folder : str or Path
            Made if it is not there; files of these names in it are replaced.

        Raises
        ------
        SettingsError
            If `folder` cannot be written to.
        """
        check_folder(folder)
        write_files(folder, self.contents())

    def contents(self) -> dict[str, bytes]:
        """Contents of the files that :meth:`write` writes, by name."""
        from brightgrey.report.drawing.svg_figure import svg_figure
        from brightgrey.report.page import page

        return {
            "report.html": page(self.content).encode(),
            "model.json": self.model.text().encode(),
            "ranking.csv": ranking_csv(self.ranking).encode(),
            "fit.svg": svg_figure(self.content.charts["comparison"]).encode(),
            **({RUN_FILE: self.record.text().encode()} if self.record else {}),
            **self.files,
        }

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the files that :meth:`write` writes."""
        return (
            "report.html",
            "model.json",
            "ranking.csv",
            "fit.svg",
            *((RUN_FILE,) if self.record else ()),
            *self.files,
        )
