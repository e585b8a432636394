"""Options of the optimisation algorithms: tolerances, budgets and heuristics, in one place."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = [
    "LM_DEFAULTS",
    "MULTISTART_DEFAULTS",
    "PATTERN_SEARCH_DEFAULTS",
    "START_POINT_DEFAULTS",
    "LMOptions",
    "MultistartOptions",
    "PatternSearchOptions",
    "RacingOptions",
    "StartPointOptions",
]


@dataclass(frozen=True)
class RacingOptions:
    """Rules by which one of many starts is stopped because another one is better.

    Attributes
    ----------
    first_round : int
        Rounds before a start may be stopped because it would never reach the best cost.
    patience : int
        Rounds before a start may be stopped because it would not reach the best cost soon.
    observed_rounds : int
        Last rounds from which the rate of descent is extrapolated.
    horizon : int
        Rounds within which a start has to reach the best cost at that rate.
    comparison_interval : int
        Rounds from one comparison of the starts' positions to the next.
    same_cost : float
        Starts whose costs differ by less than this part may have met.
    same_place : float
        Starts have met if the step between them raises the cost by less than this part.
    """

    first_round: int = 4
    patience: int = 8
    observed_rounds: int = 4
    horizon: int = 10
    comparison_interval: int = 4
    same_cost: float = 1e-2
    same_place: float = 1e-3


@dataclass(frozen=True)
class LMOptions:
    """Levenberg-Marquardt: finite differences, damping, step limits and convergence.

    Attributes
    ----------
    difference_step : float
        Step of the forward differences in the scaled space.
    initial_damping : float
        Damping of the first round.
    damping_factors : tuple of float
        Factors of the last damping that are tried in each round, ascending.
    min_damping, max_damping : float
    scale_decay : float
        Factor per round by which the scale of the damping may fall where the curvature has become smaller.
    max_log_step, max_linear_step : float
        Longest step of a parameter: e^2 times for logarithmic ones, half of the range for linear ones.
    probe_damping : float
        Damping of the step that predicts the largest possible decrease of the cost.
    negligible_decrease : float
        Predicted decrease of the probe step, as part of the tolerance, that is not worth a simulation.
    negligible_damped_decrease : float
        The same for the damped steps; at bounds, the least damped step may be a bad one.
    quiet_rounds : int
        Rounds in succession with a decrease below the tolerance after which a start has converged.
    final_tolerance : float
        Relative decrease of the cost at which the final fit has converged.
    active_set_passes : int
        Passes in which parameters that hit a bound are held and the others solved for again.
    min_relative_curvature : float
        Parameters with less than this part of the largest curvature are damped as if they had so much.
    racing : RacingOptions
    """

    difference_step: float = 1e-6
    initial_damping: float = 1e-2
    damping_factors: tuple[float, ...] = (0.03, 0.3, 3.0, 30.0)
    min_damping: float = 1e-9
    max_damping: float = 1e12
    scale_decay: float = 0.5
    max_log_step: float = 2.0
    max_linear_step: float = 0.5
    probe_damping: float = 1e-6
    negligible_decrease: float = 0.1
    negligible_damped_decrease: float = 3.0
    quiet_rounds: int = 2
    final_tolerance: float = 1e-7
    active_set_passes: int = 3
    min_relative_curvature: float = 1e-12
    racing: RacingOptions = RacingOptions()


@dataclass(frozen=True)
class StartPointOptions:
    """Choice and generation of start points.

    Attributes
    ----------
    min_distance : float
        Least distance of chosen candidates, relative to the median distance of all.
    shifts : tuple of float
        Standard deviations, in the scaled space, by which perturbed starts differ from their parent.
    linear_shift : float
        Factor of these for linear parameters.
    redrawn : tuple of int
        Numbers of parameters of a perturbed start that are sampled anew, beside half of them.
    exchanged_share : float
        Share of the perturbed starts in which the parts of the drive exchange their roles.
    scan_simulations : int
        Simulations of a resonance scan.
    scan_neighbours : int
        Half frequency lines to both sides among which a resonance has to be the best.
    """

    min_distance: float = 0.5
    shifts: tuple[float, ...] = (0.0, 0.05, 0.3)
    linear_shift: float = 0.2
    redrawn: tuple[int, ...] = (1, 2, 3)
    exchanged_share: float = 0.3
    scan_simulations: int = 1024
    scan_neighbours: int = 2


@dataclass(frozen=True)
class MultistartOptions:
    """Search for the global optimum by batches of starts.

    Attributes
    ----------
    candidates_per_parameter : int
        Simulated candidates per parameter, and as many more, from which the starts of a batch are chosen.
    first_rounds, stage_rounds, rounds : int
        Largest number of rounds of a descent: on the first stage, on each further stage, on the whole problem.
    stage_tolerance : float
        Relative decrease of the cost at which a descent on a stage has converged.
    first_share : float
        Part of the excitation on which descents begin; with hard limits, the largest such part.
    min_share : float
        With hard limits, the part is drawn from between this and `first_share`, because no one part is best for all.
    share_growth : float
        With hard limits, the factor by which that part grows from stage to stage.
    shares : tuple of float or None
        Without hard limits, the part of one batch after the other; None stands for output feedback.
    feedback_shares : tuple of float
        Relative gains of the output feedback, from stage to stage.
    parents : int
        Best optima that are perturbed.
    peak_starts, tuning_rounds : int
        Starts with a resonance at a peak of the residual, and rounds after which the best of them are chosen.
    scan_starts, scan_kept : int
        Starts by a resonance scan, and those of them that are descended from.
    scan_interval : int
        Batches without improvement from one resonance scan to the next; the first comes after one.
    agreeing : int
        Independent starts that have to reach the best optimum.
    agreement_patience : float
        Part of the patience after which a white residual ends the search although starts do not agree.
    max_batches : int
        Largest number of batches per unit of patience.
    hard_limit_patience : float
        Factor of the patience with hard limits.
    improvement : float
        Part of the least cost below which a cost counts as an improvement.
    start_points : StartPointOptions
    """

    candidates_per_parameter: int = 16
    first_rounds: int = 20
    stage_rounds: int = 6
    rounds: int = 40
    stage_tolerance: float = 1e-3
    first_share: float = 0.3
    min_share: float = 0.05
    share_growth: float = 1.15
    shares: tuple[float | None, ...] = (0.3, None, 1.0, 0.6)
    feedback_shares: tuple[float, ...] = (3.0, 1.0, 0.3, 0.1, 0.03)
    parents: int = 4
    peak_starts: int = 48
    tuning_rounds: int = 3
    scan_starts: int = 16
    scan_kept: int = 2
    scan_interval: int = 4
    agreeing: int = 2
    agreement_patience: float = 0.25
    max_batches: int = 4
    hard_limit_patience: float = 1.5
    improvement: float = 0.995
    start_points: StartPointOptions = StartPointOptions()


@dataclass(frozen=True)
class PatternSearchOptions:
    """Pattern search: mesh, moves and limits.

    Attributes
    ----------
    max_iterations : int
        Largest number of polls; the paper's limit (section 4).
    first_mesh : float
        First mesh, as part of the range: the poll reaches half way from the middle to the bounds.
    last_mesh : float
        Mesh at which the search has converged.
    max_mesh : float
        Largest mesh; a longer step leaves the range from anywhere.
    expansion, contraction : float
        Factors of the mesh after successes and after a failure.
    successes : int
        Successes in succession after which the mesh grows; growing after each would fail every other poll.
    moves : tuple of int
        Numbers of last successes whose joint step is tried once more.
    block : int
        Points that are evaluated at once: as many as are simulated side by side.
    stall_decrease : float
        Relative decrease of the cost that `stall_polls` polls have to achieve.
    """

    max_iterations: int = 500
    first_mesh: float = 0.25
    last_mesh: float = 1e-6
    max_mesh: float = 1.0
    expansion: float = 2.0
    contraction: float = 0.5
    successes: int = 2
    moves: tuple[int, ...] = (2, 4, 8, 16)
    block: int = 16
    stall_decrease: float = 0.01


LM_DEFAULTS = LMOptions()
MULTISTART_DEFAULTS = MultistartOptions()
PATTERN_SEARCH_DEFAULTS = PatternSearchOptions()
START_POINT_DEFAULTS = StartPointOptions()
