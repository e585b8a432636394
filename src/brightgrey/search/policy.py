"""Tuned numbers of the structure search: statistical levels, budgets and heuristics, each with its meaning."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = [
    "BORDER",
    "BUDGET",
    "FURTHER",
    "REFINEMENT",
    "REFIT",
    "SELECTION",
    "BorderPolicy",
    "FurtherEffectsPolicy",
    "RefinementPolicy",
    "RefitPolicy",
    "SearchBudget",
    "SelectionPolicy",
]


@dataclass(frozen=True)
class SelectionPolicy:
    """Statistical levels and material sizes by which structures are compared."""

    false_alarm_level: float = 0.02  #: Probability of calling for an effect that is not there.
    #: Frequencies at which a further mass may explain noise independently.
    resonances: int = 20
    #: Ratio of sums of squares below which a difference does not matter, however significant it is.
    min_rss_ratio: float = 1.005
    min_power: float = 0.8  #: Power of the likelihood-ratio test from which a recording is said to show an effect.
    #: Part of the residual's RMS that an effect may explain at most and still be *not needed*.
    notable_gain: float = 0.02
    reported_loss: float = 0.005  #: Relative growth of the residual's RMS from which it is reported as a number.
    zero_share: float = 0.01  #: Part of a size that matters below which an estimate is reported as zero.
    #: Quantile of the normal distribution: rounding leaves more than the floor in 5 % of the recordings.
    rounding_quantile: float = 1.645
    #: Ratio of the ends of a 95 % interval from which a parameter counts as unknown.
    wide_interval: float = 10.0
    #: Independent samples below which the colour of residuals is not known well: then a mass or gap also has to pass
    #: an F test with so few. Model error may pass for noise there.
    few_samples: float = 50.0
    blocks: int = 8  #: Parts in time in which a gain is asked for where the residual holds something unexplained.
    steady_blocks: int = 6  #: Least number of them in which an effect that is needed helps.
    #: Recordings from which each is predicted by a model of the others: one of a single recording has seen too little.
    least_recordings: int = 3
    bound_slack: float = 1e-6  #: Part of a range within which a value counts as within its bound.


@dataclass(frozen=True)
class SearchBudget:
    """Effort of the search for optima that were missed where all structures are fitted."""

    leading_mass_chains: int = 2  #: Numbers of masses whose leading structures are restarted.
    max_rounds: int = 12  #: Rounds of restarts of leading structures.
    fruitless_rounds: int = 2  #: Rounds without a hard limit that bring nothing, after which they end.
    #: Part of all simulated samples that rounds with a hard limit may take without a gain.
    fruitless_share: float = 0.6
    #: Ratio of costs that counts as a gain of such a round; coloured noise always offers another per mille.
    round_gain: float = 0.99


@dataclass(frozen=True)
class RefitPolicy:
    """Heuristics of refits from neighbouring structures: ratios are those of costs."""

    improved: float = 0.999  #: A fit counts as better below this ratio.
    clear_gain: float = 0.9  #: A supermodel, or a hard limit, is followed up below this ratio.
    cutoff: float = 4.0  #: Structures above this multiple of the least cost are far behind.
    #: A submodel is given up where, on part of the recording, it costs more than this multiple of its supermodel.
    keeps_up: float = 4.0
    vanished: float = 100.0  #: Multiple of its lower bound up to which a size has all but vanished.
    narrow_range: float = 10.0  #: Ratio of upper to lower bound up to which a range counts as narrow.
    #: Limit of a descent, and its relative tolerance.
    iterations: int = 30
    tolerance: float = 1e-4
    #: Relative tolerance of the last descent: far below chance, which N samples put at 1/N.
    polish_tolerance: float = 1e-5
    compared_below: float = 2.0  #: Multiple of the cost to beat up to which fits are compared exactly, whitened.
    #: Steps in which a fixed size is approached where a hard limit makes the cost rugged.
    path_steps: tuple[int, ...] = (2, 4)


@dataclass(frozen=True)
class RefinementPolicy:
    """Last descent of a fit, in its whitened cost: noise has variance 1 there."""

    iterations: int = 100  #: Most rounds; few descents take more than ten, but after ten some were far beyond chance.
    #: Number of the damping factor that is tried alone near an optimum, with derivatives at once, and the part of its
    #: predicted decrease with which no other is tried.
    first_factor: int = 1
    predicted: float = 0.5
    negligible: float = 0.05  #: Predicted decrease that is not worth a step: far below what chance does.
    relative: float = 1e-6  #: The same as part of the cost,
    of_material: float = 1.0 / 20.0  #: and as part of a growth of it that does not matter.


@dataclass(frozen=True)
class BorderPolicy:
    """Effort of the search for the border."""

    rounds: int = 3  #: Rounds, each with a noise model of its own.
    agreeing: int = 3  #: Independent starts that have to end at the best optimum of a refuted structure.
    restarts: int = 2  #: Multistarts for that, of one structure.
    restarts_costly: int = 1  #: With a hard limit, or where the excess is far above its threshold.
    restarts_unconfirmed: int = 4  #: Where no independent start has ended at that optimum yet.
    #: Multiple of its threshold up to which an excess has to be confirmed by an independent start. In bench/recovery.py
    #: 10 of 44 effects were not there whose excess was less and not confirmed, and 1 of 191 with more.
    sure: float = 16.0
    patience: int = 2  #: Batches without improvement after which a patient multistart ends.
    far: float = 4.0  #: Multiple of the largest threshold above which an excess is far above it.
    side_by_side: int = 2  #: Largest undecided structures that are fitted in parallel.
    fields: int = 2  #: Parts of a multistart that are made in parallel.
    max_fits: int = 150  #: Structures that are fitted at most.
    max_fits_with_model_error: int = 80  #: The same where no structure is the truth.


@dataclass(frozen=True)
class FurtherEffectsPolicy:
    """Offer of effects that a function set holds back until they are called for."""

    notable_gain: float = 0.04  #: Least part of a structure's sum of squared residuals that a further effect explains.
    #: NRMSE fit in percent below which a fit is poor: noise of sensors leaves less than a twentieth of a motion.
    poor_fit: float = 95.0
    side_by_side: int = 6  #: Effects that are fitted beside a structure, those with the largest scores.
    alike: float = 0.5  #: Ratio of gains from which the effect with fewer parameters is taken.
    #: Least part of what a structure leaves beyond the best one that further effects have to explain when fitted.
    rescued_share: float = 1.0 / 3.0
    at_once: int = 4  #: Effects that are offered at a time; more follow if these leave something.
    most: int = 6  #: Effects that are offered in all.
    exchanged: int = 3  #: Effects that are fitted in the place of one, those that promise most.
    #: Part of what an effect explains from which one that is as simple is fitted in its place, whatever else it leaves.
    imitated_share: float = 0.5
    #: Part of what an effect explains from which several others together are fitted in its place.
    shared_out: float = 0.9
    named: int = 4  #: Effects that are named where one of several is needed.
    most_rivals: int = 12  #: Structures beyond the lattice after which no more are looked for.
    draws: int = 15  #: Values that are tried for the further parameters of an effect.


SELECTION = SelectionPolicy()
REFINEMENT = RefinementPolicy()
BORDER = BorderPolicy()
FURTHER = FurtherEffectsPolicy()
BUDGET = SearchBudget()
REFIT = RefitPolicy()
