"""Tuned numbers of the structure search: statistical levels, budgets and heuristics, each with its meaning."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["BUDGET", "REFIT", "SELECTION", "RefitPolicy", "SearchBudget", "SelectionPolicy"]


@dataclass(frozen=True)
class SelectionPolicy:
    """Statistical levels and material sizes by which structures are compared.

    Attributes
    ----------
    false_alarm_level : float
        Probability of calling for an effect that is not there.
    screening_level : float
        Probability that chance explains the lead of a structure that is not examined any more.
    mass_multiplicity : float
        A further mass wins by chance this many times as often as Wilks's theorem says: its resonance may be anywhere.
    min_rss_ratio : float
        Ratio of sums of squares below which a difference does not matter, however significant it is.
    min_power : float
        Power of the likelihood-ratio test from which a recording is said to show an effect.
    notable_gain : float
        Part of the residual's RMS that an effect may explain at most and still be *not needed*.
    reported_loss : float
        Relative growth of the residual's RMS from which it is reported as a number.
    zero_share : float
        Part of a size that matters below which an estimate is reported as zero.
    slow_share : float
        Independent samples over all samples below which residuals are called slow.
    rounding_quantile : float
        Quantile of the normal distribution: rounding leaves more than the floor in 5 % of the recordings.
    bound_slack : float
        Part of a range within which a value counts as within its bound.
    """

    false_alarm_level: float = 0.02
    screening_level: float = 1e-3
    mass_multiplicity: float = 10.0
    min_rss_ratio: float = 1.01
    min_power: float = 0.8
    notable_gain: float = 0.02
    reported_loss: float = 0.005
    zero_share: float = 0.01
    slow_share: float = 0.5
    rounding_quantile: float = 1.645
    bound_slack: float = 1e-6


@dataclass(frozen=True)
class SearchBudget:
    """Effort of a search: the number of structures that are examined, and of restarts.

    Attributes
    ----------
    max_examined : int
        Structures that are examined for being minimal.
    always_examined : float
        Ratio of costs to the least one within which a structure is always examined.
    side_by_side : int
        Refits that are made in parallel; those behind the first successful one are wasted.
    restarts, restarts_costly : int
        Multistarts of a structure before an effect beyond it is called for. The smaller number holds for a structure
        with a hard limit and before a further mass that explains much.
    max_fruitless_restarts : int
        Multistarts without success, of any structures, after which no more are made.
    small_difference : float
        Ratio of sums of squares up to which another optimum may explain the difference.
    leading_mass_chains : int
        Numbers of masses whose leading structures are restarted.
    max_rounds : int
        Rounds of restarts of leading structures.
    fruitless_rounds : int
        Rounds without a hard limit that bring nothing, after which they end.
    fruitless_share : float
        Part of all simulated samples that rounds with a hard limit may take without a gain.
    round_gain : float
        Ratio of costs that counts as a gain of such a round; coloured noise always offers another per mille.
    misfits_per_call : int
        Misfits that one call to a worker computes; a single simulation is not worth sending.
    """

    max_examined: int = 24
    always_examined: float = 1.02
    side_by_side: int = 2
    restarts: int = 8
    restarts_costly: int = 2
    max_fruitless_restarts: int = 16
    small_difference: float = 1.1
    leading_mass_chains: int = 2
    max_rounds: int = 12
    fruitless_rounds: int = 2
    fruitless_share: float = 0.6
    round_gain: float = 0.99
    misfits_per_call: int = 32


@dataclass(frozen=True)
class RefitPolicy:
    """Heuristics of refits from neighbouring structures: ratios are those of costs.

    Attributes
    ----------
    improved : float
        A fit counts as better below this ratio.
    clear_gain : float
        A supermodel, or a hard limit, is followed up below this ratio.
    cutoff : float
        Structures above this multiple of the least cost are far behind.
    keeps_up : float
        A submodel is given up where, on part of the recording, it costs more than this multiple of its supermodel.
    narrow_range : float
        Ratio of upper to lower bound up to which a range counts as narrow.
    neighbour_starts : int
        Starts that a refit takes over from neighbours.
    random_starts : int
        Random values of missing parameters for each of them.
    descents : int
        Best starts that are descended from.
    iterations, tolerance : int, float
        Limit of a descent, and its relative tolerance.
    polish_tolerance : float
        Relative tolerance of the last descent: far below chance, which N samples put at 1/N.
    polish_below : float
        Multiple of the cost to beat below which the last descent may still win.
    compared_below : float
        Multiple of the cost to beat up to which a fit at a fixed size is made exact.
    path_steps : tuple of int
        Steps in which a fixed size is approached where a hard limit makes the cost rugged.
    first_restart_seed : int
        Offset of the seeds of restarts from those of the search.
    """

    improved: float = 0.999
    clear_gain: float = 0.9
    cutoff: float = 4.0
    keeps_up: float = 4.0
    narrow_range: float = 10.0
    neighbour_starts: int = 6
    random_starts: int = 8
    descents: int = 3
    iterations: int = 30
    tolerance: float = 1e-4
    polish_tolerance: float = 1e-5
    polish_below: float = 1.05
    compared_below: float = 2.0
    path_steps: tuple[int, ...] = (2, 4)
    first_restart_seed: int = 1000


SELECTION = SelectionPolicy()
BUDGET = SearchBudget()
REFIT = RefitPolicy()
