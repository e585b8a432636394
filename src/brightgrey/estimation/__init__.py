"""Estimation: parameters of a given structure from recordings, with uncertainty and an outcome."""

from brightgrey.estimation.finding import Finding
from brightgrey.estimation.fit import Estimate, Fit, Outcome, OutputFit, Start, fit, predict, settings_for
from brightgrey.estimation.leastsquares import descend_many
from brightgrey.estimation.pattern_search import PatternEnd, pattern_search
from brightgrey.estimation.profile import Profile, profile
from brightgrey.estimation.residuals import Residuals, residual_analysis
from brightgrey.estimation.scales import scales

__all__ = [
    "Estimate",
    "Finding",
    "Fit",
    "Outcome",
    "OutputFit",
    "PatternEnd",
    "Profile",
    "Residuals",
    "Start",
    "descend_many",
    "fit",
    "pattern_search",
    "predict",
    "profile",
    "residual_analysis",
    "scales",
    "settings_for",
]
