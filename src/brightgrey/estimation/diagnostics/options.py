"""Levels, limits and heuristics of the diagnostics, in one place."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = [
    "DIAGNOSTIC_DEFAULTS",
    "EXCHANGE_DEFAULTS",
    "FAULT_DEFAULTS",
    "INFORMATIVITY_DEFAULTS",
    "PEAK_DEFAULTS",
    "REGRESSOR_DEFAULTS",
    "DiagnosticOptions",
    "ExchangeOptions",
    "FaultOptions",
    "InformativityOptions",
    "PeakOptions",
    "RegressorOptions",
]


@dataclass(frozen=True)
class InformativityOptions:
    """Tests of a recording for excitation, response and saturation, before any fit."""

    #: Standard deviation of a white input, relative to its mean, up to which it counts as constant.
    constant_input: float = 0.02
    white_input_level: float = 1e-5  #: Probability of taking white noise on the input for excitation.
    response_level: float = 1e-3  #: Probability of taking noise for a response to the input; a fit then finds out.
    blocks: tuple[int, ...] = (1, 4, 16, 32, 64)  #: Samples per block, whose means are tested for a response.
    #: Past blocks that predict the next one; the second where there are few blocks.
    past: int = 8
    short_past: int = 4
    blocks_per_past: int = 8  #: Blocks per past block that a test needs.
    #: A prediction error below this part of the range, over the root of the number of blocks, is motion by itself. A
    #: random walk has 0.3 to 1.
    smooth_motion: float = 0.2
    rounding_power: float = 1e-24  #: Part of the power below which a prediction error is rounding.
    stop_samples: int = 5  #: Equal samples at the largest value that make a stop.
    #: Least change per sample before or after a stop: in steps of the resolution, and relative to the usual change.
    stop_resolution: float = 3.0
    stop_change: float = 0.3
    #: Part of the samples from which an output is useless, and from which it is reported.
    mostly_saturated: float = 0.5
    partly_saturated: float = 0.02


@dataclass(frozen=True)
class ExchangeOptions:
    """Search for an equivalent model by exchanging a lag and a pole."""

    widening: float = 1e4  #: Factor by which parameters of the equivalent model may leave their range.
    log_step: float = 1e-5  #: Step of the logarithm for the powers with which a pole depends on parameters.
    #: Increase of the cost, in variances of a residual, that one parameter makes by chance (95 %).
    cost_tolerance: float = 4.0
    min_power: float = 1e-3  #: Parameters with a smaller power do not take part.
    different_value: float = 0.01  #: Relative difference from which a value of the equivalent model is reported.


@dataclass(frozen=True)
class PeakOptions:
    """Test for peaks in the spectrum of a residual."""

    min_tapers: int = 4  #: Smallest number of sine tapers.
    samples_per_taper: int = 2000  #: Samples per taper in longer recordings.
    neighbourhood: float = 0.4  #: Part of a frequency to both sides with which it is compared.
    #: Bins to each side that are enough for a comparison, and that are used at most.
    min_bins: int = 8
    max_bins: int = 32
    coherence_level: float = 0.01  #: Probability of calling an independent residual coherent with the input.
    same_frequency: float = 0.1  #: Relative difference within which peaks of several outputs are one.


@dataclass(frozen=True)
class RegressorOptions:
    """Candidate regressors of a residual, and the score tests for them."""

    torque: float = 0.01  #: Amplitude of a candidate torque, relative to the largest torque.
    min_periods: float = 3.0  #: Periods in the recording of the slowest candidate resonance.
    max_frequency: float = 0.3  #: Frequency of the fastest candidate resonance, relative to the sampling rate.
    damping_ratio: float = 0.05  #: Damping ratio of the candidate resonances, so that they overlap.
    wave_step: float = 0.25  #: Periods over the travel between waves over the position that are compared,
    most_waves: float = 64.0  #: the most periods of them,
    wave_samples: int = 50_000  #: and samples of an output that are used for that.
    min_share: float = 0.01  #: Part of the residual's sum of squares that a regressor has to explain.
    min_new: float = 1e-6  #: Part of a regressor that has to be independent of what is known.
    max_detected: int = 3  #: Largest number of regressors that are detected.
    max_examined: int = 16  #: Regressors that explain most are examined in detail, so many.
    #: The F statistic exceeds its distribution by the factor ``1 + inflation / degrees``, at most `max_inflation`,
    #: because the fit absorbs slow noise and the rest looks too quiet where slow regressors are. In simulations (a
    #: straight line beside four slow columns, AR poles 0 to 0.99) its mean was 0.9, 2.1, 3.2 and 2.6 times what it
    #: should be at 1800, 95, 62 and 25 degrees of freedom.
    inflation: float = 130.0
    max_inflation: float = 3.5


@dataclass(frozen=True)
class FaultOptions:
    """Faults of a recording, fitted beside the parameters."""

    largest_drift: float = 0.5  #: In parts of the largest input.
    #: Decrease of the cost, in variances of a residual, below which the fit ends: tests go by whole ones.
    negligible_decrease: float = 0.1
    min_own: float = 1e-6  #: Part of a fault's whitened response that other unknowns cannot make.
    min_jump: float = 1e-2  #: The same of its sum of squares, for a jump at a time that is looked for.
    jump_from_ends: int = 16  #: Samples at either end in which no jump is looked for.
    min_share: float = 0.01  #: Sum of squares of a jump, in parts of the residual's, that matters.
    #: Drift of the torque, over the RMS of the input, that matters: a tenth of a constant load that does.
    least_drift: float = 1e-3
    #: Part of an output's variation (30 % of its RMS) that a fit leaves if the sign of the input is to be doubted.
    missed_share: float = 0.1
    turned_share: float = 0.5  #: Part of the cost that is left, at most, with the sign of the input turned.
    sign_starts: int = 4  #: Descents with each sign.


@dataclass(frozen=True)
class DiagnosticOptions:
    """Levels and limits of findings and symptoms."""

    explained_level: float = 1e-3  #: Probability of taking a fit by chance for motion that the model explains.
    #: Correlation of two estimates from which either parameter may stand for both.
    exchangeable_correlation: float = 0.9
    reversal_speed: float = 0.02  #: Part of the largest speed that counts as motion in the other direction.
    half_sample: tuple[float, float] = (0.3, 0.7)  #: Range of a lag, in sampling intervals, that may be half a sample.
    large_lag: float = 2.0  #: Sampling intervals from which a lag is large.
    start_blocks: int = 20  #: Blocks of a recording, the first of which is compared with the others,
    start_samples: int = 20  #: samples that each has to have,
    start_ratio: float = 4.0  #: and ratio of its mean square to the largest other one from which it is reported.
    #: Probability of a regressor in residuals that follow nothing, the same of a peak, and of a fault of a recording.
    symptom_level: float = 0.01


DIAGNOSTIC_DEFAULTS = DiagnosticOptions()
EXCHANGE_DEFAULTS = ExchangeOptions()
FAULT_DEFAULTS = FaultOptions()
INFORMATIVITY_DEFAULTS = InformativityOptions()
PEAK_DEFAULTS = PeakOptions()
REGRESSOR_DEFAULTS = RegressorOptions()
