"""Estimation: parameters of a given structure from recordings, with uncertainty and an outcome."""

from brightgrey.estimation.diagnostics.finding import Finding
from brightgrey.estimation.fit import Estimate, Fit, Outcome, OutputFit, Start, fit, settings_for
from brightgrey.estimation.noise.residual_analysis import Residuals, residual_analysis
from brightgrey.estimation.optimisation.least_squares import fit_many
from brightgrey.estimation.optimisation.pattern_search import PatternSearchResult, pattern_search
from brightgrey.estimation.prediction import predict
from brightgrey.estimation.problem.scales import scales
from brightgrey.estimation.profile_likelihood import Profile, profile

__all__ = [
    "Estimate",
    "Finding",
    "Fit",
    "Outcome",
    "OutputFit",
    "PatternSearchResult",
    "Profile",
    "Residuals",
    "Start",
    "fit",
    "fit_many",
    "pattern_search",
    "predict",
    "profile",
    "residual_analysis",
    "scales",
    "settings_for",
]
