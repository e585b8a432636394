"""Levels, limits and heuristics of the diagnostics, in one place."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = [
    "DIAGNOSTIC_DEFAULTS",
    "EXCHANGE_DEFAULTS",
    "INFORMATIVITY_DEFAULTS",
    "PEAK_DEFAULTS",
    "REGRESSOR_DEFAULTS",
    "DiagnosticOptions",
    "ExchangeOptions",
    "InformativityOptions",
    "PeakOptions",
    "RegressorOptions",
]


@dataclass(frozen=True)
class InformativityOptions:
    """Tests of a recording for excitation, response and saturation, before any fit.

    Attributes
    ----------
    constant_input : float
        Standard deviation of a white input, relative to its mean, up to which it counts as constant.
    white_input_level : float
        Probability of taking white noise on the input for excitation.
    response_level : float
        Probability of taking noise for a response to the input; a fit then finds out.
    blocks : tuple of int
        Samples per block, whose means are tested for a response.
    past, short_past : int
        Past blocks that predict the next one; the second where there are few blocks.
    blocks_per_past : int
        Blocks per past block that a test needs.
    smooth_motion : float
        A prediction error below this part of the range, over the root of the number of blocks, is motion by itself. A
        random walk has 0.3 to 1.
    rounding_power : float
        Part of the power below which a prediction error is rounding.
    stop_samples : int
        Equal samples at the largest value that make a stop.
    stop_resolution, stop_change : float
        Least change per sample before or after a stop: in steps of the resolution, and relative to the usual change.
    mostly_saturated, partly_saturated : float
        Part of the samples from which an output is useless, and from which it is reported.
    """

    constant_input: float = 0.02
    white_input_level: float = 1e-5
    response_level: float = 1e-3
    blocks: tuple[int, ...] = (1, 4, 16, 32, 64)
    past: int = 8
    short_past: int = 4
    blocks_per_past: int = 8
    smooth_motion: float = 0.2
    rounding_power: float = 1e-24
    stop_samples: int = 5
    stop_resolution: float = 3.0
    stop_change: float = 0.3
    mostly_saturated: float = 0.5
    partly_saturated: float = 0.02


@dataclass(frozen=True)
class ExchangeOptions:
    """Search for an equivalent model by exchanging a lag and a pole.

    Attributes
    ----------
    widening : float
        Factor by which parameters of the equivalent model may leave their range.
    log_step : float
        Step of the logarithm for the powers with which a pole depends on parameters.
    cost_tolerance : float
        Increase of the cost, in variances of a residual, that one parameter makes by chance (95 %).
    min_power : float
        Parameters with a smaller power do not take part.
    different_value : float
        Relative difference from which a value of the equivalent model is reported.
    """

    widening: float = 1e4
    log_step: float = 1e-5
    cost_tolerance: float = 4.0
    min_power: float = 1e-3
    different_value: float = 0.01


@dataclass(frozen=True)
class PeakOptions:
    """Test for peaks in the spectrum of a residual.

    Attributes
    ----------
    min_tapers : int
        Smallest number of sine tapers.
    samples_per_taper : int
        Samples per taper in longer recordings.
    neighbourhood : float
        Part of a frequency to both sides with which it is compared.
    min_bins, max_bins : int
        Bins to each side that are enough for a comparison, and that are used at most.
    coherence_level : float
        Probability of calling an independent residual coherent with the input.
    same_frequency : float
        Relative difference within which peaks of several outputs are one.
    """

    min_tapers: int = 4
    samples_per_taper: int = 2000
    neighbourhood: float = 0.4
    min_bins: int = 8
    max_bins: int = 32
    coherence_level: float = 0.01
    same_frequency: float = 0.1


@dataclass(frozen=True)
class RegressorOptions:
    """Candidate regressors of a residual, and the score tests for them.

    Attributes
    ----------
    torque : float
        Amplitude of a candidate torque, relative to the largest torque.
    min_periods : float
        Periods in the recording of the slowest candidate resonance.
    max_frequency : float
        Frequency of the fastest candidate resonance, relative to the sampling rate.
    damping_ratio : float
        Damping ratio of the candidate resonances, so that they overlap.
    min_share : float
        Part of the residual's sum of squares that a regressor has to explain.
    min_new : float
        Part of a regressor that has to be independent of what is known.
    max_detected : int
        Largest number of regressors that are detected.
    max_examined : int
        Regressors that explain most are examined in detail, so many.
    inflation, max_inflation : float
        The F statistic exceeds its distribution by the factor ``1 + inflation / degrees``, at most `max_inflation`,
        because the fit absorbs slow noise and the rest looks too quiet where slow regressors are. In simulations (a
        straight line beside four slow columns, AR poles 0 to 0.99) its mean was 0.9, 2.1, 3.2 and 2.6 times what it
        should be at 1800, 95, 62 and 25 degrees of freedom.
    """

    torque: float = 0.01
    min_periods: float = 3.0
    max_frequency: float = 0.3
    damping_ratio: float = 0.05
    min_share: float = 0.01
    min_new: float = 1e-6
    max_detected: int = 3
    max_examined: int = 16
    inflation: float = 130.0
    max_inflation: float = 3.5


@dataclass(frozen=True)
class DiagnosticOptions:
    """Levels and limits of findings and symptoms.

    Attributes
    ----------
    explained_level : float
        Probability of taking a fit by chance for motion that the model explains.
    exchangeable_correlation : float
        Correlation of two estimates from which either parameter may stand for both.
    reversal_speed : float
        Part of the largest speed that counts as motion in the other direction.
    half_sample : (float, float)
        Range of a lag, in sampling intervals, that may be half a sample.
    large_lag : float
        Sampling intervals from which a lag is large.
    symptom_level : float
        Probability of a regressor in residuals that follow nothing, and the same of a peak.
    """

    explained_level: float = 1e-3
    exchangeable_correlation: float = 0.9
    reversal_speed: float = 0.02
    half_sample: tuple[float, float] = (0.3, 0.7)
    large_lag: float = 2.0
    symptom_level: float = 0.01


DIAGNOSTIC_DEFAULTS = DiagnosticOptions()
EXCHANGE_DEFAULTS = ExchangeOptions()
INFORMATIVITY_DEFAULTS = InformativityOptions()
PEAK_DEFAULTS = PeakOptions()
REGRESSOR_DEFAULTS = RegressorOptions()
