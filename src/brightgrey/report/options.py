"""Options of the report: how much of everything it shows."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["REPORT_OPTIONS", "ReportOptions"]


@dataclass(frozen=True)
class ReportOptions:
    """Sizes of tables and figures, and thresholds of the measured frequency response.

    Attributes
    ----------
    ranked : int
        Structures in the table of the ranking.
    trees : int
        Individuals of a generation that are drawn as trees.
    generations : int
        Generations in the family of the best individual.
    line_points : int
        Points of one line of a figure at most: more than any page has pixels across.
    page_points : int
        Points of all comparisons together, a matter of the size of the page.
    min_line_points : int
        Points of a line of a comparison at least.
    friction_points : int
        Speeds at which friction is drawn.
    friction_draws : int
        Parameter sets from which the band of the friction is made.
    bode_points : int
        Frequencies at which a frequency response is drawn, beside those around its resonances.
    speed_share : float
        Speed at which the model is linearised, over the largest speed of the recording.
    welch_segments : int
        Segments of half overlap in Welch's method. Nine keep the coherence of independent signals below 0.4.
    min_segment : int
        Samples of a segment at least.
    min_coherence : float
        Coherence above which the measured response is shown.
    min_front : int
        Structures that make a Pareto front.
    """

    ranked: int = 10
    trees: int = 6
    generations: int = 12
    line_points: int = 3000
    page_points: int = 24_000
    min_line_points: int = 300
    friction_points: int = 401
    friction_draws: int = 400
    bode_points: int = 600
    speed_share: float = 0.5
    welch_segments: int = 9
    min_segment: int = 64
    min_coherence: float = 0.8
    min_front: int = 3


REPORT_OPTIONS = ReportOptions()
