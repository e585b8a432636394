"""Options of the report: how much of everything it shows."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["REPORT_OPTIONS", "ReportOptions"]


@dataclass(frozen=True)
class ReportOptions:
    """Sizes of tables and figures, and thresholds of the measured frequency response."""

    ranked: int = 10  #: Structures in the table of the ranking.
    trees: int = 6  #: Individuals of a generation that are drawn as trees.
    generations: int = 12  #: Generations in the family of the best individual.
    line_points: int = 3000  #: Points of one line of a figure at most: more than any page has pixels across.
    page_points: int = 24_000  #: Points of all comparisons together, a matter of the size of the page.
    min_line_points: int = 300  #: Points of a line of a comparison at least.
    friction_points: int = 401  #: Speeds at which friction is drawn.
    friction_draws: int = 400  #: Parameter sets from which the band of the friction is made.
    bode_points: int = 600  #: Frequencies at which a frequency response is drawn, beside those around its resonances.
    mode_points: int = 40  #: Frequencies around a resonance; an even number.
    min_damping: float = 1e-3  #: Damping ratio that a resonance counts with at least, for these frequencies.
    speed_share: float = 0.5  #: Speed at which the model is linearised, over the largest speed of the recording.
    #: Segments of half overlap in Welch's method. Nine keep the coherence of independent signals below 0.4.
    welch_segments: int = 9
    min_segment: int = 64  #: Samples of a segment at least.
    min_coherence: float = 0.8  #: Coherence above which the measured response is shown.
    min_p: float = 1e-3  #: Probability below which only that is said.
    listed_parameters: int = 2  #: Parameters in one piece of advice; more are found in their table.
    #: Largest value over the least one of a logarithmic axis that has ticks at 2 and 5 as well.
    few_decades: float = 100.0
    min_front: int = 3  #: Structures that make a Pareto front.


REPORT_OPTIONS = ReportOptions()
