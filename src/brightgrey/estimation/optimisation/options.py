"""Options of the optimisation algorithms: tolerances, budgets and heuristics, in one place."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = [
    "FIT_DEFAULTS",
    "LM_DEFAULTS",
    "MULTISTART_DEFAULTS",
    "PATTERN_SEARCH_DEFAULTS",
    "START_POINT_DEFAULTS",
    "TORQUE_REGRESSION_DEFAULTS",
    "FitOptions",
    "LMOptions",
    "MultistartOptions",
    "PatternSearchOptions",
    "RacingOptions",
    "StartPointOptions",
    "TorqueRegressionOptions",
]


@dataclass(frozen=True)
class RacingOptions:
    """Rules by which one of many starts is stopped because another one is better."""

    first_round: int = 4  #: Rounds before a start may be stopped because it would never reach the best cost.
    patience: int = 8  #: Rounds before a start may be stopped because it would not reach the best cost soon.
    observed_rounds: int = 4  #: Last rounds from which the rate of descent is extrapolated.
    horizon: int = 10  #: Rounds within which a start has to reach the best cost at that rate.
    comparison_interval: int = 4  #: Rounds from one comparison of the starts' positions to the next.
    same_cost: float = 1e-2  #: Starts whose costs differ by less than this part may have met.
    same_place: float = 1e-3  #: Starts have met if the step between them raises the cost by less than this part.


@dataclass(frozen=True)
class LMOptions:
    """Levenberg-Marquardt: finite differences, damping, step limits and convergence."""

    difference_step: float = 1e-6  #: Step of the forward differences in the scaled space.
    initial_damping: float = 1e-2  #: Damping of the first round.
    #: Factors of the last damping that are tried in each round, ascending.
    damping_factors: tuple[float, ...] = (0.03, 0.3, 3.0, 30.0)
    min_damping: float = 1e-9
    max_damping: float = 1e12
    #: Factor per round by which the scale of the damping may fall where the curvature has become smaller.
    scale_decay: float = 0.5
    #: Longest step of a parameter: e^2 times for logarithmic ones, half of the range for linear ones.
    max_log_step: float = 2.0
    max_linear_step: float = 0.5
    probe_damping: float = 1e-6  #: Damping of the step that predicts the largest possible decrease of the cost.
    #: Predicted decrease of the probe step, as part of the tolerance, that is not worth a simulation.
    negligible_decrease: float = 0.1
    #: The same for the damped steps; at bounds, the least damped step may be a bad one.
    negligible_damped_decrease: float = 3.0
    #: Rounds in succession with a decrease below the tolerance after which a start has converged.
    quiet_rounds: int = 2
    final_tolerance: float = 1e-7  #: Relative decrease of the cost at which the final fit has converged.
    active_set_passes: int = 3  #: Passes in which parameters that hit a bound are held and the others solved for again.
    #: Parameters with less than this part of the largest curvature are damped as if they had so much.
    min_relative_curvature: float = 1e-12
    racing: RacingOptions = RacingOptions()


@dataclass(frozen=True)
class StartPointOptions:
    """Choice and generation of start points."""

    min_distance: float = 0.5  #: Least distance of chosen candidates, relative to the median distance of all.
    #: Standard deviations, in the scaled space, by which perturbed starts differ from their parent.
    shifts: tuple[float, ...] = (0.0, 0.05, 0.3)
    linear_shift: float = 0.2  #: Factor of these for linear parameters.
    #: Numbers of parameters of a perturbed start that are sampled anew, beside half of them.
    redrawn: tuple[int, ...] = (1, 2, 3)
    redrawn_torques: float = 0.3  #: Share of the perturbed starts in which all torques at the masses are sampled anew.
    exchanged_share: float = 0.3  #: Share of the perturbed starts in which the parts of the drive exchange their roles.
    scan_simulations: int = 1024  #: Simulations of a resonance scan.
    scan_neighbours: int = 2  #: Half frequency lines to both sides among which a resonance has to be the best.


@dataclass(frozen=True)
class TorqueRegressionOptions:
    """Regression of the torques that gives the sizes of starts."""

    #: Width of the kernel over the period of the slowest resonance, whose amplitude it lowers to less than 1 %.
    smoothing: float = 0.5
    rows: int = 200  #: Rows per recording that are enough for a handful of terms.
    least_torque: float = 0.01  #: Of a positive size, over the RMS of the input: none begins at zero.
    wave_rows: int = 1000  #: Rows per recording for the spectrum over the position,
    wave_step: float = 0.25  #: its step in periods over the travel,
    waves: int = 3  #: its highest peaks that starts take in turn, if they explain
    wave_share: float = 0.5  #: so much of what the highest explains,
    wave_block: int = 64  #: and the wave numbers that are computed at once.


@dataclass(frozen=True)
class MultistartOptions:
    """Search for the global optimum by batches of starts."""

    #: Simulated candidates per parameter, and as many more, from which the starts of a batch are chosen.
    candidates_per_parameter: int = 16
    #: Largest number of rounds of a descent: on the first stage, on each further stage, on the whole problem.
    first_rounds: int = 20
    stage_rounds: int = 6
    rounds: int = 40
    stage_tolerance: float = 1e-3  #: Relative decrease of the cost at which a descent on a stage has converged.
    #: Part of the excitation on which descents begin; with hard limits, the largest such part.
    first_share: float = 0.3
    #: With hard limits, the part is drawn from between this and `first_share`, because no one part is best for all.
    min_share: float = 0.05
    share_growth: float = 1.15  #: With hard limits, the factor by which that part grows from stage to stage.
    #: Without hard limits, the part of one batch after the other; None stands for output feedback.
    shares: tuple[float | None, ...] = (0.3, None, 1.0, 0.6)
    #: Relative gains of the output feedback, from stage to stage.
    feedback_shares: tuple[float, ...] = (3.0, 1.0, 0.3, 0.1, 0.03)
    parents: int = 4  #: Best optima that are perturbed.
    #: Starts with a resonance at a peak of the residual, and rounds after which the best of them are chosen.
    peak_starts: int = 48
    tuning_rounds: int = 3
    #: Starts by a resonance scan, and those of them that are descended from.
    scan_starts: int = 16
    scan_kept: int = 2
    #: Batches without improvement from one resonance scan to the next; the first comes after one.
    scan_interval: int = 4
    agreeing: int = 2  #: Independent starts that have to reach the best optimum.
    #: Part of the patience after which a white residual ends the search although starts do not agree.
    agreement_patience: float = 0.25
    max_batches: int = 4  #: Largest number of batches per unit of patience.
    hard_limit_patience: float = 1.5  #: Factor of the patience with hard limits.
    improvement: float = 0.995  #: Part of the least cost below which a cost counts as an improvement.
    start_points: StartPointOptions = StartPointOptions()
    balanced_share: float = 0.25  #: Further starts, per fresh one, whose sizes balance the torques of a rigid drive.


@dataclass(frozen=True)
class PatternSearchOptions:
    """Pattern search: mesh, moves and limits."""

    max_iterations: int = 500  #: Largest number of polls; the paper's limit (section 4).
    #: First mesh, as part of the range: the poll reaches half way from the middle to the bounds.
    first_mesh: float = 0.25
    last_mesh: float = 1e-6  #: Mesh at which the search has converged.
    max_mesh: float = 1.0  #: Largest mesh; a longer step leaves the range from anywhere.
    #: Factors of the mesh after successes and after a failure.
    expansion: float = 2.0
    contraction: float = 0.5
    #: Successes in succession after which the mesh grows; growing after each would fail every other poll.
    successes: int = 2
    moves: tuple[int, ...] = (2, 4, 8, 16)  #: Numbers of last successes whose joint step is tried once more.
    block: int = 16  #: Points that are evaluated at once: as many as are simulated side by side.
    stall_decrease: float = 0.01  #: Relative decrease of the cost that `stall_polls` polls have to achieve.


@dataclass(frozen=True)
class FitOptions:
    """Heuristics of a fit."""

    continued: int = 8  #: Largest number of optima on a part of the samples from which descents go on with all.
    #: Largest cost of these, relative to the least one; other samples of a drive change it by less.
    continued_cost: float = 1.1
    finalists: int = 2  #: Largest number of optima that are fitted again at the final level.
    #: Largest cost of these, relative to the least one; the ``fast`` level is off by about so much.
    finalist_cost: float = 1.01
    finalist_distance: float = 0.1  #: Least distance between these in the scaled space.


FIT_DEFAULTS = FitOptions()
LM_DEFAULTS = LMOptions()
MULTISTART_DEFAULTS = MultistartOptions()
PATTERN_SEARCH_DEFAULTS = PatternSearchOptions()
START_POINT_DEFAULTS = StartPointOptions()
TORQUE_REGRESSION_DEFAULTS = TorqueRegressionOptions()
